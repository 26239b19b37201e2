"""glcaustics: a deferred OpenGL renderer that shows physically exact caustics on real scenes, headless.

>>> import glcaustics as glc
>>> scene = glc.load_scene("pool")
>>> with glc.Renderer(scene, size=(1280, 720)) as renderer:
...     renderer.render(time=0.0).save("pool.png")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from glcaustics.errors import (
    DeviceError,
    GlcError,
    GraphError,
    ResourceLimitError,
    SceneError,
    ShaderError,
    UsageError,
)

if TYPE_CHECKING:
    from glcaustics.renderer import Frame, Renderer
    from glcaustics.scene.load import builtin_scenes, load_scene

__version__ = "0.1.0"

__all__ = [
    "DeviceError",
    "Frame",
    "GlcError",
    "GraphError",
    "Renderer",
    "ResourceLimitError",
    "SceneError",
    "ShaderError",
    "UsageError",
    "__version__",
    "builtin_scenes",
    "load_scene",
]

# Loaded on first use: importing the package must not need OpenGL, and `glcaustics --version` must be quick.
_LAZY = {
    "Frame": "glcaustics.renderer",
    "Renderer": "glcaustics.renderer",
    "builtin_scenes": "glcaustics.scene.load",
    "load_scene": "glcaustics.scene.load",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        from importlib import import_module

        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'glcaustics' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_LAZY))
