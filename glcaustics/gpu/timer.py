"""Milliseconds per pass: queries on a real GPU, a wall clock around `finish` on a software renderer."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

import moderngl

from glcaustics.gpu import gl_enums as gl
from glcaustics.gpu.rawgl import RawGL

_RING = 4  # frames in flight before a query must be read


class Timers:
    """Timings by name; nested names are measured independently.

    Args:
        ctx: the moderngl context, current.
        is_software: renderer runs on the CPU, where timer queries read next to nothing.
    """

    def __init__(self, ctx: moderngl.Context, raw: RawGL, is_software: bool) -> None:
        self.enabled = False
        self.clock = time.perf_counter  # of a software renderer; a bench may take time.process_time
        self.kind = "wall clock" if is_software else "GPU query"
        self.milliseconds: dict[str, float] = {}
        self._ctx = ctx
        self._queries = None if is_software else _TimestampQueries(raw)

    def measure(self, name: str) -> Any:
        """Context manager that times its body under the name; costs nothing while not `enabled`."""
        if not self.enabled:
            return nullcontext()
        return self._wall(name) if self._queries is None else self._query(name)

    @contextmanager
    def _wall(self, name: str) -> Iterator[None]:
        self._ctx.finish()
        start = self.clock()
        yield
        self._ctx.finish()
        self.milliseconds[name] = (self.clock() - start) * 1e3

    @contextmanager
    def _query(self, name: str) -> Iterator[None]:
        assert self._queries is not None
        start = self._queries.stamp()
        yield
        self._queries.finish(name, start, self._queries.stamp())
        self.collect()

    def collect(self, wait: bool = False) -> dict[str, float]:
        """Read what the GPU has finished, without stalling unless `wait`. Returns name -> ms, the latest of each."""
        if self._queries is not None:
            self.milliseconds.update(self._queries.collect(wait))
        return self.milliseconds

    def release(self) -> None:
        """Give the query objects back."""
        if self._queries is not None:
            self._queries.release()


class _TimestampQueries:
    """Pairs of GL timestamps (core in 3.3). Timestamps nest, which elapsed-time queries do not."""

    def __init__(self, raw: RawGL) -> None:
        self._raw = raw
        self._free: list[int] = []
        self._pending: deque[tuple[str, int, int]] = deque()

    def stamp(self) -> int:
        """Ask for the GPU's time at this point of the command stream."""
        query = self._free.pop() if self._free else self._raw.gen_query()
        self._raw.glQueryCounter(query, gl.TIMESTAMP)
        return query

    def finish(self, name: str, start: int, end: int) -> None:
        """Note a pair of stamps that belongs to the name."""
        self._pending.append((name, start, end))

    def collect(self, wait: bool) -> dict[str, float]:
        """Read finished pairs in order; a pair older than the ring is waited for."""
        done: dict[str, float] = {}
        while self._pending:
            name, start, end = self._pending[0]
            late = wait or len(self._pending) > _RING * 64
            if not late and not self._raw.query_value(end, gl.QUERY_RESULT_AVAILABLE):
                break
            nanoseconds = self._raw.query_value(end, gl.QUERY_RESULT) - self._raw.query_value(start, gl.QUERY_RESULT)
            done[name] = nanoseconds * 1e-6
            self._pending.popleft()
            self._free += [start, end]
        return done

    def release(self) -> None:
        """Delete every query object."""
        for query in [*self._free, *(q for _, start, end in self._pending for q in (start, end))]:
            self._raw.delete_query(query)
        self._free.clear()
        self._pending.clear()
