"""A plan in words and as a drawing."""

from __future__ import annotations

from collections.abc import Sequence

from glcaustics.graph.plan import Plan, Step
from glcaustics.graph.resources import TextureDesc


def megabytes(count: int) -> str:
    """Bytes as "12.6 MB" (10^6 bytes)."""
    return f"{count / 1e6:.1f} MB"


def _texture(desc: TextureDesc) -> str:
    unit = f" [{desc.unit}]" if desc.unit else ""
    return f"{desc.format} {desc.size[0]}x{desc.size[1]} {megabytes(desc.bytes())}{unit}"


def _reads(step: Step) -> list[str]:
    absent = [r for r in step.decl.optional if r not in step.present_optional]
    return (
        [*step.decl.reads]
        + [f"{r} (optional)" for r in step.present_optional]
        + [f"{r} (previous frame)" for r in step.decl.history]
        + [f"({r}: absent)" for r in absent]
    ) or ["-"]


def _rows(plan: Plan) -> list[tuple[str, str, str, str]]:
    rows = [("pass", "status", "reads", "writes")]
    for step in plan.steps:
        reads = _reads(step)
        writes = [f"{r}: {_texture(step.decl.writes[r])}" for r in step.live_writes]
        writes += [f"({r}: unread, not allocated)" for r in step.decl.writes if r not in step.live_writes]
        for i in range(max(len(reads), len(writes))):
            rows.append(
                (
                    step.name if i == 0 else "",
                    "runs" if i == 0 else "",
                    reads[i] if i < len(reads) else "",
                    writes[i] if i < len(writes) else "",
                )
            )
    return rows


def _table(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines.insert(1, "-" * max(len(line) for line in lines))
    return lines


def explain(plan: Plan) -> str:
    """Every pass in execution order with what it reads and writes, then what is left out and why, then memory."""
    lines = _table(_rows(plan))
    told = [step for step in plan.steps if step.decl.note]
    if told:
        width = max(len(step.name) for step in told)
        lines += ["", *(f"{step.name.ljust(width)}  {step.decl.note}" for step in told)]
    if plan.left_out:
        width = max(len(left.name) for left in plan.left_out)
        lines.append("")
        for left in plan.left_out:
            saved = f" (saves {megabytes(left.bytes)})" if left.bytes else ""
            lines.append(f"{left.name.ljust(width)}  left out: because {left.because}{saved}")
    culled = plan.bytes_without_culling - plan.bytes_without_aliasing
    aliased = plan.bytes_without_aliasing - plan.bytes_allocated
    lines += [
        "",
        f"{len(plan.steps)} passes run, {len(plan.left_out)} left out; outputs: {', '.join(plan.outputs)}",
        f"memory: {megabytes(plan.bytes_allocated)} in {len(plan.slot_descs)} textures; "
        f"saved by leaving out what nobody reads: {megabytes(culled)}; by sharing textures: {megabytes(aliased)}",
    ]
    return "\n".join(lines)


def to_dot(plan: Plan) -> str:
    """Passes as boxes, resources as ellipses (outputs bold), left-out passes dashed. Draw it with `dot -Tsvg`."""
    lines = ["digraph frame {", "  rankdir=LR;", "  node [fontname=Helvetica, fontsize=10];"]
    for step in plan.steps:
        lines += _dot_step(plan, step)
    for left in plan.left_out:
        label = _quote(f"{left.name}\nleft out: {left.because}")
        lines.append(f"  {_node(left.name)} [label={label}, shape=box, style=dashed, color=gray];")
    return "\n".join([*lines, "}"]) + "\n"


def _dot_step(plan: Plan, step: Step) -> list[str]:
    node = _node(step.name)
    lines = [f"  {node} [label={_quote(step.name)}, shape=box, style=filled, fillcolor=lightblue];"]
    for resource in step.live_writes:
        desc = step.decl.writes[resource]
        label = _quote(f"{resource}\n{desc.format} {desc.size[0]}x{desc.size[1]}")
        bold = ", penwidth=3" if resource in plan.outputs else ""
        lines += [f"  {_quote(resource)} [label={label}, shape=ellipse{bold}];", f"  {node} -> {_quote(resource)};"]
    lines += [f"  {_quote(resource)} -> {node};" for resource in step.decl.reads]
    lines += [f"  {_quote(resource)} -> {node} [style=dashed];" for resource in step.present_optional]
    for resource in step.decl.history:
        lines.append(f'  {_quote(resource)} -> {node} [style=dotted, constraint=false, label="previous frame"];')
    return lines


def _node(name: str) -> str:
    return _quote(f"pass {name}")


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
