"""The only place that knows the driver: contexts, shaders, textures, timers, and the host's state.

Example:
    >>> with create_device("auto") as device:                                       # doctest: +SKIP
    ...     texture = device.texture((64, 64), "rgba32f", label="demo")
    ...     device.draw_fullscreen(device.program("passes/sky/sky"), device.framebuffer([texture]))
"""

from glcaustics.gpu.device import Device
from glcaustics.gpu.open_device import create_device
from glcaustics.gpu.program import Program
from glcaustics.gpu.shader_source import ShaderLoader, glsl_root

__all__ = ["Device", "Program", "ShaderLoader", "create_device", "glsl_root"]
