"""Spatiotemporal variance-guided filtering (Schied et al. 2017) of irradiance at the camera's pixels.

Knows nothing of the method whose noise it takes: see `declare`, and docs/methods/svgf.md. Beyond the paper: histories
in 32-bit floats, resampled by polynomials through 6 x 6 texels; mixed with the new frame by what the light's change and
the noise make of them (after Schied, Peters, Dachsbacher 2018, but without re-shaded samples); a noise estimate that
does not take the caustic itself for noise; an a-trous filter in conservative form, so that the sum over the picture
stays what it was, however sparse and bright the samples are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup
from glcaustics.passes.options import check_options

SHADERS = "denoise/svgf"
COLOR, MOMENTS = "svgf.color", "svgf.moments"  # both histories: mean and its length in frames; luminance and its square
REPROJECTED, REPROJECTED_MOMENTS = "svgf.reprojected", "svgf.reprojected_moments"
DIFFERENCE, NOISE, DOUBT, CHANGE = "svgf.difference", "svgf.noise", "svgf.doubt", "svgf.change"
ESTIMATE, GUIDE = "svgf.estimate", "svgf.guide"
DEPTH, NORMAL, MOTION = "gbuffer.depth_m", "gbuffer.normal_ws", "gbuffer.motion"
BLOCK = 4  # pixels

DEFAULTS: Mapping[str, Any] = {"denoise_passes": 5, "history_frames": 64, "denoise_history": "adaptive"}
RANGES: Mapping[str, tuple[int, int]] = {"denoise_passes": (1, 8), "history_frames": (1, 1024)}
HISTORIES = ("adaptive", "exponential")
OPTION_HELP: Mapping[str, str] = {
    "denoise_passes": "a-trous passes of the filter (1..8)",
    "history_frames": "longest memory of the filter (1..1024)",
    "denoise_history": "adaptive: shortened where the light changes; exponential: alpha 0.2, bilinear, as in the "
    "paper: a baseline",
}
TAPS: Mapping[str, int] = {"adaptive": 6, "exponential": 2}  # texels in a row that a look-up in the history takes
EXPONENTIAL_FRAMES = 5  # 1 / alpha (Schied et al. 2017, sec. 5)


def check(options: Mapping[str, Any]) -> None:
    """Raise UsageError for an option of the filter that is out of its range."""
    check_options(options, "denoise", whole=RANGES, choices={"denoise_history": HISTORIES})


def declare(graph: FrameGraph, setup: FrameSetup, noisy: str, clean: str, desc: TextureDesc) -> None:
    """Add the passes that turn `noisy` into `clean`.

    Args:
        setup: its options hold those of `OPTION_HELP`.
        noisy: resource, rgba32f: an unbiased estimate in rgb at the camera's opaque pixels, with noise that is
            independent from frame to frame; alpha: samples in the pixel, 0 where that is unknown.
        clean: resource to write. desc: of both.

    Of the frame it reads depth, normal and motion of the G-buffer, and its own last results.
    """
    adaptive = setup.options["denoise_history"] == "adaptive"
    size = setup.size
    color, pair = TextureDesc("rgba32f", size, desc.unit), TextureDesc("rg32f", size)
    graph.add(
        PassDecl(
            "svgf.reproject",
            {REPROJECTED: color, REPROJECTED_MOMENTS: TextureDesc("rgba32f", size)},
            _reproject,
            reads=(DEPTH, NORMAL, MOTION),
            history=(COLOR, MOMENTS, DEPTH, NORMAL),
            note="what was there in the last frame",
            view_dependent=True,
        )
    )
    if adaptive:
        _declare_change(graph, size, noisy)
    else:
        graph.leave_out("svgf.change", "the history is a plain exponential mean")
    graph.add(
        PassDecl(
            "svgf.accumulate",
            {COLOR: color, MOMENTS: pair},
            lambda ctx: _accumulate(ctx, noisy),
            reads=(noisy, REPROJECTED, REPROJECTED_MOMENTS, *((CHANGE,) if adaptive else ())),
            note="mean over the frames",
        )
    )
    graph.add(
        PassDecl(
            "svgf.variance",
            {ESTIMATE: color, GUIDE: TextureDesc("r32f", size)},
            lambda ctx: _variance(ctx, noisy),
            reads=(noisy, COLOR, MOMENTS, DEPTH, NORMAL),
            note="how far that mean may be off",
        )
    )
    passes = int(setup.options["denoise_passes"])
    source = ESTIMATE
    for index in range(passes):
        target = clean if index == passes - 1 else f"svgf.filtered_{index}"
        _declare_atrous(graph, index, source, target, desc if target == clean else color)
        source = target


def _declare_change(graph: FrameGraph, size: tuple[int, int], noisy: str) -> None:
    blocks = (-(-size[0] // BLOCK), -(-size[1] // BLOCK))
    graph.add(
        PassDecl(
            "svgf.blocks",
            {
                DIFFERENCE: TextureDesc("rgba32f", blocks),
                NOISE: TextureDesc("rgba32f", blocks),
                DOUBT: TextureDesc("rg32f", blocks),
            },
            lambda ctx: _blocks(ctx, noisy),
            reads=(noisy, REPROJECTED, REPROJECTED_MOMENTS),
            note="how the new frame differs from the last ones",
        )
    )
    graph.add(
        PassDecl(
            "svgf.change",
            {CHANGE: TextureDesc("r32f", blocks, filter="linear")},
            _change,
            reads=(DIFFERENCE, NOISE, DOUBT),
            note="by how much that is more than noise",
        )
    )


def _declare_atrous(graph: FrameGraph, index: int, source: str, target: str, desc: TextureDesc) -> None:
    graph.add(
        PassDecl(
            f"svgf.atrous_{index}",
            {target: desc},
            lambda ctx: _atrous(ctx, source, target, 1 << index),
            reads=(source, DEPTH, NORMAL, *((GUIDE,) if source == ESTIMATE else ())),
            note=f"a-trous filter, step {1 << index} px",
        )
    )


def _draw(ctx: PassContext, shader: str, outputs: tuple[str, ...], values: dict[str, Any], **defines: int) -> None:
    program = ctx.device.program(f"{SHADERS}/{shader}", defines)
    program.set_all(values)
    ctx.device.draw_fullscreen(program, ctx.target(*outputs))


def _geometry(ctx: PassContext) -> dict[str, Any]:
    return {**ctx.frame.uniforms(), "t_depth_m": ctx.texture(DEPTH), "t_normal_ws": ctx.texture(NORMAL)}


def _reproject(ctx: PassContext) -> None:
    before = ctx.frame.history_camera or ctx.frame.previous_camera
    counted_from = ctx.frame.previous_camera.jitter_uv
    shift = (before.jitter_uv[0] - counted_from[0], before.jitter_uv[1] - counted_from[1])
    values = {
        **_geometry(ctx),
        "t_motion": ctx.texture(MOTION),
        "t_color": ctx.history(COLOR),
        "t_moments": ctx.history(MOMENTS),
        "t_previous_depth_m": ctx.history(DEPTH),
        "t_previous_normal_ws": ctx.history(NORMAL),
        "u_previous_world_from_camera": before.world_from_camera,
        "u_previous_lens": before.lens,
        "u_previous_jitter": before.jitter_uv,
        "u_history_shift": shift,
    }
    taps = TAPS[ctx.setup.options["denoise_history"]]
    _draw(ctx, "reproject", (REPROJECTED, REPROJECTED_MOMENTS), values, TAPS=taps)


def _blocks(ctx: PassContext, noisy: str) -> None:
    values = {
        "t_noisy": ctx.texture(noisy),
        "t_reprojected": ctx.texture(REPROJECTED),
        "t_moments": ctx.texture(REPROJECTED_MOMENTS),
    }
    _draw(ctx, "blocks", (DIFFERENCE, NOISE, DOUBT), values, BLOCK=BLOCK)


def _change(ctx: PassContext) -> None:
    inputs = {"t_difference": DIFFERENCE, "t_noise": NOISE, "t_doubt": DOUBT}
    _draw(ctx, "change", (CHANGE,), {sampler: ctx.texture(resource) for sampler, resource in inputs.items()})


def _accumulate(ctx: PassContext, noisy: str) -> None:
    adaptive = ctx.setup.options["denoise_history"] == "adaptive"
    values = {
        "t_noisy": ctx.texture(noisy),
        "t_reprojected": ctx.texture(REPROJECTED),
        "t_moments": ctx.texture(REPROJECTED_MOMENTS),
        "u_max_frames": float(ctx.setup.options["history_frames"] if adaptive else EXPONENTIAL_FRAMES),
        **({"t_change": ctx.texture(CHANGE)} if adaptive else {}),
    }
    _draw(ctx, "accumulate", (COLOR, MOMENTS), values, BLOCK=BLOCK, ADAPTIVE=int(adaptive))


def _variance(ctx: PassContext, noisy: str) -> None:
    values = {
        **_geometry(ctx),
        "t_noisy": ctx.texture(noisy),
        "t_color": ctx.texture(COLOR),
        "t_moments": ctx.texture(MOMENTS),
    }
    _draw(ctx, "variance", (ESTIMATE, GUIDE), values)


def _atrous(ctx: PassContext, source: str, target: str, step: int) -> None:
    values = {**_geometry(ctx), "t_source": ctx.texture(source), "u_step": step}
    guided = source == ESTIMATE
    if guided:
        values["t_guide"] = ctx.texture(GUIDE)
    _draw(ctx, "atrous", (target,), values, GUIDED=int(guided))
