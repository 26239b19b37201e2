"""`glcaustics render`: one frame or a sequence to files, with its numbers."""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import glcaustics
from glcaustics import output
from glcaustics.cli.choices import check_aovs, check_method, check_settings
from glcaustics.errors import UsageError
from glcaustics.quality import DEFAULT_QUALITY

if TYPE_CHECKING:
    from glcaustics.renderer import Frame, Renderer
    from glcaustics.scene.model import Scene

DEFAULT_SAMPLES = 4  # a pixel
PROGRESS_INTERVAL_S = 5.0  # between progress lines when stderr is not a terminal


@dataclass(frozen=True)
class Job:
    """A render command after its checks: where everything goes and what is asked of the renderer."""

    args: argparse.Namespace
    paths: tuple[Path, ...]
    json_path: Path | None  # None: no file (standard output, or no JSON asked)
    aovs: tuple[str, ...]
    options: dict[str, Any]

    @property
    def samples(self) -> int:
        """Pictures averaged a frame; one when the mean goes over the frames."""
        return self.args.samples or (1 if self.args.taa else DEFAULT_SAMPLES)


def render_command(args: argparse.Namespace) -> int:
    """Renders `args.scene`; everything that can be checked beforehand is, so that no work is lost."""
    from glcaustics.renderer import AOVS, Renderer
    from glcaustics.scene.load import load_scene

    if args.list_aovs:
        for name, description in AOVS.items():
            print(f"{name:<{max(map(len, AOVS))}}  {description}")
        return 0
    job = _check(args, AOVS)
    scene = load_scene(args.scene)
    _announce(scene.announcements)
    renderer = Renderer(
        scene,
        size=args.size,
        method=args.method,
        quality=args.quality or scene.quality or DEFAULT_QUALITY,
        backend=args.backend,
        aovs=tuple(name for name in job.aovs if name != "image"),
        specular_view=args.specular_view,
        seed=args.seed,
        options=job.options,
        taa=args.taa,
    )
    with renderer:
        _announce(renderer.announcements, said=scene.announcements)
        records = _render_frames(renderer, job)
    _report(job, scene, records)
    return 0


def _check(args: argparse.Namespace, known_aovs: dict[str, str]) -> Job:
    if args.scene is None:
        raise UsageError("which scene?", where="glcaustics render", remedy="name one: glcaustics scenes lists them")
    check_method(args.method)
    if args.taa and (args.samples or 1) > 1:
        raise UsageError("averages over frames", where="--taa", remedy="leave --samples out, or give 1")
    aovs = check_aovs(args.aov, known_aovs)
    target = output.check_output(args.output or f"{Path(args.scene).stem}.png")
    if target.suffix.lower() == ".png" and set(aovs) - {"image"}:
        raise UsageError("a PNG holds the picture alone, no AOVs", where="--aov", remedy="write -o NAME.npz or .exr")
    if target.suffix.lower() == ".npz" and not aovs:
        aovs = tuple(known_aovs)
    paths = tuple(output.frame_paths(target, args.frames))
    if len(set(paths)) != len(paths):
        raise UsageError("two frames would get one name", where=str(target), remedy="widen the number field")
    json_path = None
    if args.json and args.json != "-":
        json_path = Path(args.json)
        output.check_writable(json_path)
        if json_path in paths:
            raise UsageError("is both the picture and the JSON file", where=args.json, remedy="name another file")
    return Job(args, paths, json_path, aovs, check_settings(args.settings))


def _render_frames(renderer: Renderer, job: Job) -> list[dict[str, Any]]:
    args, records = job.args, []
    progress = Progress(len(job.paths))
    for index, path in enumerate(job.paths):
        time_s = args.time + index / args.fps
        frame = renderer.render(time=time_s, samples=job.samples)
        _store(frame, path, job.aovs)
        records.append({"index": index, "time_s": time_s, "file": str(path), "stats": frame.stats})
        progress.step(index + 1, path)
    progress.close()
    return records


def _store(frame: Frame, path: Path, aovs: tuple[str, ...]) -> None:
    missing = [name for name in aovs if name != "image" and name not in frame.aov]
    if missing:
        raise UsageError(f"this scene delivers no {', '.join(missing)}", where="--aov", remedy="leave it out")
    kept = {name: frame.aov[name] for name in aovs if name != "image"}
    output.save_frame(path, image=frame.image, ldr=frame.ldr, aov=kept)


def _announce(lines: Iterable[str], *, said: Iterable[str] = ()) -> None:
    for line in lines:
        if line not in said:
            print(f"note: {line}", file=sys.stderr)


class Progress:
    """Frames done, on stderr: one line that renews itself on a terminal, else a line every few seconds."""

    def __init__(self, frames: int) -> None:
        self.frames = frames
        self.terminal = sys.stderr.isatty()
        self.start_s = self.last_s = time.monotonic()

    def step(self, done: int, path: Path) -> None:
        """Tells that `done` frames are finished, the last one in `path`."""
        now_s = time.monotonic()
        if self.frames == 1 or not (self.terminal or now_s - self.last_s >= PROGRESS_INTERVAL_S):
            return
        self.last_s = now_s
        left_s = (now_s - self.start_s) / done * (self.frames - done)
        line = f"frame {done}/{self.frames}: {path.name}, {left_s:.0f} s left"
        print(
            f"\r\033[K{line}" if self.terminal else line, end="" if self.terminal else "\n", file=sys.stderr, flush=True
        )

    def close(self) -> None:
        """Ends the renewing line."""
        if self.terminal and self.frames > 1:
            print(file=sys.stderr)


def _report(job: Job, scene: Scene, records: list[dict[str, Any]]) -> None:
    args, stats = job.args, records[-1]["stats"]
    frame_ms = statistics.median(record["stats"]["frame_ms"] for record in records)
    document = {
        "glcaustics": glcaustics.__version__,
        "scene": scene.name,
        "size": list(args.size),
        "seed": args.seed,
        "fps": args.fps,
        "specular_view": args.specular_view,
        "median_frame_ms": frame_ms,
        "frames": records,
    }
    if args.json:
        text = json.dumps(document, indent=2, allow_nan=False) + "\n"
        if job.json_path is None:
            sys.stdout.write(text)
        else:
            output.write_text(job.json_path, text)
    files = str(job.paths[0]) if len(job.paths) == 1 else f"{job.paths[0]} ... {job.paths[-1].name}"
    summary = (
        f"{files}: {args.size[0]}x{args.size[1]}, method {stats['method']}, quality {stats['quality']}, "
        f"{frame_ms:.1f} ms per frame on {stats['backend']}, {_lost_flux(stats)}"
    )
    print(summary, file=sys.stderr if args.json == "-" else sys.stdout)


def _lost_flux(stats: dict[str, Any]) -> str:
    lost = stats.get("lost_flux")
    return "no caustics" if lost is None else f"lost flux {100.0 * lost:.2f} %"
