"""Runs a compiled plan: allocates its textures once, then executes its steps frame by frame."""

from __future__ import annotations

import moderngl

from glcaustics.gpu import Device
from glcaustics.graph import Plan, TextureDesc
from glcaustics.passes.frame import FrameSetup, FrameState, PassContext


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
        self.skipped: frozenset[str] = frozenset()

    def _allocate(self, desc: TextureDesc, label: str) -> moderngl.Texture:
        return self.device.texture(desc.size, desc.format, filter=desc.filter, compare=desc.compare, label=label)

    def run(self, frame: FrameState) -> None:
        """Execute every step; those that the camera does not enter only when the scene has moved since."""
        same = self._still_version == frame.gpu.version
        self.skipped = self._still if same else frozenset()
        self._still_version = frame.gpu.version
        for step in self.plan.steps:
            if step.name in self.skipped:
                continue
            with self.device.timer(step.name):
                step.decl.execute(PassContext(step, self.device, self.setup, frame, self._textures, self._framebuffers))

    def texture(self, resource: str) -> moderngl.Texture:
        """An output of the plan."""
        return self._textures[resource]

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
