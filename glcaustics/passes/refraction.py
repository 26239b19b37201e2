"""What the eye sees through water and glass and in mirrors: the specular layer over the shaded opaque layer."""

from __future__ import annotations

from typing import Any

import numpy as np

from glcaustics.errors import UsageError
from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes import specular_layers
from glcaustics.passes.context import PassContext
from glcaustics.passes.eye_medium import EyeMediumFinder
from glcaustics.passes.frame import FrameSetup
from glcaustics.passes.geometry import KIND_INDEX, SPECULAR_KINDS, boxes_of
from glcaustics.passes.lighting import sky_uniforms
from glcaustics.passes.raster import raster_from_world, raster_uniforms
from glcaustics.scene.model import OpticalKind

SOLVERS: dict[str, str] = {
    "cascade": "Newton, then hierarchical marching for the pixels that failed, then an estimate",
    "newton": "Newton's method alone (Mayer, Assarsson, Sintorn 2026), then an estimate; reflections show the sky",
    "dda": "pixel by pixel (McGuire and Mara 2014)",
    "hierarchical": "marching over a chain of depth bounds (Uludag 2014)",
    "sousa": "the straight pixel, moved (Sousa 2005)",
}
SECOND_CHAIN = ("depth_chain2.bounds",)
PLANES, CHAIN, NEAR = ("gbuffer.plane",), ("depth_chain.bounds",), ("depth_chain.near",)
SECOND_LAYER = ("shade2.radiance", "gbuffer2.plane", "shade2.caustic_irradiance")
SOLID_LAYERS = ("specular.plane", "specular.back_plane", "specular.back_normal_ws")
_MARCH = {"cascade": 2, "newton": 0, "dda": 1, "hierarchical": 2, "sousa": 0}
OUTPUTS = {
    "RADIANCE": "view.radiance",
    "CAUSTICS_VIEW": "view.caustic_irradiance",
    "STATUS": "view.solve_status",
    "TODO": "view.todo",
    "SOLVE": "view.solve",
}
FINISHED = {name: resource for name, resource in OUTPUTS.items() if name != "TODO"}
NOT_WRITTEN = {"HAS_TODO": 0, "HAS_REFLECTION_M": 0, "HAS_BEHIND": 0}  # unless a stage does
SHADER, BEHIND = "passes/refraction/refraction", "passes/refraction/behind"
TODO_DEPTH, REFLECTION_M = "view.todo_depth", "view.reflection_m"


def check_solver(name: object) -> None:
    """Raises UsageError for an unknown `refraction` option."""
    if name not in SOLVERS:
        raise UsageError(f"option refraction is {name!r}", where="--set", remedy=f"use one of {', '.join(SOLVERS)}")


def declare(graph: FrameGraph, setup: FrameSetup) -> None:
    """Fresnel, refraction with (n/n')^2, absorption, reflection; see `refraction.frag`."""
    solver = str(setup.options["refraction"])
    cascade = solver == "cascade"
    solids = OpticalKind.SOLID in setup.kinds()
    stages = {
        TODO_DEPTH: TextureDesc("depth24", setup.size),
        **({REFLECTION_M: TextureDesc("r32f", setup.size, "m")} if _seeds(setup) else {}),
    }
    second: tuple[str, ...] = (
        SECOND_LAYER if int(setup.options.get("depth_layers", 1)) > 1 and solver != "sousa" else ()
    )
    second += SECOND_CHAIN if second and _MARCH[solver] else ()
    layers = specular_layers.reads(setup)
    graph.add(
        PassDecl(
            "refraction",
            {
                "view.radiance": TextureDesc("rgba32f", setup.size, "cd/m^2"),
                "view.caustic_irradiance": TextureDesc("rgba32f", setup.size, "lux"),
                "view.solve_status": TextureDesc("r32f", setup.size),
                "view.solve": TextureDesc("rgba32f", setup.size),
                "view.todo": TextureDesc("r8", setup.size),
                **(stages if cascade else {}),
                **specular_layers.states(setup),
            },
            _execute,
            reads=(
                *("shade.radiance", "gbuffer.depth_m", "specular.depth", "specular.depth_m", "specular.normal_ws"),
                *(PLANES if solver != "sousa" or layers else ()),
                *(CHAIN if _MARCH[solver] == 2 or layers else ()),
                *(NEAR if cascade else ()),
                *dict.fromkeys((*(SOLID_LAYERS if solids else ()), *layers)),
            ),
            optional=("caustics.irradiance", *second),
            always_writes=(
                *(("view.radiance", "view.todo", *stages) if cascade else ()),
                *specular_layers.states(setup),
            ),
            history=(REFLECTION_M,) if _seeds(setup) else (),
            note=f"what water, glass and mirrors show; eye rays: {_solver_words(setup)}{_eye_at_start(setup)}",
        )
    )


def _solver_words(setup: FrameSetup) -> str:
    """For the plan's reader: how rays are followed, and whether those in solids are looked for in the opaque layer."""
    solver = str(setup.options["refraction"])
    searches = setup.opaque_inside and solver != "sousa"
    return SOLVERS[solver] + ("; rays in solids end on what stands in them" if searches else "")


def _eye_at_start(setup: FrameSetup) -> str:
    """For the plan's reader: what the eye is in at time 0. Every frame finds it anew (FrameState.eye_medium)."""
    waters = {water.name: water for water in reversed(setup.sampled_instances)}
    instances = [i for i in (*setup.static_instances, *waters.values()) if i.optical_kind in SPECULAR_KINDS]
    medium = EyeMediumFinder().find(instances, boxes_of(instances), setup.scene.view_at(0.0).position_ws)
    return f"; {medium.words}" if medium is not None else ""


def _execute(ctx: PassContext) -> None:
    solver = str(ctx.setup.options["refraction"])
    device = ctx.device
    layers = specular_layers.shown(ctx)
    outputs = ctx.locations(**OUTPUTS)
    target = ctx.target(*OUTPUTS.values(), depth="specular.depth")
    with device.timer("refraction/opaque"):
        program = device.program("passes/refraction/opaque", {**NOT_WRITTEN, **outputs, **_eye_defines(ctx)})
        program.set_all({**_textures(ctx), **_eye_uniforms(ctx)})
        device.draw_fullscreen(program, target, depth_func="<=")
    with device.timer("refraction/first"):
        stage = {"NEWTON": int(solver in ("cascade", "newton")), "MARCH": 0 if solver == "cascade" else _MARCH[solver]}
        stage |= {"SOUSA": int(solver == "sousa"), "FINAL": int(solver != "cascade")}
        written = OUTPUTS | (specular_layers.clear_candidates(ctx) if layers else {})
        program = _program(ctx, ctx.locations(**written), **stage).set(u_mask_depth=1.0)
        if layers is not None:
            program.set(**layers.uniforms())
        device.draw_fullscreen(program, ctx.target(*written.values(), depth="specular.depth"), depth_func=">")
    if layers is not None:
        with device.timer("refraction/behind"):
            specular_layers.look(ctx, OUTPUTS, lambda written: _program(ctx, written, BEHIND, **stage))
    if solver == "cascade":
        _finish(ctx)
    if layers is not None:
        march = _MARCH[solver]
        stage |= {"NEWTON": int(solver == "newton"), "MARCH": march, "FINAL": 1, "CONTINUED": 1}
        with device.timer("refraction/continued"):
            specular_layers.go_on(ctx, FINISHED, lambda written: _program(ctx, written, **stage))


def _finish(ctx: PassContext) -> None:
    """Marches what Newton left to do and reflections that count. A depth mask skips the other pixels before any shader
    runs. All is added: the first stage has left black what is missing.
    """
    device, seeds = ctx.device, _seeds(ctx.setup)
    with device.timer("refraction/mask"):
        program = device.program("passes/refraction/todo").set(t_todo=ctx.texture("view.todo"))
        device.draw_fullscreen(program, ctx.target(depth=TODO_DEPTH), depth_func="1", depth_write=True)
    with device.timer("refraction/finish"):
        written = FINISHED | ({"REFLECTION_M": REFLECTION_M} if seeds else {})
        stage = {"NEWTON": 0, "MARCH": _MARCH["cascade"], "SOUSA": 0, "FINAL": 1, "FINISH": 1, "SEEDED": int(seeds)}
        program = _program(ctx, ctx.locations(**written), **stage).set(t_todo=ctx.texture("view.todo"))
        if seeds:
            ctx.target(REFLECTION_M).clear()
            before = ctx.frame.history_camera or ctx.frame.camera
            program.set(t_last_reflection_m=ctx.history(REFLECTION_M))
            program.set(u_last_raster_from_world=raster_from_world(before, ctx.setup.size))
        target = ctx.target(*written.values(), depth=TODO_DEPTH)
        device.draw_fullscreen(program.set(u_mask_depth=0.25), target, depth_func="<=", blend="add")


def _seeds(setup: FrameSetup) -> bool:
    """Whether reflected rays start from the last frame's solution."""
    return setup.options["refraction"] == "cascade" and bool(setup.options.get("reflection_history", False))


def _program(ctx: PassContext, outputs: dict[str, int], shader: str = SHADER, /, **stage: int) -> Any:
    """The shader's permutation for one stage, its uniforms set."""
    kinds = ctx.setup.kinds()
    defines = {
        **NOT_WRITTEN,
        **outputs,
        **_eye_defines(ctx),
        "FINAL": stage["FINAL"],
        "HAS_SECOND": int(stage["FINAL"] and ctx.has("shade2.radiance")),
        "FINISH": stage.get("FINISH", 0),
        "SEEDED": stage.get("SEEDED", 0),
        "CONTINUED": stage.get("CONTINUED", 0),
        **specular_layers.defines(ctx, continued="CONTINUED" in stage, behind=shader == BEHIND),
        "USE_NEWTON": stage["NEWTON"],
        # The cascade marches instead; and with few look-ups there is no time for it.
        "RESTARTS": int(ctx.setup.options["refraction"] == "newton" and ctx.setup.options["refraction_iterations"] > 4),
        "USE_MARCH": stage["MARCH"],
        "USE_SOUSA": stage["SOUSA"],
        "HAS_SOLID": int(OpticalKind.SOLID in kinds),
        "OPAQUE_INSIDE": int(not stage["SOUSA"] and ctx.setup.opaque_inside),
        "BEHIND": int(shader == BEHIND),
        "ORTHOGRAPHIC": int(ctx.frame.camera.orthographic),
        "HAS_MIRROR": int(OpticalKind.MIRROR in kinds),
    }
    specular = [item for item in ctx.frame.gpu.items if item.kind in SPECULAR_KINDS]
    one = specular[0].instance.material if len(specular) == 1 and specular[0].kind is not OpticalKind.MIRROR else None
    defines["ONE_OBJECT"] = KIND_INDEX[specular[0].kind] if one is not None else 0
    program = ctx.device.program(shader, defines, vertex=f"{SHADER}.vert")
    if one is not None:
        program.set(u_one_ior=one.ior_rgb(), u_one_sigma_a=one.sigma_a, u_one_transmission=one.transmission)
    options = ctx.setup.options
    program.set_all(
        {
            **ctx.frame.uniforms(),
            **raster_uniforms(ctx.frame.camera, ctx.setup.size),
            **sky_uniforms(ctx.setup),
            **_textures(ctx),
            **_eye_uniforms(ctx),
            "u_refraction_iterations": int(options["refraction_iterations"]),
            "u_refraction_steps": int(options["refraction_steps"]),
            "u_reflection_steps": int(options["reflection_steps"]),
        }
    )
    return program


def _eye_defines(ctx: PassContext) -> dict[str, int]:
    return {"HAS_EYE_MEDIUM": int(ctx.frame.eye_medium is not None)}


def _eye_uniforms(ctx: PassContext) -> dict[str, Any]:
    """The eye, the medium that it is in (uniforms of `eye_medium.glsl`), and the scene's box, where media end."""
    low, high = ctx.setup.scene_bounds_ws
    bounds = {
        "u_bounds_min_ws": tuple(low),
        "u_bounds_max_ws": tuple(high),
        "u_bounds_diagonal_m": float(np.linalg.norm(high - low)),
    }
    medium = ctx.frame.eye_medium
    if medium is None:
        return {**ctx.frame.uniforms(), **bounds}
    eye = {"sigma_a": tuple(medium.sigma_a), "ior": medium.ior, "solid": float(medium.solid + 1)}
    return {**ctx.frame.uniforms(), **bounds, **{f"u_eye_{name}": value for name, value in eye.items()}}


def _textures(ctx: PassContext) -> dict[str, Any]:
    samplers = {
        "t_radiance": "shade.radiance",
        "t_opaque_depth_m": "gbuffer.depth_m",
        "t_specular_depth_m": "specular.depth_m",
        "t_specular_normal": "specular.normal_ws",
        "t_plane": "gbuffer.plane",
        "t_bounds": "depth_chain.bounds",
        "t_near": "depth_chain.near",
        "t_front_plane": "specular.plane",
        "t_back_plane": "specular.back_plane",
        "t_back_normal": "specular.back_normal_ws",
        "t_caustics": "caustics.irradiance",
        "t_radiance2": "shade2.radiance",
        "t_plane2": "gbuffer2.plane",
        "t_bounds2": "depth_chain2.bounds",
        "t_caustics2": "shade2.caustic_irradiance",
        "t_behind_plane": "specular2.plane",
        "t_behind_normal": "specular2.normal_ws",
    }
    found = {name: ctx.texture(resource) for name, resource in samplers.items() if ctx.has(resource)}
    return {**found, "t_objects": ctx.frame.gpu.objects}
