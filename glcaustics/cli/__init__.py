"""The `glcaustics` command.

Exit codes: 0 done; 2 wrong input or a machine that lacks something, told in one line on stderr; 130 interrupted.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from glcaustics.cli.bench import bench_command
from glcaustics.cli.compare import compare_command
from glcaustics.cli.doctor import doctor_command
from glcaustics.cli.listing import plan_command, scenes_command
from glcaustics.cli.methods import methods_command
from glcaustics.cli.parser import build_parser
from glcaustics.cli.render import render_command
from glcaustics.errors import GlcError

HANDLERS = {
    "render": render_command,
    "plan": plan_command,
    "scenes": scenes_command,
    "methods": methods_command,
    "bench": bench_command,
    "doctor": doctor_command,
    "compare": compare_command,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line `argv` (default: sys.argv) and returns the exit code."""
    try:
        args = build_parser(HANDLERS).parse_args(argv)
        code: int = args.handler(args)
        sys.stdout.flush()
        return code
    except GlcError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of a pipe left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
