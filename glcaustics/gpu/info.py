"""What the driver says of itself: names, limits, and the features that the project asks about."""

from __future__ import annotations

from typing import Any

import moderngl

from glcaustics.gpu.rawgl import RawGL

_SOFTWARE = ("llvmpipe", "softpipe", "swiftshader", "swrast", "software")


def is_software(renderer: str) -> bool:
    """Whether GL_RENDERER names a renderer that runs on the CPU."""
    return any(word in renderer.lower() for word in _SOFTWARE)


def features(ctx: moderngl.Context) -> dict[str, bool]:
    """Features by name. Everything in OpenGL 3.3 core is there by definition; it is listed because users ask."""
    extensions, version = ctx.extensions, ctx.version_code
    return {
        "float_blend": version >= 300 or "GL_EXT_float_blend" in extensions,
        "float_linear": version >= 300 or "GL_OES_texture_float_linear" in extensions,
        "timer_query": version >= 330 or "GL_ARB_timer_query" in extensions,
        "debug": version >= 430 or "GL_KHR_debug" in extensions,
        "clip_control": version >= 450 or "GL_ARB_clip_control" in extensions,
        "compute": version >= 430 or "GL_ARB_compute_shader" in extensions,
    }


def device_info(ctx: moderngl.Context, raw: RawGL) -> dict[str, Any]:
    """Names, limits and features, JSON-able."""
    names = ctx.info
    return {
        "renderer": names["GL_RENDERER"],
        "vendor": names["GL_VENDOR"],
        "version": names["GL_VERSION"],
        "version_code": ctx.version_code,
        "max_texture_size": raw.integer(0x0D33),
        "max_cube_map_size": raw.integer(0x851C),
        "max_array_layers": raw.integer(0x88FF),
        "max_texture_units": raw.integer(0x8872),
        "max_draw_buffers": raw.integer(0x8824),
        "max_color_attachments": raw.integer(0x8CDF),
        "max_viewport": list(raw.integers(0x0D3A, 2)),
        "point_size_range": list(raw.floats(0x0B12, 2)),
        "max_vertex_uniform_components": raw.integer(0x8B4A),
        "max_fragment_uniform_components": raw.integer(0x8B49),
        "max_uniform_block_bytes": raw.integer(0x8A30),
        "max_vertex_attributes": raw.integer(0x8869),
        "max_samples": raw.integer(0x8D57),
        "features": features(ctx),
    }
