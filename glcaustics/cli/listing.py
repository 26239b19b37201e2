"""`glcaustics plan` and `scenes`: what would run and what there is. No OpenGL."""

from __future__ import annotations

import argparse

from glcaustics.cli.choices import check_aovs, check_method, check_settings
from glcaustics.quality import DEFAULT_QUALITY


def plan_command(args: argparse.Namespace) -> int:
    """Prints the compiled frame graph of a scene, as a table or for graphviz."""
    from glcaustics.renderer import AOVS, plan_frame
    from glcaustics.scene.load import load_scene

    method, aovs = check_method(args.method), check_aovs(args.aov, AOVS)
    scene = load_scene(args.scene)
    quality, options = args.quality or scene.quality or DEFAULT_QUALITY, check_settings(args.settings)
    plan = plan_frame(scene, args.size, method, quality, aovs, options=options)
    print(plan.to_dot() if args.dot else plan.explain())
    return 0


def scenes_command(args: argparse.Namespace) -> int:
    """Prints name, purpose and licence of the built-in scenes."""
    from glcaustics.scene.load import builtin_scenes

    rows = builtin_scenes()
    width = max((len(name) for name, _, _ in rows), default=0)
    for name, purpose, licence in rows:
        print(f"{name:<{width}}  {purpose}")
        print(f"{'':<{width}}  licence: {licence}")
    return 0
