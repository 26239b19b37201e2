"""Temporal anti-aliasing: the last step on linear radiance, before tone mapping; off unless asked for."""

from __future__ import annotations

from glcaustics.graph import FrameGraph, PassDecl, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup

RADIANCE = "taa.radiance"
PERIOD = 16  # frames after which the camera's shifts repeat; also the longest mean
OFF = "anti-aliasing over time is off (--taa, Renderer(taa=True))"


def jitter_px(index: int) -> tuple[float, float]:
    """The camera's shift in frame `index`, pixels: Halton's sequence of bases 2 and 3, around the mean of a period, so
    that the picture stands where it is without.
    """
    return tuple(halton(index % PERIOD + 1, base) - mean for base, mean in _MEANS)  # type: ignore[return-value]


def halton(index: int, base: int) -> float:
    """Element of the Halton sequence (Halton 1960), in [0, 1)."""
    value, fraction = 0.0, 1.0
    while index > 0:
        fraction /= base
        value += fraction * (index % base)
        index //= base
    return value


_MEANS = tuple((base, sum(halton(i + 1, base) for i in range(PERIOD)) / PERIOD) for base in (2, 3))


def declare(graph: FrameGraph, setup: FrameSetup, radiance: str, *, specular: bool) -> None:
    """Mean of `radiance` over the frames, followed along the motion of the first surface seen (Karis 2014, Salvi 2016).

    Args:
        radiance: resource, linear, drawn with the camera shifted by `jitter_px`; a denoised one, since every filter
            before has to undo the shifts itself.
        specular: the eye sees specular surfaces, which then move the picture.
    """
    reads = (radiance, "gbuffer.depth_m", "gbuffer.motion")
    graph.add(
        PassDecl(
            "taa",
            {RADIANCE: TextureDesc("rgba32f", setup.size, "cd/m^2", filter="linear")},
            lambda ctx: _execute(ctx, radiance, specular),
            reads=(*reads, *(("specular.depth_m", "specular.motion") if specular else ())),
            history=(RADIANCE,),
            note="anti-aliasing over the frames",
            view_dependent=True,
        )
    )


def _execute(ctx: PassContext, radiance: str, specular: bool) -> None:
    program = ctx.device.program("passes/taa/taa", {"HAS_SPECULAR": int(specular)})
    camera, before = ctx.frame.camera, ctx.frame.previous_camera
    program.set(
        t_radiance=ctx.texture(radiance),
        t_before=ctx.history(RADIANCE),
        t_depth_m=ctx.texture("gbuffer.depth_m"),
        t_motion=ctx.texture("gbuffer.motion"),
        u_world_from_camera=camera.world_from_camera,
        u_camera_lens=camera.lens,
        u_camera_jitter=camera.jitter_uv,
        u_previous_clip_from_world=before.clip_from_world,
        u_previous_jitter=before.jitter_uv,
        u_exposure=ctx.frame.exposure,
        u_max_frames=float(PERIOD),
    )
    if specular:
        program.set(
            t_specular_depth_m=ctx.texture("specular.depth_m"), t_specular_motion=ctx.texture("specular.motion")
        )
    ctx.device.draw_fullscreen(program, ctx.target(RADIANCE))
