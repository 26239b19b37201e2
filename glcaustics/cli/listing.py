"""`glcaustics plan`, `scenes` and `methods`: what would run and what there is. No OpenGL."""

from __future__ import annotations

import argparse

from glcaustics.cli.choices import check_aovs, check_method, check_settings


def plan_command(args: argparse.Namespace) -> int:
    """Prints the compiled frame graph of a scene, as a table or for graphviz."""
    from glcaustics.renderer import AOVS, plan_frame
    from glcaustics.scene.load import load_scene

    method, aovs = check_method(args.method), check_aovs(args.aov, AOVS)
    scene = load_scene(args.scene)
    quality, options = args.quality or scene.quality or "medium", check_settings(args.settings)
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


def methods_command(args: argparse.Namespace) -> int:
    """Prints every caustics method with its paper and its quality ladder."""
    from glcaustics.caustics.registry import METHODS
    from glcaustics.passes.options import OPTION_HELP

    for name, method in METHODS.items():
        print(
            f"{name}\n  {method.summary}\n  paper: {method.paper}\n  quality ladder (--quality; override with --set):"
        )
        for quality, options in method.ladder.items():
            print(f"    {quality:<10} " + "  ".join(f"{key}={value}" for key, value in options.items()))
    print("auto\n  The method that the scene names, else the renderer's choice.")
    print("none\n  No caustics: direct light alone.")
    print("with every method (--set)")
    for option, meaning in OPTION_HELP.items():
        print(f"    {option:<22} {meaning}")
    return 0
