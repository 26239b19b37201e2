"""The shader loader, without a GPU: includes, defines, `#line`, and messages that name the real file and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from glcaustics.errors import ShaderError
from glcaustics.gpu.shader_source import (
    FULLSCREEN_VERTEX,
    LINE_STRIDE,
    ShaderLoader,
    ShaderSource,
    glsl_root,
    strip_comments,
)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    put(tmp_path, FULLSCREEN_VERTEX, (glsl_root() / FULLSCREEN_VERTEX).read_text())
    return tmp_path


def put(root: Path, name: str, text: str) -> None:
    (root / name).parent.mkdir(parents=True, exist_ok=True)
    (root / name).write_text(text)


def frag(root: Path, text: str, defines: dict[str, object] | None = None) -> str:
    put(root, "x.frag", text)
    return ShaderLoader(root).load("x", defines).stages["frag"]


def refused(root: Path, text: str, defines: dict[str, object] | None = None) -> str:
    with pytest.raises(ShaderError) as caught:
        frag(root, text, defines)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_version_then_sorted_defines_then_line_directive(root: Path) -> None:
    lines = frag(root, "int a = ZED + ALPHA + ON;\n", {"ZED": 2, "ON": True, "ALPHA": 0.5}).splitlines()
    assert lines[0] == "#version 330 core"
    assert lines[1:4] == ["#define ALPHA 0.5", "#define ON 1", "#define ZED 2"]
    assert lines[4].startswith("#line ")
    assert lines[5] == "int a = ZED + ALPHA + ON;"


def test_includes_are_recursive_and_each_file_enters_once(root: Path) -> None:
    put(root, "common/c.glsl", "float c;\n")
    put(root, "common/a.glsl", '#include "common/c.glsl"\nfloat a;\n')
    put(root, "common/b.glsl", '#include "common/c.glsl"\nfloat b;\n')
    text = frag(root, '#include "common/a.glsl"\n  #  include "common/b.glsl"\n#include "common/a.glsl"\nfloat d;\n')
    order = [text.index(f"float {name};") for name in "cabd"]
    assert order == sorted(order)
    assert all(text.count(f"float {name};") == 1 for name in "abcd")


def test_a_file_first_included_under_an_if_is_there_for_others_too(root: Path) -> None:
    put(root, "a.glsl", "float a;\n")
    text = frag(root, '#if SOME\n#include "a.glsl"\n#endif\n#include "a.glsl"\n', {"SOME": 0})
    assert text.count("float a;") == 2
    assert text.count("#ifndef GLC_INCLUDED_A_GLSL") == 2


def test_a_commented_include_is_none(root: Path) -> None:
    text = frag(root, '// #include "nowhere.glsl"\n/*\n#include "nowhere.glsl"\n*/\nfloat a;\n')
    assert "float a;" in text


def test_every_line_after_an_include_finds_its_own_number(root: Path) -> None:
    put(root, "common/a.glsl", "float one;\nfloat two;\n")
    put(root, "x.frag", 'float first;\n#include "common/a.glsl"\n\nfloat fourth;\n')
    source = ShaderLoader(root).load("x")
    number, places = 0, {}
    for line in source.stages["frag"].splitlines():
        if line.startswith("#line "):
            number = int(line.split()[1])
            continue
        places[line] = source.locate(f"0:{number}(1): error").split(": error")[0]
        number += 1
    assert places["float first;"] == "x.frag:1"
    assert places["float one;"] == "common/a.glsl:1"
    assert places["float two;"] == "common/a.glsl:2"
    assert places["float fourth;"] == "x.frag:4"


@pytest.mark.parametrize(
    "message",
    ["0:{}(5): error: no", "1:{}(5): error: no", "0({}) : error C1008: no", "ERROR: 0:{}: 'u' : undeclared identifier"],
)
def test_every_drivers_way_to_name_a_place_is_understood(message: str) -> None:
    source = ShaderSource({}, ["defines", "a.frag", "common/b.glsl"])
    text = message.format(2 * LINE_STRIDE + 17)
    assert source.first_place(text) == "common/b.glsl:17"
    assert source.locate(text).startswith("common/b.glsl:17:")


def test_the_first_place_is_that_of_an_error_and_not_of_a_warning() -> None:
    source = ShaderSource({}, ["defines", "a.frag"])
    text = f"0:{LINE_STRIDE + 3}(1): warning: w\n0:{LINE_STRIDE + 9}(1): error: e"
    assert source.first_place(text) == "a.frag:9"
    assert source.first_place("error: linking failed") == ""


def test_a_missing_include_names_its_place_and_the_nearest_file(root: Path) -> None:
    put(root, "common/optics.glsl", "float n;\n")
    text = refused(root, '\n#include "comon/optics.glsl"\n')
    assert text.startswith("x.frag:2: 'comon/optics.glsl' does not exist")
    assert "nearest: common/optics.glsl" in text


def test_a_circular_include_names_the_loop(root: Path) -> None:
    put(root, "a.glsl", '#include "b.glsl"\n')
    put(root, "b.glsl", 'float b;\n#include "a.glsl"\n')
    text = refused(root, '#include "a.glsl"\n')
    assert text.startswith("b.glsl:2: circular include: a.glsl -> b.glsl -> a.glsl")


def test_a_file_that_includes_itself_is_circular(root: Path) -> None:
    assert "x.frag -> x.frag" in refused(root, '#include "x.frag"\n')


@pytest.mark.parametrize("line", ["#include <a.glsl>", "#include", '#include "a.glsl', '#include "a.glsl" b'])
def test_an_include_of_another_form_is_refused(root: Path, line: str) -> None:
    assert refused(root, line + "\n").startswith("x.frag:1: #include")


def test_a_define_that_no_stage_mentions_is_refused_with_the_nearest(root: Path) -> None:
    text = refused(root, "#if HAS_SHADOW\n#endif\n// HAS_SHADE is a comment\n", {"HAS_SHADE": 1})
    assert "HAS_SHADE" in text and "nearest: HAS_SHADOW" in text


def test_a_define_of_the_vertex_stage_alone_is_fine(root: Path) -> None:
    put(root, "y.vert", "int k = COUNT;\n")
    put(root, "y.frag", "float a;\n")
    assert "#define COUNT 3" in ShaderLoader(root).load("y", {"COUNT": 3}).stages["frag"]


@pytest.mark.parametrize("defines", [{"A B": 1}, {"A": [1]}, {"A": "1\n#error"}, {"A": None}])
def test_defines_that_are_none_are_refused(root: Path, defines: dict[str, object]) -> None:
    assert "define" in refused(root, "int a = A;\n", defines)


def test_a_missing_program_names_the_nearest(root: Path) -> None:
    put(root, "passes/sky/sky.frag", "float a;\n")
    with pytest.raises(ShaderError, match="passes/sky/skye.*nearest: passes/sky/sky.frag"):
        ShaderLoader(root).load("passes/sky/skye")


def test_without_a_vertex_shader_the_full_screen_triangle_is_taken(root: Path) -> None:
    put(root, "x.frag", "float a;\n")
    source = ShaderLoader(root).load("x")
    assert list(source.stages) == ["vert", "frag"]
    assert FULLSCREEN_VERTEX in source.files
    put(root, "own.vert", "void main() {}\n")
    assert "own.vert" in ShaderLoader(root).load("x", vertex="own.vert").files


def test_declarations_are_found_through_includes_lists_arrays_and_qualifiers(root: Path) -> None:
    put(root, "i.glsl", "const int N = 2;\n#define COUNT 5\nuniform Block { vec4 inside; };\n")
    put(
        root,
        "x.frag",
        '#include "i.glsl"\nuniform mat4 u_view;\nuniform highp float u_a, u_b[3] ,u_c;\nuniform vec4 u_k[COUNT];\n'
        "layout(location = 1) uniform\n  sampler2D t_x;\nuniform float u_given = 2.0;\nuniform int u_n[N];\n"
        "// uniform float u_comment;\nfloat f(in vec3 p) { return p.x; }\n",
    )
    put(root, "x.vert", "layout(location = 0) in vec3 in_position;\nin vec2 in_uv;\n")
    source = ShaderLoader(root).load("x")
    assert source.uniforms == {
        "u_view": "mat4", "u_a": "float", "u_b": "float", "u_c": "float", "u_k": "vec4", "t_x": "sampler2D",
        "u_given": "float", "u_n": "int", "Block": "block",
    }  # fmt: skip
    assert source.array_lengths == {"u_b": 3, "u_k": 5, "u_n": None}
    assert source.attributes == {"in_position": "vec3", "in_uv": "vec2"}


def test_strip_comments_keeps_lines() -> None:
    text = "a // b\n/* c\nd */ e\n/* never closed\nf"
    assert strip_comments(text).count("\n") == text.count("\n")
    assert not set("bcdf") & set(strip_comments(text))


def test_the_projects_own_shaders_load() -> None:
    loader = ShaderLoader()
    programs = {p.relative_to(loader.root).with_suffix("").as_posix() for p in loader.root.rglob("*.frag")}
    assert programs
    for program in sorted(programs):
        assert loader.load(program).stages["frag"].startswith("#version 330 core")
