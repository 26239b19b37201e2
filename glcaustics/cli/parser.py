"""The command line's options: names, defaults, and the checks that one value alone decides."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

import glcaustics
from glcaustics.errors import UsageError
from glcaustics.quality import DEFAULT_QUALITY, QUALITIES

BACKENDS = ("auto", "egl", "osmesa", "glfw")
MAX_SIDE_PX = 32768  # beyond any driver's limit; the driver's own is checked by the renderer


class Parser(argparse.ArgumentParser):
    """An ArgumentParser whose errors are UsageErrors: one line, like every other error."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(message, where=self.prog, remedy=f"see {self.prog} --help")


def build_parser(handlers: Mapping[str, Callable[[argparse.Namespace], int]]) -> Parser:
    """The parser of `glcaustics`; `args.handler(args)` runs the chosen command."""
    parser = Parser(prog="glcaustics", description="Renders scenes with physically exact caustics on OpenGL.")
    parser.add_argument("--version", action="version", version=f"glcaustics {glcaustics.__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def add(name: str, text: str, **more: Any) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.", **more)
        command.set_defaults(handler=handlers[name])
        return command

    _add_render_options(add("render", "render a scene to a picture or to arrays", epilog=_RENDER_EPILOG))
    plan = add("plan", "show which passes a frame needs, which are left out and why; needs no GPU")
    _add_scene(plan)
    _add_frame_options(plan)
    plan.add_argument("--dot", action="store_true", help="print the frame graph for graphviz instead of the table")
    add("scenes", "list the built-in scenes")
    methods = add("methods", "list the caustics methods, or show one's paper, quality ladder and options")
    methods.add_argument("name", nargs="?", metavar="NAME", help="a method of the list, 'auto' or 'none'")
    compare = add("compare", "print every error measure between two pictures, and map where the error is")
    compare.add_argument("reference", metavar="REFERENCE", help="a .png, .npz or .exr file")
    compare.add_argument("test", metavar="TEST", help="the file to judge, of the same size")
    compare.add_argument("-o", "--output", metavar="FILE.png", help="write a map of the absolute error")
    compare.add_argument("--aov", metavar="NAME", help="buffer of an .npz or .exr to compare (default: image)")
    compare.add_argument("--json", action="store_true", help="print JSON instead of text")
    _add_bench_options(
        add("bench", "measure error against run time of every method and of its peers", epilog=_BENCH_EPILOG)
    )
    doctor = add("doctor", "show what this machine offers, what is missing, and the command that mends it")
    doctor.add_argument("--backend", choices=BACKENDS[1:], help="look at one backend alone (default: all)")
    doctor.add_argument("--json", action="store_true", help="print JSON instead of text")
    return parser


_RENDER_EPILOG = (
    "Several frames go to numbered files: out.png becomes out.0000.png, out.0001.png, ...; "
    "a name with a number field, such as out_%%03d.png, is used as written."
)


def _add_scene(command: argparse.ArgumentParser, **more: Any) -> None:
    command.add_argument(
        "scene", metavar="SCENE", help="a built-in scene's name, or a .toml, .glb or .gltf file", **more
    )


def _add_frame_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--size", type=size, default=(1280, 720), metavar="WxH", help="pixels (default: 1280x720)")
    command.add_argument("--method", default="auto", metavar="NAME", help="caustics method, 'auto' or 'none'")
    command.add_argument("--quality", choices=QUALITIES, help=f"default: the scene's own, else {DEFAULT_QUALITY}")
    command.add_argument(
        "--aov",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="buffers to deliver beside the picture ('all': every one); see render --list-aovs",
    )
    command.add_argument(
        "--set",
        type=setting,
        action="append",
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help="an option that the quality ladder would choose, see 'glcaustics methods NAME'; may be repeated",
    )


def _add_render_options(command: argparse.ArgumentParser) -> None:
    _add_scene(command, nargs="?")
    command.add_argument("-o", "--output", metavar="FILE", help=".png, .exr or .npz (default: SCENE.png here)")
    _add_frame_options(command)
    command.add_argument("--list-aovs", action="store_true", help="list the buffers that --aov knows, and stop")
    command.add_argument(
        "--specular-view",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="whether the eye sees specular objects; without, AOVs are those of the receivers behind them",
    )
    command.add_argument(
        "--time", type=finite, default=0.0, metavar="T", help="time of the first frame, s (default: 0)"
    )
    command.add_argument("--frames", type=positive_int, default=1, metavar="N", help="number of frames (default: 1)")
    command.add_argument("--fps", type=positive, default=30.0, metavar="F", help="frames a second (default: 30)")
    command.add_argument(
        "--samples",
        type=positive_int,
        metavar="N",
        help="shifted pictures averaged against aliasing (default: 4; 1 with --taa)",
    )
    command.add_argument(
        "--taa",
        action="store_true",
        help="anti-aliasing over time: each frame is the mean over the last ones, followed along the motion",
    )
    command.add_argument("--seed", type=seed, default=0, metavar="N", help="seed of everything random (default: 0)")
    command.add_argument("--backend", choices=BACKENDS, default="auto", help="how to get OpenGL (default: auto)")
    command.add_argument("--json", metavar="FILE", help="write the frame's numbers as JSON; '-' for standard output")


_BENCH_EPILOG = (
    "Writes report.json, report.html and plots/*.png. Broken off, it goes on where it stopped. "
    "Needs the extra 'bench'. With --check the exit code is 1 when something got worse."
)


def _add_bench_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("-o", "--output", default="bench-report", metavar="DIR", help="default: bench-report")
    command.add_argument("--quick", action="store_true", help="four scenes, small, in about four minutes")
    command.add_argument(
        "--parts", nargs="+", action="extend", metavar="NAME", help="caustics, photons, mesh, eye, seen (default: all)"
    )
    for name, text in (("scenes", "of the built-in ones"), ("methods", "see methods"), ("qualities", "draft to high")):
        command.add_argument(f"--{name}", nargs="+", action="extend", metavar="NAME", help=text)
    command.add_argument("--sizes", nargs="+", type=positive_int, metavar="N", help="sides of the maps, pixels")
    command.add_argument("--backend", choices=BACKENDS, default="auto", help="how to get OpenGL (default: auto)")
    for name, text in (
        ("peers", "Mitsuba's ptracer, alone and denoised, in the same run"),
        ("validate", "hold the reference beams against Mitsuba"),
        ("scaling", "run time against pixels, light samples and triangles"),
    ):
        command.add_argument(f"--{name}", action=argparse.BooleanOptionalAction, default=True, help=text)
    command.add_argument("--check", metavar="STORED.json", help="compare with a stored report, by ratios")
    command.add_argument("--report", metavar="REPORT.json", help="with --check: take this report, measure nothing")
    command.add_argument("--table", metavar="REPORT.json", help="print the README's table of a report, and stop")


# ------------------------------------------------------------------ values


def size(text: str) -> tuple[int, int]:
    """`1280x720` -> (1280, 720)."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size; write WIDTHxHEIGHT, such as 1280x720")
    pixels = int(width), int(height)
    if not all(1 <= side <= MAX_SIDE_PX for side in pixels):
        raise argparse.ArgumentTypeError(f"{text!r}: each side must be 1 to {MAX_SIDE_PX} pixels")
    return pixels


def finite(text: str) -> float:
    """A number that is neither infinite nor NaN."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not finite")
    return value


def positive(text: str) -> float:
    """A finite number above 0."""
    value = finite(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} must be above 0")
    return value


def positive_int(text: str) -> int:
    """A whole number of at least 1."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number of at least 1")
    return int(text)


def seed(text: str) -> int:
    """A whole number that fits a 32-bit unsigned integer."""
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number from 0 to {2**32 - 1}")
    return int(text)


def setting(text: str) -> tuple[str, int | float | str]:
    """`map_size=512` -> ("map_size", 512). Numbers become numbers, everything else stays text."""
    key, equals, value = text.partition("=")
    if not (key and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a setting; write KEY=VALUE, such as map_size=512")
    for kind in (int, float):
        try:
            return key, kind(value)
        except ValueError:
            continue
    return key, value
