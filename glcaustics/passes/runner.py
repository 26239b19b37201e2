"""Runs a compiled plan: allocates its textures once, then executes its steps frame by frame."""

from __future__ import annotations

import moderngl
import numpy as np

from glcaustics.gpu import Device
from glcaustics.graph import Plan, TextureDesc
from glcaustics.passes.context import PassContext
from glcaustics.passes.frame import FrameSetup, FrameState


class PlanRunner:
    """The textures and framebuffers of one plan.

    Args:
        keep: what the camera does not enter is drawn anew only when the scene has moved.
    """

    def __init__(self, device: Device, plan: Plan, setup: FrameSetup, *, keep: bool = True) -> None:
        self.device = device
        self.plan = plan
        self.setup = setup
        labels: dict[int, str] = {}
        for resource, slot in plan.slots.items():
            labels[slot] = f"{labels[slot]} | {resource}" if slot in labels else resource
        self._slots = [self._allocate(desc, labels.get(i, "history")) for i, desc in enumerate(plan.slot_descs)]
        self._textures = {resource: self._slots[slot] for resource, slot in plan.slots.items()}
        self._framebuffers: dict[tuple[int, ...], moderngl.Framebuffer] = {}
        steps, frontier = plan.kept()
        self._still = steps if keep and set(frontier) <= set(plan.outputs) else frozenset()
        self._still_version: int | None = None
        self._has_run = False
        self._history = {r: self._slots[slot] for r, slot in plan.history_slots.items()}
        self._history_writers = {r: s.name for s in plan.steps for r in s.live_writes if r in plan.history_slots}
        for texture in self._history.values():
            self._clear(texture)
        self.skipped: frozenset[str] = frozenset()

    def _allocate(self, desc: TextureDesc, label: str) -> moderngl.Texture:
        return self.device.texture(desc.size, desc.format, filter=desc.filter, compare=desc.compare, label=label)

    def _clear(self, texture: moderngl.Texture) -> None:
        """A history must be nothing before the first frame, not what the memory held."""
        made = self.device.framebuffer([texture], label="history")
        made.clear(0.0, 0.0, 0.0, 0.0)
        self.device.release_framebuffers([made])

    def _turn_history(self) -> dict[str, moderngl.Texture]:
        """Last frame's textures become the history; what is not drawn anew is its own."""
        previous = {}
        for resource, old in self._history.items():
            if self._history_writers[resource] in self.skipped:
                previous[resource] = self._textures[resource]
                continue
            if self._has_run:
                self._history[resource], self._textures[resource] = self._textures[resource], old
            previous[resource] = self._history[resource]
        self._has_run = True
        return previous

    def run(self, frame: FrameState) -> None:
        """Execute every step; those that the camera does not enter only when the scene has moved since."""
        same = self._still_version == frame.gpu.version
        self.skipped = self._still if same else frozenset()
        self._still_version = frame.gpu.version
        previous = self._turn_history()
        for step in self.plan.steps:
            if step.name in self.skipped:
                continue
            with self.device.timer(step.name):
                context = PassContext(
                    step, self.device, self.setup, frame, self._textures, self._framebuffers, previous
                )
                step.decl.execute(context)

    def texture(self, resource: str) -> moderngl.Texture:
        """An output of the plan."""
        return self._textures[resource]

    def read(self, resource: str) -> np.ndarray:
        """An output of the plan, (H, W) or (H, W, C), row 0 lowest; 16-bit floats as float32."""
        return self.device.read(self._textures[resource])

    def step_bytes(self) -> dict[str, int]:
        """Bytes of the attachments that each step writes."""
        return {s.name: sum(s.decl.writes[r].bytes() for r in s.live_writes) for s in self.plan.steps}

    def release(self) -> None:
        """Give textures and framebuffers back."""
        self.device.release_framebuffers(self._framebuffers.values())
        for texture in self._slots:
            texture.release()
        self._framebuffers.clear()
        self._slots.clear()
        self._textures.clear()
