"""Spatiotemporal variance-guided filtering (Schied et al. 2017) of irradiance at the camera's pixels.

Beyond the paper: histories in 32-bit floats; a history that is dropped where the new frame contradicts it by more than
its noise, in the mean or in the pattern (after Schied, Peters, Dachsbacher 2018, but without re-shaded samples); an
a-trous filter in conservative form, so that the sum over the picture stays what it was, however sparse and bright the
samples are.
"""

from __future__ import annotations

from typing import Any

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.frame import FrameSetup, PassContext

SHADERS = "denoise/svgf"
COLOR, MOMENTS = "svgf.color", "svgf.moments"  # both histories: mean and its length in frames; luminance and its square
REPROJECTED, REPROJECTED_MOMENTS, BLOCKS = "svgf.reprojected", "svgf.reprojected_moments", "svgf.blocks"
ESTIMATE = "svgf.estimate"
DEPTH, NORMAL, MOTION = "gbuffer.depth_m", "gbuffer.normal_ws", "gbuffer.motion"
BLOCK = 4  # pixels


def declare(graph: FrameGraph, setup: FrameSetup, noisy: str, clean: str, desc: TextureDesc) -> None:
    """Add the passes that turn `noisy` into `clean` (rgba32f irradiance at the camera's pixels).

    Options: `denoise_passes`, `history_frames`.
    """
    size = setup.size
    blocks = (-(-size[0] // BLOCK), -(-size[1] // BLOCK))
    color, pair = TextureDesc("rgba32f", size, desc.unit), TextureDesc("rg32f", size)
    graph.add(
        PassDecl(
            "svgf.reproject",
            {REPROJECTED: color, REPROJECTED_MOMENTS: pair},
            _reproject,
            reads=(DEPTH, NORMAL, MOTION),
            history=(COLOR, MOMENTS, DEPTH, NORMAL),
            note="what was there in the last frame",
            view_dependent=True,
        )
    )
    graph.add(
        PassDecl(
            "svgf.blocks",
            {BLOCKS: TextureDesc("rgba32f", blocks)},
            lambda ctx: _blocks(ctx, noisy),
            reads=(noisy, REPROJECTED, REPROJECTED_MOMENTS),
            note="where the new frame contradicts the last one",
        )
    )
    graph.add(
        PassDecl(
            "svgf.accumulate",
            {COLOR: color, MOMENTS: pair},
            lambda ctx: _accumulate(ctx, noisy),
            reads=(noisy, REPROJECTED, REPROJECTED_MOMENTS, BLOCKS),
            note="mean over the frames",
        )
    )
    graph.add(
        PassDecl(
            "svgf.variance",
            {ESTIMATE: color},
            _variance,
            reads=(COLOR, MOMENTS, DEPTH, NORMAL),
            note="how far that mean may be off",
        )
    )
    passes = int(setup.options["denoise_passes"])
    source = ESTIMATE
    for index in range(passes):
        target = clean if index == passes - 1 else f"svgf.filtered_{index}"
        _declare_atrous(graph, index, source, target, desc if target == clean else color)
        source = target


def _declare_atrous(graph: FrameGraph, index: int, source: str, target: str, desc: TextureDesc) -> None:
    graph.add(
        PassDecl(
            f"svgf.atrous_{index}",
            {target: desc},
            lambda ctx: _atrous(ctx, source, target, 1 << index),
            reads=(source, DEPTH, NORMAL),
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
    _draw(ctx, "reproject", (REPROJECTED, REPROJECTED_MOMENTS), values)


def _blocks(ctx: PassContext, noisy: str) -> None:
    values = {
        "t_noisy": ctx.texture(noisy),
        "t_reprojected": ctx.texture(REPROJECTED),
        "t_moments": ctx.texture(REPROJECTED_MOMENTS),
    }
    _draw(ctx, "blocks", (BLOCKS,), values, BLOCK=BLOCK)


def _accumulate(ctx: PassContext, noisy: str) -> None:
    values = {
        "t_noisy": ctx.texture(noisy),
        "t_reprojected": ctx.texture(REPROJECTED),
        "t_moments": ctx.texture(REPROJECTED_MOMENTS),
        "t_blocks": ctx.texture(BLOCKS),
        "u_max_frames": float(ctx.setup.options["history_frames"]),
    }
    _draw(ctx, "accumulate", (COLOR, MOMENTS), values, BLOCK=BLOCK)


def _variance(ctx: PassContext) -> None:
    values = {**_geometry(ctx), "t_color": ctx.texture(COLOR), "t_moments": ctx.texture(MOMENTS)}
    _draw(ctx, "variance", (ESTIMATE,), values)


def _atrous(ctx: PassContext, source: str, target: str, step: int) -> None:
    _draw(ctx, "atrous", (target,), {**_geometry(ctx), "t_source": ctx.texture(source), "u_step": step})
