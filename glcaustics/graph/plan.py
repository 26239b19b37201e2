"""The compiled frame: which passes run in which order, on which textures, and why the others do not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from glcaustics.errors import GraphError
from glcaustics.graph.resources import PassDecl, TextureDesc


@dataclass(frozen=True)
class Step:
    """A pass that runs.

    Args:
        decl: what it declared.
        live_writes: those of its attachments that exist, in the order of declaration.
        present_optional: those of its optional reads that some pass writes.
    """

    decl: PassDecl
    live_writes: tuple[str, ...]
    present_optional: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the pass."""
        return self.decl.name

    @property
    def readable(self) -> tuple[str, ...]:
        """Everything of this frame that the pass may read."""
        return (*self.decl.reads, *self.present_optional)


@dataclass(frozen=True)
class LeftOut:
    """A pass that does not run, why, and the bytes its attachments would have taken."""

    name: str
    because: str
    bytes: int = 0


@dataclass(frozen=True)
class Plan:
    """What `FrameGraph.compile` decided.

    Args:
        steps: in execution order.
        left_out: not applicable passes, then culled ones.
        outputs: resources that outlive the frame.
        slots: live resource -> index of its texture in `slot_descs`.
        slot_descs: the textures to allocate.
        history_slots: resource -> index of the texture that holds the previous frame's values; the renderer swaps
            it with `slots[resource]` after each frame.
        bytes_allocated: memory of `slot_descs`.
        bytes_without_aliasing: the same if no two resources shared a texture.
        bytes_without_culling: the same if, besides, every declared pass ran with all its attachments.
    """

    steps: tuple[Step, ...]
    left_out: tuple[LeftOut, ...]
    outputs: tuple[str, ...]
    slots: Mapping[str, int]
    slot_descs: tuple[TextureDesc, ...]
    history_slots: Mapping[str, int]
    bytes_allocated: int
    bytes_without_aliasing: int
    bytes_without_culling: int

    def desc(self, resource: str) -> TextureDesc:
        """Texture of a live resource. Raises GraphError when the plan does not have it."""
        for step in self.steps:
            if resource in step.live_writes:
                return step.decl.writes[resource]
        raise GraphError(f"'{resource}' is not in the plan", remedy=f"live are: {', '.join(self.slots) or 'none'}")

    def kept(self) -> tuple[frozenset[str], tuple[str, ...]]:
        """What does not depend on the camera, and so can be kept from frame to frame while the scene stands still.

        Returns:
            Names of the steps that need not run again, and the resources that others read from them; these must be
            among the outputs of `compile`, or another resource may take their texture.
        """
        moving: set[str] = set()
        steps: list[str] = []
        for step in self.steps:
            if step.decl.view_dependent or step.decl.history or any(r in moving for r in step.readable):
                moving.update(step.live_writes)
            else:
                steps.append(step.name)
        still = frozenset(steps)
        made = {r for step in self.steps if step.name in still for r in step.live_writes}
        read = (r for step in self.steps if step.name not in still for r in step.readable if r in made)
        return still, tuple(dict.fromkeys(read))

    def explain(self) -> str:
        """The plan as a table for people; see `glcaustics.graph.explain`."""
        from glcaustics.graph.explain import explain

        return explain(self)

    def to_dot(self) -> str:
        """The plan as a Graphviz digraph; see `glcaustics.graph.explain`."""
        from glcaustics.graph.explain import to_dot

        return to_dot(self)


def check_read(step: Step, resource: str) -> None:
    """Raise GraphError unless the pass declared that it reads the resource and the resource is there."""
    if resource in step.readable:
        return
    if resource in step.decl.optional:
        raise GraphError(
            f"pass '{step.name}' reads the optional '{resource}', which no pass of this frame writes",
            remedy="ask `present_optional` first",
        )
    raise _undeclared(step, "reads", resource, (*step.decl.reads, *step.decl.optional))


def check_history(step: Step, resource: str) -> None:
    """Raise GraphError unless the pass declared that it reads the previous frame's resource."""
    if resource not in step.decl.history:
        raise _undeclared(step, "reads the history of", resource, step.decl.history)


def check_write(step: Step, resource: str) -> None:
    """Raise GraphError unless the pass declared the attachment and the plan keeps it."""
    if resource in step.live_writes:
        return
    if resource in step.decl.writes:
        raise GraphError(
            f"pass '{step.name}' writes '{resource}', which nobody reads, so that it is not allocated",
            remedy="ask `live_writes` first, or list it in always_writes",
        )
    raise _undeclared(step, "writes", resource, tuple(step.decl.writes))


def _undeclared(step: Step, does: str, resource: str, declared: tuple[str, ...]) -> GraphError:
    return GraphError(
        f"pass '{step.name}' {does} '{resource}', which it did not declare",
        remedy=f"declared are: {', '.join(declared) or 'none'}",
    )
