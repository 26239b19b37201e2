"""The frame graph, without a GPU: order, culling, aliasing, errors, and what the plan says."""

from __future__ import annotations

import subprocess
import sys

import pytest

from glcaustics.errors import GraphError
from glcaustics.graph import FrameGraph, PassDecl, Plan, TextureDesc, check_history, check_read, check_write

COLOR = TextureDesc("rgba16f", (64, 32))
DEPTH = TextureDesc("depth24", (64, 32))


def decl(name: str, writes: str | dict[str, TextureDesc], reads: str = "", **more) -> PassDecl:
    """`writes` and `reads` as space-separated names; every texture of one kind unless a dict says otherwise."""
    if isinstance(writes, str):
        writes = {resource: COLOR for resource in writes.split()}
    return PassDecl(name, writes, lambda _: None, reads=tuple(reads.split()), **more)


def compiled(*decls: PassDecl, outputs: str = "out") -> Plan:
    graph = FrameGraph()
    for each in decls:
        graph.add(each)
    return graph.compile(tuple(outputs.split()))


def names(plan: Plan) -> list[str]:
    return [step.name for step in plan.steps]


# -- order ---------------------------------------------------------------------


def test_writers_run_before_readers_whatever_the_declaration_order() -> None:
    plan = compiled(decl("tonemap", "out", "lit"), decl("light", "lit", "pos"), decl("gbuffer", "pos"))
    assert names(plan) == ["gbuffer", "light", "tonemap"]


def test_independent_passes_keep_the_declaration_order() -> None:
    sources = [decl(name, f"r.{name}") for name in ("zeta", "alpha", "mid")]
    plan = compiled(*sources, decl("sum", "out", "r.alpha r.mid r.zeta"))
    assert names(plan) == ["zeta", "alpha", "mid", "sum"]


def test_an_optional_read_orders_and_keeps_its_writer_alive() -> None:
    plan = compiled(decl("light", "out", "pos", optional=("shadow", "absent")), decl("map", "shadow"), decl("g", "pos"))
    assert names(plan) == ["map", "g", "light"]
    assert plan.steps[-1].present_optional == ("shadow",)


def test_history_orders_nothing_but_keeps_its_writer_alive() -> None:
    plan = compiled(decl("resolve", "out", "now", history=("past",)), decl("draw", "now"), decl("keep", "past", "out"))
    assert names(plan) == ["draw", "resolve", "keep"]
    assert plan.slots["past"] != plan.history_slots["past"]


def test_a_pass_may_read_its_own_history() -> None:
    plan = compiled(decl("taa", "out", history=("out",)))
    assert names(plan) == ["taa"]
    assert len(plan.slot_descs) == 2


# -- culling -------------------------------------------------------------------


def test_what_nobody_reads_is_left_out_with_the_reason() -> None:
    plan = compiled(decl("sky", "out"), decl("rsm", "rsm.flux rsm.normal"))
    assert names(plan) == ["sky"]
    assert [(left.name, left.because) for left in plan.left_out] == [("rsm", "nothing reads rsm.flux, rsm.normal")]


def test_culling_is_transitive_and_says_who_would_have_read() -> None:
    plan = compiled(decl("sky", "out"), decl("caster", "c"), decl("splat", "flux", "c"))
    reasons = {left.name: left.because for left in plan.left_out}
    assert reasons == {"caster": "it is read only by what is itself left out: splat", "splat": "nothing reads flux"}


def test_unread_attachments_are_not_allocated_unless_always_written() -> None:
    writes = {"out": COLOR, "motion": COLOR, "depth": DEPTH}
    plan = compiled(decl("gbuffer", writes, always_writes=("depth",)))
    assert plan.steps[0].live_writes == ("out", "depth")
    assert set(plan.slots) == {"out", "depth"}
    assert plan.bytes_allocated == COLOR.bytes() + DEPTH.bytes()


def test_an_optional_read_of_a_culled_pass_keeps_nothing_alive() -> None:
    plan = compiled(decl("sky", "out"), decl("map", "shadow"), decl("light", "lit", optional=("shadow",)))
    assert names(plan) == ["sky"]


def test_not_applicable_passes_come_first_among_the_left_out_and_count_as_saved() -> None:
    graph = FrameGraph()
    graph.add(decl("sky", "out"))
    graph.leave_out("splat", "the scene has nothing specular", {"flux": TextureDesc("rgba32f", (512, 512))})
    plan = graph.compile(("out",))
    assert plan.left_out[0].name == "splat"
    assert plan.bytes_without_culling - plan.bytes_allocated == 512 * 512 * 16
    assert "splat  left out: because the scene has nothing specular (saves 4.2 MB)" in plan.explain()


# -- aliasing ------------------------------------------------------------------


def test_transients_of_one_kind_with_disjoint_lives_share_a_texture() -> None:
    plan = compiled(decl("a", "ra"), decl("b", "rb", "ra"), decl("c", "rc", "rb"), decl("d", "out", "rc"))
    assert plan.slots["ra"] == plan.slots["rc"] != plan.slots["rb"]
    assert len(plan.slot_descs) == 3
    assert plan.bytes_without_aliasing - plan.bytes_allocated == COLOR.bytes()


def test_a_pass_never_writes_the_texture_it_reads() -> None:
    chain = [decl(f"p{i}", f"r{i}", f"r{i - 1}" if i else "") for i in range(12)]
    plan = compiled(*chain, decl("last", "out", "r11"))
    for step in plan.steps:
        read = {plan.slots[r] for r in step.readable}
        assert not read & {plan.slots[r] for r in step.live_writes}


def test_different_sizes_formats_and_filters_do_not_share() -> None:
    kinds = [COLOR, TextureDesc("rgba16f", (32, 32)), TextureDesc("rg16f", (64, 32)),
             TextureDesc("rgba16f", (64, 32), filter="linear")]  # fmt: skip
    chain = [decl(f"p{i}", {f"r{i}": kind}, f"r{i - 1}" if i else "") for i, kind in enumerate(kinds)]
    plan = compiled(*chain, decl("last", {"out": TextureDesc("rgba8", (64, 32))}, "r3"))
    assert len(set(plan.slots.values())) == 5


def test_the_unit_does_not_keep_textures_apart() -> None:
    plan = compiled(
        decl("a", {"ra": TextureDesc("r32f", (8, 8), unit="m")}),
        decl("b", {"rb": TextureDesc("rgba8", (8, 8))}, "ra"),
        decl("c", {"rc": TextureDesc("r32f", (8, 8), unit="W/m^2")}, "rb"),
        decl("d", "out", "rc"),
    )
    assert plan.slots["ra"] == plan.slots["rc"]
    assert plan.slot_descs[plan.slots["ra"]].unit == ""
    assert plan.desc("rc").unit == "W/m^2"


def test_outputs_and_histories_have_textures_of_their_own() -> None:
    plan = compiled(
        decl("a", "early"), decl("b", "mid", "early"), decl("c", "past", "mid"),
        decl("d", "out", "past", history=("past",)), outputs="early out",
    )  # fmt: skip
    own = [plan.slots["early"], plan.slots["out"], plan.slots["past"], plan.history_slots["past"]]
    assert len(set(own)) == 4
    assert plan.slots["mid"] not in own


def test_a_late_reader_keeps_its_texture_to_itself_until_then() -> None:
    plan = compiled(
        decl("a", "ra"), decl("b", "rb", "ra"), decl("c", "rc", "rb"), decl("d", "rd", "rc"), decl("e", "out", "rd ra")
    )
    assert [r for r, slot in plan.slots.items() if slot == plan.slots["ra"]] == ["ra"]
    assert plan.slots["rd"] == plan.slots["rb"]


# -- errors --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("decls", "words"),
    [
        ([decl("a", "out"), decl("b", "out")], ("'a'", "'b'", "both write 'out'")),
        ([decl("a", "out", "gbufer.depth_m"), decl("b", "gbuffer.depth_m")], ("'a'", "nearest names: gbuffer.depth_m")),
        ([decl("a", "out", history=("past",))], ("'a'", "history of 'past'", "written by no pass")),
        ([decl("a", "x")], ("output 'out'", "written by no pass")),
        ([decl("a", "out", "y"), decl("b", "y", "z"), decl("c", "z", "y")], ("'b' reads 'z'", "'c' reads 'y'")),
        ([decl("a", "out", "out")], ("'a' reads 'out', which 'a' writes",)),
    ],
)
def test_ill_formed_graphs_are_refused_by_name(decls: list[PassDecl], words: tuple[str, ...]) -> None:
    with pytest.raises(GraphError) as caught:
        compiled(*decls)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_cycle_names_only_the_passes_of_the_loop() -> None:
    with pytest.raises(GraphError) as caught:
        compiled(decl("out_pass", "out", "y"), decl("b", "y", "z"), decl("c", "z", "y"))
    assert "out_pass" not in str(caught.value)


def test_a_read_of_what_was_left_out_tells_why() -> None:
    graph = FrameGraph()
    graph.leave_out("caster", "the scene has nothing specular", {"caster.position_ws": COLOR})
    graph.add(decl("splat", "out", "caster.position_ws"))
    with pytest.raises(GraphError, match="'splat'.*'caster'.*nothing specular"):
        graph.compile(("out",))


def test_pass_names_are_unique_among_the_left_out_too() -> None:
    graph = FrameGraph()
    graph.add(decl("a", "out"))
    with pytest.raises(GraphError, match="two passes are called 'a'"):
        graph.add(decl("a", "other"))
    with pytest.raises(GraphError, match="two passes are called 'a'"):
        graph.leave_out("a", "why not")


@pytest.mark.parametrize(
    "make",
    [
        lambda: TextureDesc("rgb32f", (4, 4)),
        lambda: TextureDesc("r8", (0, 4)),
        lambda: TextureDesc("r8", (4, 4), filter="cubic"),
        lambda: TextureDesc("rgba8", (4, 4), compare=True),
        lambda: decl("a", "out", always_writes=("depth",)),
        lambda: decl("a", "out", "x x"),
        lambda: decl("a", "out", "x", optional=("x",)),
        lambda: decl("", "out"),
    ],
)
def test_declarations_that_make_no_sense_are_refused(make) -> None:
    with pytest.raises(GraphError):
        make()


def test_access_checks_name_pass_and_resource() -> None:
    plan = compiled(
        decl("g", "pos motion"), decl("past_writer", "past"),
        decl("light", "out extra", "pos", optional=("shadow",), history=("past",)),
    )  # fmt: skip
    light = plan.steps[-1]
    check_read(light, "pos")
    check_history(light, "past")
    check_write(light, "out")
    with pytest.raises(GraphError, match="pass 'light' reads 'motion', which it did not declare"):
        check_read(light, "motion")
    with pytest.raises(GraphError, match="optional 'shadow', which no pass of this frame writes"):
        check_read(light, "shadow")
    with pytest.raises(GraphError, match="history of 'pos'"):
        check_history(light, "pos")
    with pytest.raises(GraphError, match="'extra', which nobody reads"):
        check_write(light, "extra")
    with pytest.raises(GraphError, match="'pos', which it did not declare"):
        check_write(light, "pos")


# -- what the plan says --------------------------------------------------------


def small_frame(**more) -> Plan:
    return compiled(
        decl("gbuffer", {"pos": TextureDesc("rgba32f", (640, 360), unit="m"), "motion": COLOR}),
        decl("light", "lit", "pos", optional=("shadow",)),
        decl("tonemap", "out", "lit", **more),
        decl("rsm", "flux"),
    )


def test_explain_shows_every_pass_in_order_with_formats_sizes_and_reasons() -> None:
    lines = small_frame().explain().splitlines()
    at = {name: next(i for i, line in enumerate(lines) if line.startswith(name)) for name in
          ("gbuffer", "light", "tonemap", "rsm")}  # fmt: skip
    assert at["gbuffer"] < at["light"] < at["tonemap"] < at["rsm"]
    assert "runs" in lines[at["gbuffer"]] and "pos: rgba32f 640x360 3.7 MB [m]" in lines[at["gbuffer"]]
    assert "left out: because nothing reads flux" in lines[at["rsm"]]
    assert any("(motion: unread, not allocated)" in line for line in lines)
    assert any("(shadow: absent)" in line for line in lines)
    assert "3 passes run, 1 left out; outputs: out" in lines


def test_dot_is_balanced_quoted_and_complete() -> None:
    graph = FrameGraph()
    graph.add(decl('odd "name" \\ here', "out"))
    graph.leave_out("rsm", 'the scene says "no"')
    text = graph.compile(("out",)).to_dot()
    assert text.startswith("digraph frame {") and text.endswith("}\n")
    assert '"pass odd \\"name\\" \\\\ here" -> "out";' in text
    assert 'label="rsm\\nleft out: the scene says \\"no\\""' in text
    for line in text.splitlines():
        assert line.replace("\\\\", "").replace('\\"', "").count('"') % 2 == 0, line


def test_graph_needs_no_opengl() -> None:
    code = (
        "import sys, glcaustics.graph; print([m for m in sys.modules if m.split('.')[0] in ('moderngl', 'glcontext')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
