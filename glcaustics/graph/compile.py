"""From declarations to an order: check, cull backwards from the outputs, sort, share memory. No GL import."""

from __future__ import annotations

import difflib
import heapq
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from glcaustics.errors import GraphError
from glcaustics.graph.plan import LeftOut, Plan, Step
from glcaustics.graph.resources import PassDecl, TextureDesc


class FrameGraph:
    """Collects what the passes declare; `compile` decides which of them a frame needs.

    The idea of culling by what is read, and of errors that name pass and resource, follows Filament's frame graph
    (O'Donnell 2017, "FrameGraph: Extensible Rendering Architecture in Frostbite").
    """

    def __init__(self) -> None:
        self._decls: list[PassDecl] = []
        self._left_out: list[tuple[LeftOut, Mapping[str, TextureDesc]]] = []

    def add(self, decl: PassDecl) -> None:
        """Declare a pass. Raises GraphError when the name is taken."""
        self._check_name(decl.name)
        self._decls.append(decl)

    def leave_out(self, name: str, because: str, writes: Mapping[str, TextureDesc] | None = None) -> None:
        """Record that a pass does not apply to this scene, so that the plan can say so and count the memory saved."""
        self._check_name(name)
        writes = dict(writes or {})
        self._left_out.append((LeftOut(name, because, sum(desc.bytes() for desc in writes.values())), writes))

    def _check_name(self, name: str) -> None:
        if any(decl.name == name for decl in self._decls) or any(left.name == name for left, _ in self._left_out):
            raise GraphError(f"two passes are called '{name}'", remedy="give each its own name, such as 'name@light'")

    def compile(self, outputs: Sequence[str]) -> Plan:
        """Choose, order and allocate.

        Args:
            outputs: resources that must be there when the frame ends.

        Raises:
            GraphError: two writers of a resource, a resource nobody writes, or passes that wait for each other.
        """
        outputs = tuple(dict.fromkeys(outputs))
        writer = _writers(self._decls)
        self._check_exists(writer, outputs)
        order = _topological_order(self._decls, writer)
        live_passes, needed = _flood(outputs, writer)
        steps = tuple(
            Step(
                decl,
                tuple(r for r in decl.writes if r in needed or r in decl.always_writes),
                tuple(r for r in decl.optional if r in writer),
            )
            for decl in order
            if decl.name in live_passes
        )
        left_out = tuple(left for left, _ in self._left_out) + tuple(
            _culled(decl, self._decls) for decl in self._decls if decl.name not in live_passes
        )
        persistent = set(outputs) | {r for step in steps for r in step.decl.history}
        slots, slot_descs = _assign_slots(steps, persistent)
        history_slots = {}
        for resource in dict.fromkeys(r for step in steps for r in step.decl.history):
            history_slots[resource] = len(slot_descs)
            slot_descs.append(writer[resource].writes[resource])
        live_bytes = sum(step.decl.writes[r].bytes() for step in steps for r in step.live_writes)
        live_bytes += sum(slot_descs[slot].bytes() for slot in history_slots.values())
        declared = sum(desc.bytes() for decl in self._decls for desc in decl.writes.values())
        return Plan(
            steps=steps,
            left_out=left_out,
            outputs=outputs,
            slots=slots,
            slot_descs=tuple(slot_descs),
            history_slots=history_slots,
            bytes_allocated=sum(desc.bytes() for desc in slot_descs),
            bytes_without_aliasing=live_bytes,
            bytes_without_culling=declared
            + sum(left.bytes for left, _ in self._left_out)
            + sum(slot_descs[slot].bytes() for slot in history_slots.values()),
        )

    def _check_exists(self, writer: Mapping[str, PassDecl], outputs: Iterable[str]) -> None:
        for resource in outputs:
            if resource not in writer:
                raise self._unknown(resource, f"the output '{resource}'", writer)
        for decl in self._decls:
            for resource in decl.reads:
                if resource not in writer:
                    raise self._unknown(resource, f"pass '{decl.name}' reads '{resource}', which", writer)
            for resource in decl.history:
                if resource not in writer:
                    subject = f"pass '{decl.name}' reads the history of '{resource}', which"
                    raise self._unknown(resource, subject, writer)

    def _unknown(self, resource: str, subject: str, writer: Mapping[str, PassDecl]) -> GraphError:
        for left, writes in self._left_out:
            if resource in writes:
                return GraphError(
                    f"{subject} would come from pass '{left.name}', but that is left out: {left.because}",
                    remedy="make the read optional, or leave the reader out as well",
                )
        near = difflib.get_close_matches(resource, list(writer), n=3, cutoff=0.4)
        remedy = f"nearest names: {', '.join(near)}" if near else f"written are: {', '.join(writer) or 'none'}"
        return GraphError(f"{subject} is written by no pass", remedy=remedy)


def _writers(decls: Sequence[PassDecl]) -> dict[str, PassDecl]:
    writer: dict[str, PassDecl] = {}
    for decl in decls:
        for resource in decl.writes:
            if resource in writer:
                raise GraphError(
                    f"passes '{writer[resource].name}' and '{decl.name}' both write '{resource}'",
                    remedy="let one of them write under another name",
                )
            writer[resource] = decl
    return writer


def _dependencies(decl: PassDecl, writer: Mapping[str, PassDecl]) -> list[tuple[str, str]]:
    """(resource, name of the pass that writes it) for everything the pass reads of this frame."""
    return [(r, writer[r].name) for r in (*decl.reads, *decl.optional) if r in writer]


def _topological_order(decls: Sequence[PassDecl], writer: Mapping[str, PassDecl]) -> list[PassDecl]:
    """Writers before readers; among free choices the order of declaration (Kahn 1962 with a priority queue)."""
    index = {decl.name: i for i, decl in enumerate(decls)}
    waiting = {decl.name: {name for _, name in _dependencies(decl, writer)} for decl in decls}
    readers: dict[str, list[str]] = {decl.name: [] for decl in decls}
    for reader, sources in waiting.items():
        for source in sources:
            readers[source].append(reader)
    ready = [index[name] for name, sources in waiting.items() if not sources]
    heapq.heapify(ready)
    order = []
    while ready:
        decl = decls[heapq.heappop(ready)]
        order.append(decl)
        for reader in readers[decl.name]:
            waiting[reader].discard(decl.name)
            if not waiting[reader]:
                heapq.heappush(ready, index[reader])
    if len(order) < len(decls):
        done = {decl.name for decl in order}
        raise _cycle_error([decl for decl in decls if decl.name not in done], writer)
    return order


def _cycle_error(stuck: Sequence[PassDecl], writer: Mapping[str, PassDecl]) -> GraphError:
    """Every stuck pass waits for another stuck pass, so following any of them must come round."""
    by_name = {decl.name: decl for decl in stuck}
    path: list[tuple[str, str]] = []
    name = stuck[0].name
    while name not in [visited for visited, _ in path]:
        resource, source = next((r, s) for r, s in _dependencies(by_name[name], writer) if s in by_name)
        path.append((name, resource))
        name = source
    start = [visited for visited, _ in path].index(name)
    loop = ", ".join(f"'{reader}' reads '{resource}'" for reader, resource in path[start:])
    return GraphError(
        f"passes wait for each other: {loop}, which '{name}' writes",
        remedy="read one of them as history (the previous frame's) or split a pass",
    )


def _flood(outputs: Sequence[str], writer: Mapping[str, PassDecl]) -> tuple[set[str], set[str]]:
    """Backwards from the outputs: the names of the passes that run, and the resources that somebody needs."""
    live_passes: set[str] = set()
    needed: set[str] = set()
    pending = list(outputs)
    while pending:
        resource = pending.pop()
        if resource in needed:
            continue
        needed.add(resource)
        decl = writer[resource]
        if decl.name not in live_passes:
            live_passes.add(decl.name)
            pending += [r for r in (*decl.reads, *decl.optional, *decl.history) if r in writer]
    return live_passes, needed


def _culled(decl: PassDecl, decls: Sequence[PassDecl]) -> LeftOut:
    readers = [other.name for other in decls if set((*other.reads, *other.optional, *other.history)) & set(decl.writes)]
    memory = sum(desc.bytes() for desc in decl.writes.values())
    if not decl.writes:
        return LeftOut(decl.name, "it writes nothing", memory)
    if readers:
        return LeftOut(decl.name, f"it is read only by what is itself left out: {', '.join(readers)}", memory)
    return LeftOut(decl.name, f"nothing reads {', '.join(decl.writes)}", memory)


def _assign_slots(steps: Sequence[Step], persistent: set[str]) -> tuple[dict[str, int], list[TextureDesc]]:
    """Give every live attachment a texture; transients of one kind whose lives do not overlap share it.

    A slot is free again only after the step of its last reader, never within it: a pass must not write
    the texture that it samples.
    """
    last_use: dict[str, int] = {}
    for i, step in enumerate(steps):
        for resource in (*step.live_writes, *step.decl.reads, *step.present_optional):
            last_use[resource] = i
    slots: dict[str, int] = {}
    descs: list[TextureDesc] = []
    free_from: list[int] = []  # per slot: first step that may write it anew; -1 = never shared
    for i, step in enumerate(steps):
        for resource in step.live_writes:
            desc = step.decl.writes[resource]
            slot = None
            if resource not in persistent:
                slot = next(
                    (
                        s
                        for s, free in enumerate(free_from)
                        if 0 <= free <= i and descs[s].allocation_key() == desc.allocation_key()
                    ),
                    None,
                )
            if slot is None:
                slot = len(descs)
                descs.append(desc)
                free_from.append(-1)
            elif descs[slot].unit != desc.unit:
                descs[slot] = replace(descs[slot], unit="")
            slots[resource] = slot
            free_from[slot] = -1 if resource in persistent else last_use[resource] + 1
    return slots, descs
