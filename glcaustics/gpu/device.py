"""The device: a context with checked resources, strict programs, timers and a guard for the host's state."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import moderngl

from glcaustics.errors import DeviceError, ShaderError
from glcaustics.gpu.backends import Opened
from glcaustics.gpu.draw import draw
from glcaustics.gpu.info import is_software
from glcaustics.gpu.program import Program
from glcaustics.gpu.resources import Resources
from glcaustics.gpu.shader_source import ShaderLoader, define_text
from glcaustics.gpu.state_guard import guard_state
from glcaustics.gpu.timer import Timers


class Device(Resources):
    """What the rest of the project sees of the driver. Made by `create_device`.

    Attributes:
        ctx: the moderngl context.
        backend: "egl", "osmesa", "glfw" or "host".
        announcements: lines for the user: which backend was taken and why others failed.
        info: renderer, vendor, version and limits, JSON-able.
        is_software: the renderer runs on the CPU.
        timing_enabled: whether `timer` measures.
    """

    def __init__(self, opened: Opened, backend: str, announcements: list[str], shader_root: Path | None = None) -> None:
        super().__init__(opened.ctx)
        self._opened = opened
        self.backend = backend
        self.announcements = announcements
        self.is_software = is_software(self.info["renderer"])
        self.closed = False
        self._loader = ShaderLoader(shader_root)
        self._programs: dict[tuple[Any, ...], Program] = {}
        self._bufferless: dict[Program, moderngl.VertexArray] = {}
        self._timers = Timers(self.ctx, self.raw, self.is_software)
        with guard_state(self.ctx, self.raw, self.info["max_texture_units"], None):
            self._make_resting_framebuffer()
        self.check_error("opening the device")

    # -- life ---------------------------------------------------------------------------------------------------------

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this device: needed where one program opens several. A host's context
        is the host's own business and left as it is."""
        if self.backend in ("egl", "osmesa"):
            self.ctx.mglo.__enter__()
        elif self.backend == "glfw":
            import glfw

            glfw.make_context_current(self._opened.keep)

    def close(self) -> None:
        """Release programs and, unless it is the host's, the context. Twice is once."""
        if self.closed:
            return
        self.closed = True
        self.make_current()
        self._timers.release()
        for array in self._bufferless.values():
            array.release()
        for program in self._programs.values():
            program.release()
        self._bufferless.clear()
        self._release_resting_framebuffer()
        self._programs.clear()
        self._opened.close()

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- programs and drawing -----------------------------------------------------------------------------------------

    def program(
        self,
        path: str,
        defines: Mapping[str, Any] | None = None,
        varyings: Sequence[str] = (),
        *,
        vertex: str | None = None,
    ) -> Program:
        """Load, compile and cache `glsl/<path>.vert`, `.geom`, `.frag`; without a `.vert` the full-screen triangle.

        Args:
            path: relative to `glsl/`, without suffix.
            defines: permutation; see `ShaderLoader.load`.
            varyings: outputs captured by transform feedback.
            vertex: another vertex shader, with suffix.

        Raises:
            ShaderError: with the file and line of the shader's own file.
        """
        texts = {name: define_text(path, name, value) for name, value in sorted((defines or {}).items())}
        key = (path, tuple(texts.items()), tuple(varyings), vertex)
        program = self._programs.get(key)
        if program is None:
            words = " ".join(f"{name}={text}" for name, text in texts.items())
            label = f"{path} [{words}]" if words else path
            source = self._loader.load(path, texts, vertex=vertex)
            program = Program(self.ctx, source, label, tuple(varyings))
            self._label(program.gl, label)
            self._programs[key] = program
        return program

    def vertex_array(
        self, program: Program, content: Sequence[tuple[Any, ...]], index_buffer: moderngl.Buffer | None = None
    ) -> moderngl.VertexArray:
        """Bind buffers to a program's inputs.

        Args:
            content: tuples (buffer, "3f 3f", "in_position", "in_normal"); per instance "3f/i".
            index_buffer: 32-bit unsigned indices.

        Raises:
            ShaderError: the vertex shader declares no such input. One that was optimised out is passed over.
        """
        for _, _, *names in content:
            for name in names:
                if name not in program.source.attributes:
                    declared = ", ".join(sorted(program.source.attributes)) or "none"
                    remedy = f"declared are: {declared}"
                    raise ShaderError(f"no vertex input '{name}'", where=program.label, remedy=remedy)
        return self.ctx.vertex_array(program.gl, list(content), index_buffer, skip_errors=True)

    def draw_fullscreen(
        self, program: Program, fbo: moderngl.Framebuffer, *, blend: str | None = None,
        viewport: tuple[int, int, int, int] | None = None, depth_func: str | None = None, depth_write: bool = False,
    ) -> None:  # fmt: skip
        """One triangle over the framebuffer (or a part of it): no depth test, no culling, no blending unless asked.

        `depth_func` tests depth, so that a depth buffer can mask pixels out; `depth_write` writes such a mask.
        """
        array = self._no_buffers(program)
        self.draw(
            array,
            program,
            fbo,
            vertices=3,
            blend=blend,
            viewport=viewport,
            depth_func=depth_func,
            depth_write=depth_write,
        )

    def draw_points(
        self,
        program: Program,
        fbo: moderngl.Framebuffer,
        count: int,
        *,
        blend: str | None = None,
        viewport: tuple[int, int, int, int] | None = None,
    ) -> None:
        """`count` points without buffers: the vertex shader places them by gl_VertexID and sets gl_PointSize."""
        array = self._no_buffers(program)
        self.draw(array, program, fbo, mode="points", vertices=count, blend=blend, viewport=viewport, point_size=True)

    def draw_triangles(
        self,
        program: Program,
        fbo: moderngl.Framebuffer,
        count: int,
        *,
        blend: str | None = None,
        viewport: tuple[int, int, int, int] | None = None,
    ) -> None:
        """`count` triangles without buffers, depth test or culling: the vertex shader places them by gl_VertexID."""
        self.draw(self._no_buffers(program), program, fbo, vertices=3 * count, blend=blend, viewport=viewport)

    def _no_buffers(self, program: Program) -> moderngl.VertexArray:
        array = self._bufferless.get(program)
        if array is None:
            array = self._bufferless[program] = self.ctx.vertex_array(program.gl, [])
        return array

    def draw(
        self,
        array: moderngl.VertexArray,
        program: Program,
        fbo: moderngl.Framebuffer,
        *,
        mode: str = "triangles",
        vertices: int = -1,
        instances: int = 1,
        first: int = 0,
        depth_func: str | None = None,
        depth_write: bool = True,
        blend: str | None = None,
        cull: str | None = None,
        point_size: bool = False,
        viewport: tuple[int, int, int, int] | None = None,
    ) -> None:
        """Draw with exactly the state that is named here; nothing carries over from an earlier draw.

        Args:
            mode: "triangles", "triangle_strip", "points", "lines" or "line_strip".
            vertices, instances, first: as in moderngl; -1 vertices = all.
            depth_func: "<", "<=", ">", ">=", "==", "1" (always), or None for no depth test and no depth write.
            depth_write: with a depth test, whether depth is written.
            blend: None, "add", "alpha", "min" or "max". Additive blending into 32-bit float needs no more than GL 3.3.
            cull: None, "back" or "front".
            point_size: `gl_PointSize` counts.
            viewport: (x, y, width, height) in texels; the whole framebuffer by default.

        Raises:
            ShaderError: a sampler without texture, or one whose texture is also drawn to.
        """
        draw(
            self.ctx, array, program, fbo, mode=mode, vertices=vertices, instances=instances, first=first,
            depth_func=depth_func, depth_write=depth_write, blend=blend, cull=cull, point_size=point_size,
            viewport=viewport,
        )  # fmt: skip

    # -- measuring and manners ----------------------------------------------------------------------------------------

    @property
    def timing_enabled(self) -> bool:
        """Whether `timer` measures; off at first."""
        return self._timers.enabled

    @timing_enabled.setter
    def timing_enabled(self, on: bool) -> None:
        self._timers.enabled = on

    @property
    def timer_kind(self) -> str:
        """ "GPU query", or "wall clock" (around finish) on a software renderer."""
        return self._timers.kind

    def count_processor_time(self) -> None:
        """On a software renderer the timers count the process's time, all threads, from now on: for a busy machine."""
        self._timers.clock = time.process_time

    @property
    def timings(self) -> dict[str, float]:
        """Name -> milliseconds, the latest measured; on a GPU a few frames old."""
        return dict(self._timers.collect())

    def timer(self, name: str) -> AbstractContextManager[None]:
        """Time the body under a name; nests."""
        measure: AbstractContextManager[None] = self._timers.measure(name)
        return measure

    def finish_timings(self) -> dict[str, float]:
        """Wait for outstanding timer queries and return the timings."""
        return dict(self._timers.collect(wait=True))

    def guard_state(self) -> AbstractContextManager[None]:
        """Within: a clean OpenGL state. After: the host's state as it was.

        Framebuffers, viewport, scissor, program, vertex array, buffers, textures and samplers by unit, blending, depth,
        culling, colour masks, pixel store, clip control, and moderngl's own copies of them.
        """
        if self.closed:
            raise DeviceError("the device is closed", where=self.backend, remedy="open a new one")
        self.make_current()
        return guard_state(self.ctx, self.raw, self.info["max_texture_units"], self._resting)

    def check_error(self, where: str) -> None:
        """Raise DeviceError when OpenGL has recorded an error."""
        error = self.ctx.error
        if error != "GL_NO_ERROR":
            raise DeviceError(f"OpenGL reports {error}", where=where)
