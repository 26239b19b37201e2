"""What the driver says of itself: names, limits, and the features that the project asks about."""

from __future__ import annotations

from typing import Any

import moderngl

from glcaustics.gpu import gl_enums as gl
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
        "max_texture_size": raw.integer(gl.MAX_TEXTURE_SIZE),
        "max_cube_map_size": raw.integer(gl.MAX_CUBE_MAP_TEXTURE_SIZE),
        "max_array_layers": raw.integer(gl.MAX_ARRAY_TEXTURE_LAYERS),
        "max_texture_units": raw.integer(gl.MAX_TEXTURE_IMAGE_UNITS),
        "max_draw_buffers": raw.integer(gl.MAX_DRAW_BUFFERS),
        "max_color_attachments": raw.integer(gl.MAX_COLOR_ATTACHMENTS),
        "max_viewport": list(raw.integers(gl.MAX_VIEWPORT_DIMS, 2)),
        "point_size_range": list(raw.floats(gl.POINT_SIZE_RANGE, 2)),
        "max_vertex_uniform_components": raw.integer(gl.MAX_VERTEX_UNIFORM_COMPONENTS),
        "max_fragment_uniform_components": raw.integer(gl.MAX_FRAGMENT_UNIFORM_COMPONENTS),
        "max_uniform_block_bytes": raw.integer(gl.MAX_UNIFORM_BLOCK_SIZE),
        "max_vertex_attributes": raw.integer(gl.MAX_VERTEX_ATTRIBS),
        "max_samples": raw.integer(gl.MAX_SAMPLES),
        "features": features(ctx),
    }
