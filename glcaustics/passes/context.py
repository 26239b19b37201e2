"""What a pass gets to execute with."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from glcaustics.errors import GraphError
from glcaustics.gpu import Device
from glcaustics.graph import Step, check_history, check_read, check_write
from glcaustics.passes.frame import FrameSetup, FrameState


class PassContext:
    """A pass's textures and targets, and nothing that it did not declare."""

    def __init__(
        self,
        step: Step,
        device: Device,
        setup: FrameSetup,
        frame: FrameState,
        textures: Mapping[str, moderngl.Texture],
        framebuffers: dict[tuple[int, ...], moderngl.Framebuffer],
        history: Mapping[str, moderngl.Texture] | None = None,
    ) -> None:
        self.step = step
        self.device = device
        self.setup = setup
        self.frame = frame
        self._textures = textures
        self._framebuffers = framebuffers
        self._history = history or {}

    def history(self, resource: str) -> moderngl.Texture:
        """A declared history: the resource as the last frame left it, zero before the first.

        Raises:
            GraphError: not declared.
        """
        check_history(self.step, resource)
        return self._history[resource]

    def texture(self, resource: str) -> moderngl.Texture:
        """A declared read, or what an earlier draw of the same pass wrote. Raises GraphError otherwise."""
        if resource not in self.step.live_writes:
            check_read(self.step, resource)
        return self._textures[resource]

    def has(self, resource: str) -> bool:
        """Whether a declared optional read is there."""
        return resource in self.step.readable

    def live(self, resource: str) -> bool:
        """Whether somebody reads this attachment."""
        if resource not in self.step.decl.writes:
            raise GraphError(f"pass '{self.step.name}' asks for '{resource}', which it does not write")
        return resource in self.step.live_writes

    def target(self, *resources: str, depth: str | None = None) -> moderngl.Framebuffer:
        """A framebuffer of the live ones among the attachments, in order. Kept from frame to frame.

        `depth`: written by this pass, or a declared read to test against (draw without writing it).
        """
        for resource in (*resources, *([depth] if depth and depth not in self.step.readable else [])):
            if resource not in self.step.decl.writes:
                check_write(self.step, resource)
        colors = [self._textures[r] for r in resources if r in self.step.live_writes]
        depth_texture = self._textures[depth] if depth is not None else None
        key = tuple(t.glo for t in (*colors, *([depth_texture] if depth_texture else [])))
        found = self._framebuffers.get(key)
        if found is None:
            found = self._framebuffers[key] = self.device.framebuffer(colors, depth_texture, self.step.name)
        return found

    def locations(self, **outputs: str) -> dict[str, int]:
        """Defines HAS_X and LOCATION_X for each live attachment, HAS_X 0 for the others; outputs: X -> resource."""
        defines: dict[str, int] = {}
        location = 0
        for name, resource in outputs.items():
            defines[f"HAS_{name}"] = int(self.live(resource))
            if self.live(resource):
                defines[f"LOCATION_{name}"] = location
                location += 1
        return defines
