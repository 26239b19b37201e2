"""Cells done, on stderr: one line that renews itself on a terminal, else a line every few seconds."""

from __future__ import annotations

import sys
import time

BAR = 24
INTERVAL_S = 5.0  # between lines when stderr is not a terminal


class Progress:
    """A bar with the label of what is measured now and a guess of what is left."""

    def __init__(self, total: int) -> None:
        self.total, self.done = max(total, 1), 0
        self._terminal = sys.stderr.isatty()
        self._start = time.monotonic()
        self._last = self._start - INTERVAL_S

    def step(self, label: str) -> None:
        """Tells that the next cell begins."""
        now = time.monotonic()
        share = min(self.done / self.total, 1.0)
        left = f", about {(now - self._start) / self.done * (self.total - self.done):.0f} s left" if self.done else ""
        self.done += 1
        if not self._terminal and now - self._last < INTERVAL_S:
            return
        self._last = now
        filled = round(share * BAR)
        line = f"[{'#' * filled}{'.' * (BAR - filled)}] {self.done}/{self.total} {label}{left}"
        if self._terminal:
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Ends the renewing line."""
        if self._terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
