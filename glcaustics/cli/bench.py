"""`glcaustics bench`: error against run time, with peers, as report.json, plots and report.html."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glcaustics.cli.choices import check_name
from glcaustics.errors import UsageError
from glcaustics.output import write_bytes, write_text

if TYPE_CHECKING:
    from glcaustics.bench.plan import Plan


def bench_command(args: argparse.Namespace) -> int:
    """Measures, compares or prints. Exit code 1: `--check` found a regression."""
    if args.table is not None:
        from glcaustics.bench.readme import table

        print(table(read_report(args.table)))
        return 0
    if args.report is not None and args.check is None:
        raise UsageError("nothing to do with it", where="--report", remedy="give --check STORED.json too")
    stored = read_report(args.check) if args.check is not None else None
    report = read_report(args.report) if args.report is not None else _measure(args)
    return 0 if stored is None else _compare(stored, report)


def read_report(path: str) -> dict[str, Any]:
    """A stored report.json. Raises UsageError when it is not one."""
    from glcaustics.bench.study import SCHEMA

    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or str(error)
        raise UsageError(f"cannot read the report: {reason}", where=path, remedy="name a report.json") from error
    except ValueError as error:
        raise UsageError(f"is not JSON: {error}", where=path, remedy="name a report.json of bench") from error
    found = document.get("schema") if isinstance(document, dict) else None
    if found != SCHEMA:
        raise UsageError(f"schema is {found!r}, not {SCHEMA!r}", where=path, remedy="measure again with this version")
    return dict(document)


def _measure(args: argparse.Namespace) -> dict[str, Any]:
    from glcaustics.bench.page import page
    from glcaustics.bench.plots import plots
    from glcaustics.bench.study import Study
    from glcaustics.bench.tables import all_tables

    folder = Path(args.output)
    arguments = [a for a in sys.argv[1:] if a != "bench"]
    study = Study(_plan(args), folder, peers=args.peers, command=shlex.join(["glcaustics", "bench", *arguments]))
    report = study.run()
    drawn = plots(report)
    (folder / "plots").mkdir(exist_ok=True)
    for name, png in drawn.items():
        write_bytes(folder / "plots" / name, png)
    write_text(folder / "report.html", page(report, study.images, drawn, study.pictures))
    write_text(folder / "report.json", json.dumps(report, indent=1, allow_nan=False) + "\n")
    flooded = [one["validation"] | {"scene": one["scene"]} for one in report.get("photons", []) if one["validation"]]
    for v in (*report["validation"], *flooded):
        if not v["agree"]:
            text = (
                f"{v['scene']}: beams and Mitsuba differ by {v['ratio']:.2f} times their noise, bias {v['bias']:+.2%}"
            )
            print(f"warning: {text}", file=sys.stderr)
    for one in all_tables(report):
        print(one.text(), end="\n\n")
    print(f"{folder / 'report.html'}: {len(report['rows'])} measurements, {report['seconds']:.0f} s")
    return report


def _plan(args: argparse.Namespace) -> Plan:
    from glcaustics.bench.plan import FULL, PARTS, QUICK
    from glcaustics.bench.targets import TARGETS
    from glcaustics.caustics.registry import METHODS
    from glcaustics.quality import QUALITIES

    plan = QUICK if args.quick else FULL
    known: dict[str, tuple[list[str] | None, Iterable[str], str]] = {
        "scenes": (args.scenes, TARGETS, "scene with a target"),
        "methods": (args.methods, METHODS, "caustics method"),
        "qualities": (args.qualities, QUALITIES, "quality"),
        "parts": (args.parts, PARTS, "part of the bench"),
    }
    changes: dict[str, Any] = {}
    for name, (given, names, kind) in known.items():
        if given:
            wanted = [part for text in given for part in text.split(",") if part]
            changes[name] = tuple(dict.fromkeys(check_name(w, names, option=f"--{name}", kind=kind) for w in wanted))
    if args.sizes:
        changes["sizes"] = tuple(dict.fromkeys(args.sizes))
    if not args.validate:
        changes["validate"] = 0
    if not args.scaling:
        changes["scaling_scene"] = None
    return replace(plan, backend=args.backend, **changes)


def _compare(stored: dict[str, Any], report: dict[str, Any]) -> int:
    from glcaustics.bench.analysis import regressions

    worse, compared = regressions(stored, report)
    if compared == 0:
        remedy = "measure the same scenes, methods, qualities and sizes"
        raise UsageError("the two reports have no measurement in common", where="--check", remedy=remedy)
    for line in worse:
        print(f"regression: {line}")
    print(f"{compared} measurements compared, {len(worse)} regressions")
    return 1 if worse else 0
