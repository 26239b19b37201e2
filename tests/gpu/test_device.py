"""Textures, framebuffers, programs, uniforms, draws and timers of the device."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from glcaustics.errors import DeviceError, ResourceLimitError, ShaderError, UsageError
from glcaustics.gpu import Device, Program, ShaderLoader, glsl_root
from glcaustics.gpu.shader_source import FULLSCREEN_VERTEX
from glcaustics.gpu.texture import FORMATS
from glcaustics.graph import FORMAT_BYTES

Load = Callable[..., Program]


@pytest.fixture
def load(device: Device, tmp_path: Path) -> Iterator[Load]:
    """load(frag, vert=None, defines=None, **other_files): a program from text, through the device's own loader."""
    made: list[Program] = []
    (tmp_path / "interface").mkdir()
    (tmp_path / FULLSCREEN_VERTEX).write_text((glsl_root() / FULLSCREEN_VERTEX).read_text())

    def program(
        frag: str, vert: str | None = None, defines: dict[str, object] | None = None, varyings: tuple[str, ...] = ()
    ) -> Program:
        (tmp_path / "x.frag").write_text(frag)
        if vert is not None:
            (tmp_path / "x.vert").write_text(vert)
        made.append(Program(device.ctx, ShaderLoader(tmp_path).load("x", defines), "x", varyings))
        return made[-1]

    yield program
    for each in made:
        each.release()


@pytest.fixture
def canvas(device: Device) -> Iterator[moderngl.Framebuffer]:
    texture = device.texture((4, 4), "rgba32f", label="canvas")
    framebuffer = device.framebuffer([texture], label="canvas")
    framebuffer.clear()
    yield framebuffer
    framebuffer.release()
    texture.release()


def pixel(device: Device, canvas: moderngl.Framebuffer, x: int = 0, y: int = 0) -> list[float]:
    return device.read(canvas.color_attachments[0])[y, x].tolist()


def draw(device: Device, canvas: moderngl.Framebuffer, program: Program) -> list[float]:
    device.draw_fullscreen(program, canvas)
    return pixel(device, canvas)


# -- textures -------------------------------------------------------------------


@pytest.mark.smoke
@pytest.mark.parametrize("format", sorted(FORMATS))
def test_every_format_keeps_its_data(device: Device, format: str) -> None:
    kind = FORMATS[format]
    shape = (3, 5, kind.components)
    values = np.random.default_rng(1).random(shape).astype(np.float32)
    data = (values * 255).astype(np.uint8) if kind.dtype == "f1" else values
    texture = device.texture((5, 3), format, data=data, label=format)
    found = device.read(texture).reshape(shape)
    tolerance = {"f1": 0.0, "f2": 1e-3, "f4": 1e-7}[kind.dtype] if format != "depth24" else 1e-6
    assert np.abs(found.astype(float) - data.astype(float)).max() <= tolerance
    texture.release()


def test_graph_and_device_agree_on_formats() -> None:
    assert {name: kind.bytes_per_texel for name, kind in FORMATS.items()} == FORMAT_BYTES


def test_a_texture_larger_than_the_driver_allows_is_refused_by_name(device: Device) -> None:
    limit = device.info["max_texture_size"]
    with pytest.raises(
        ResourceLimitError, match=rf"texture 'caustic map': {limit + 1} x 4 .* 1 to {limit} a side; ask"
    ):
        device.texture((limit + 1, 4), "rgba8", label="caustic map")
    with pytest.raises(ResourceLimitError, match="0 x 4"):
        device.texture((0, 4), "rgba8", label="caustic map")


def test_a_texture_that_memory_has_no_room_for_is_refused(device: Device) -> None:
    if not device.is_software:
        pytest.skip("a GPU may have the memory, or pretend to")
    limit = device.info["max_texture_size"]
    with pytest.raises(ResourceLimitError, match="the driver refused .* MB .GL_OUT_OF_MEMORY."):
        device.texture((limit, limit), "rgba32f", label="huge")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(format="rgb9"), "format 'rgb9' is unknown"),
        (dict(format="rgba8", filter="cubic"), "filter 'cubic' is unknown"),
        (dict(format="rgba8", compare=True), "depth compare asked of the colour format"),
        (dict(format="r32f", data=np.zeros((4, 3), np.float32)), "48 bytes of data for 4 x 4"),
        (dict(format="rgba8", data=np.zeros((4, 4, 4))), "data is float64"),
        (dict(format="r32f", data=np.zeros((4, 4), np.uint8)), "data is uint8"),
    ],
)
def test_texture_requests_that_make_no_sense_are_refused(device: Device, arguments: dict, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        device.texture((4, 4), label="t", **arguments)


def test_framebuffers_are_checked(device: Device) -> None:
    small, large = device.texture((2, 2), "rgba8", label="small"), device.texture((4, 4), "rgba8", label="large")
    with pytest.raises(DeviceError, match="'mixed': attachments differ in size: small 2 x 2, large 4 x 4"):
        device.framebuffer([small, large], label="mixed")
    with pytest.raises(DeviceError, match="no attachment"):
        device.framebuffer([], label="none")
    with pytest.raises(ResourceLimitError, match="allowed are"):
        device.framebuffer([small] * (device.info["max_draw_buffers"] + 1), label="many")
    small.release()
    large.release()


def test_labels_reach_the_driver(device: Device) -> None:
    texture = device.texture((2, 2), "rgba8", label="gbuffer.albedo")
    assert texture.extra.label == "gbuffer.albedo"
    if device.info["features"]["debug"]:
        assert texture.label == "gbuffer.albedo"
    texture.release()


def test_empty_buffers_are_refused(device: Device) -> None:
    with pytest.raises(UsageError, match="'mesh' has no data"):
        device.buffer(np.zeros(0, np.float32), label="mesh")
    with pytest.raises(UsageError, match="neither data nor a size"):
        device.buffer(label="mesh")


# -- programs -------------------------------------------------------------------


@pytest.mark.smoke
def test_a_compile_error_names_the_shaders_own_file_and_line(load: Load, tmp_path: Path) -> None:
    (tmp_path / "part.glsl").write_text("float fine() { return 1.0; }\n\nfloat broken() { return nowhere; }\n")
    with pytest.raises(ShaderError, match=r"^part\.glsl:3: .*nowhere"):
        load('\n#include "part.glsl"\nout vec4 color;\nvoid main() { color = vec4(broken()); }\n')
    with pytest.raises(ShaderError, match=r"^x\.frag:6: .*vec3"):
        load('#include "interface/none.glsl"\n'.replace("#include", "//") + "\n\nout vec4 color;\nvoid main() {\n"
             "    color = vec3(1.0);\n}\n")  # fmt: skip


def test_a_link_error_names_the_program(load: Load) -> None:
    with pytest.raises(ShaderError, match="x does not link: .*v_uv"):
        load("in vec3 v_uv;\nout vec4 color;\nvoid main() { color = vec4(v_uv, 1.0); }\n")


def test_programs_are_cached_by_path_and_defines(tmp_path: Path) -> None:
    from glcaustics.gpu import create_device

    (tmp_path / "interface").mkdir()
    (tmp_path / FULLSCREEN_VERTEX).write_text((glsl_root() / FULLSCREEN_VERTEX).read_text())
    (tmp_path / "x.frag").write_text("out vec4 color;\nvoid main() { color = vec4(MODE + OTHER); }\n")
    with create_device(os.environ.get("GLC_TEST_BACKEND", "egl"), shader_root=tmp_path) as own:
        first = own.program("x", {"MODE": 1, "OTHER": 2})
        assert own.program("x", {"OTHER": 2, "MODE": True}) is first
        assert own.program("x", {"MODE": 2, "OTHER": 2}) is not first


UNIFORMS = """
uniform mat4 u_matrix; uniform mat2x3 u_wide; uniform vec3 u_list[3]; uniform float u_scale; uniform ivec2 u_pair;
uniform bool u_on; uniform float u_dead; uniform uint u_bits;
struct Light { vec3 color; float power; };
uniform Light u_lights[2];
out vec4 color;
void main() {
    color = u_matrix * vec4(u_list[1], 1.0) * u_scale + vec4(u_wide * vec2(1.0, 10.0), 0.0);
    color += vec4(u_lights[1].color * u_lights[1].power, 0.0) + float(u_pair.y) + (u_on ? 100.0 : 0.0) + float(u_bits);
}
"""


@pytest.mark.smoke
def test_uniforms_arrive_as_written_in_column_vector_form(device: Device, load: Load, canvas) -> None:
    program = load(UNIFORMS)
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0  # a translation, as in M @ p
    wide = np.array([[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]])  # 3 rows, 2 columns: GLSL mat2x3
    program.set(u_matrix=matrix, u_wide=wide, u_list=np.array([[9, 9, 9], [5, 6, 7], [9, 9, 9]]), u_scale=2)
    program.set(u_pair=(7, 1000), u_on=True, u_dead=1.0, u_bits=0, **{"u_lights[1].color": (1, 0, 0)})
    program.set(**{"u_lights[1].power": 0.5, "u_lights[0].power": 3.0})
    expected = 2 * (matrix @ [5, 6, 7, 1]) + np.append(wide @ [1, 10], 0) + [0.5, 0, 0, 0] + 1100
    assert np.allclose(draw(device, canvas, program), expected)


def test_setting_again_changes_and_setting_the_same_costs_no_upload(device: Device, load: Load, canvas) -> None:
    program = load("uniform float u_a;\nout vec4 color;\nvoid main() { color = vec4(u_a); }\n")
    assert draw(device, canvas, program.set(u_a=3.0)) == [3.0] * 4
    assert draw(device, canvas, program.set(u_a=4)) == [4.0] * 4
    program.gl["u_a"].value = 8.0  # behind the program's back
    assert draw(device, canvas, program.set(u_a=4.0)) == [8.0] * 4


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"u_scael": 1.0}, "no stage declares a uniform 'u_scael'; nearest: u_scale"),
        ({"u_lights[0].colour": (1, 1, 1)}, "no stage declares"),
        ({"u_matrix": np.eye(3)}, r"'u_matrix' is mat4 but the value has shape \(3, 3\)"),
        ({"u_wide": np.zeros((2, 3))}, "'u_wide' is mat2x3"),
        ({"u_list": np.zeros((4, 3))}, r"'u_list' is vec3\[3\] but the value has shape \(4, 3\)"),
        ({"u_list": np.zeros(3)}, r"'u_list' is vec3\[3\]"),
        ({"u_scale": (1.0, 2.0)}, "'u_scale' is float"),
        ({"u_scale": "1"}, "'u_scale' is float but the value is '1'"),
        ({"u_scale": None}, "'u_scale' is float but the value is None"),
        ({"u_pair": (0.5, 1.0)}, "'u_pair' is ivec2"),
    ],
)
def test_values_that_do_not_fit_are_refused(load: Load, values: dict, message: str) -> None:
    with pytest.raises(ShaderError, match=message):
        load(UNIFORMS).set(**values)


def test_a_shorter_array_leaves_zeros(device: Device, load: Load, canvas) -> None:
    program = load(
        "uniform float u_a[3];\nuniform int u_i;\nout vec4 color;\nvoid main() { color = vec4(u_a[u_i]); }\n"
    )
    program.set(u_a=np.array([1.0, 2.0, 3.0]), u_i=2)
    assert draw(device, canvas, program) == [3.0] * 4
    assert draw(device, canvas, program.set(u_a=np.array([1.0, 2.0]))) == [0.0] * 4


def test_set_all_passes_over_what_the_shader_does_not_declare(load: Load) -> None:
    program = load("uniform float u_a;\nout vec4 color;\nvoid main() { color = vec4(u_a); }\n")
    program.set_all({"u_a": 1.0, "u_other": 2.0})
    assert program.declares("u_a") and not program.declares("u_other")


SAMPLE = (
    "uniform sampler2D t_a; uniform sampler2D t_b; in vec2 v_uv;\nout vec4 color;\nvoid main() { color = ORDER; }\n"
)


@pytest.mark.smoke
def test_textures_follow_their_program_when_two_alternate(device: Device, load: Load, canvas) -> None:
    one, two = (device.texture((1, 1), "r32f", data=np.array([[v]]), label=str(v)) for v in (1.0, 2.0))
    first = load(SAMPLE, defines={"ORDER": "texture(t_a, v_uv) - texture(t_b, v_uv) * 10.0"})
    second = load(SAMPLE, defines={"ORDER": "texture(t_b, v_uv) * 10.0 - texture(t_a, v_uv)"})
    first.set(t_a=one, t_b=two)
    second.set(t_b=one, t_a=two)
    for _ in range(2):
        assert draw(device, canvas, first)[0] == 1.0 - 20.0
        assert draw(device, canvas, second)[0] == 10.0 - 2.0
    one.release()
    two.release()


def test_samplers_are_checked(device: Device, load: Load, canvas) -> None:
    program = load(
        "uniform sampler2D t_a;\nin vec2 v_uv;\nout vec4 color;\nvoid main() { color = texture(t_a, v_uv); }\n"
    )
    with pytest.raises(ShaderError, match="sampler 't_a' has no texture; call"):
        device.draw_fullscreen(program, canvas)
    with pytest.raises(ShaderError, match="feeds|reads the texture that framebuffer 'canvas' writes"):
        device.draw_fullscreen(program.set(t_a=canvas.color_attachments[0]), canvas)
    with pytest.raises(ShaderError, match="wants 1 texture"):
        program.set(t_a=3)
    shadow = device.texture((2, 2), "depth24", compare=True, label="shadow")
    with pytest.raises(ShaderError, match="'t_a' is sampler2D but texture 'shadow' has depth compare on"):
        program.set(t_a=shadow)
    shadow.release()
    gone = device.texture((2, 2), "r8", label="gone")
    program.set(t_a=gone)
    gone.release()
    with pytest.raises(ShaderError, match="the texture of sampler 't_a' was released"):
        device.draw_fullscreen(program, canvas)


def test_sampler_arrays_take_consecutive_units(device: Device, load: Load, canvas) -> None:
    textures = [device.texture((1, 1), "r32f", data=np.array([[v]])) for v in (3.0, 50.0)]
    program = load(
        "uniform sampler2D t_many[2]; uniform sampler2D t_more;\nin vec2 v_uv;\nout vec4 color;\n"
        "void main() { color = texture(t_many[0], v_uv) + texture(t_many[1], v_uv) + texture(t_more, v_uv); }\n"
    )
    assert draw(device, canvas, program.set(t_many=textures, t_more=textures[1]))[0] == 103.0
    for texture in textures:
        texture.release()


# -- drawing --------------------------------------------------------------------

CONSTANT = "out vec4 color;\nvoid main() { color = vec4(0.75); }\n"


def test_fullscreen_uv_runs_from_the_lower_left(device: Device, load: Load, canvas) -> None:
    program = load("in vec2 v_uv;\nout vec4 color;\nvoid main() { color = vec4(v_uv, 0.0, 1.0); }\n")
    device.draw_fullscreen(program, canvas)
    assert np.allclose(pixel(device, canvas, 0, 0), [0.125, 0.125, 0, 1])
    assert np.allclose(pixel(device, canvas, 3, 0), [0.875, 0.125, 0, 1])


@pytest.mark.smoke
def test_additive_blending_into_float_does_not_stop_counting(device: Device, load: Load, canvas) -> None:
    program = load("out vec4 color;\nvoid main() { color = vec4(1.0, 4096.25, 0.0, 0.0); }\n")
    for _ in range(5):
        device.draw_fullscreen(program, canvas, blend="add")
    assert pixel(device, canvas)[:2] == [5.0, 5 * 4096.25]
    device.draw_fullscreen(program, canvas)  # no blending carries over
    assert pixel(device, canvas)[:2] == [1.0, 4096.25]


def test_a_viewport_confines_one_draw_only(device: Device, load: Load, canvas) -> None:
    device.draw_fullscreen(load(CONSTANT), canvas, viewport=(2, 2, 2, 2))
    assert pixel(device, canvas, 1, 1) == [0.0] * 4
    assert pixel(device, canvas, 2, 2) == [0.75] * 4
    device.draw_fullscreen(load(CONSTANT), canvas)
    assert pixel(device, canvas, 0, 0) == [0.75] * 4


def test_points_need_no_buffer_and_take_their_size_from_the_shader(device: Device, load: Load, canvas) -> None:
    vert = (
        "void main() { gl_PointSize = 2.0; gl_Position = vec4(gl_VertexID == 0 ? vec2(-0.5) : vec2(0.5), 0.0, 1.0); }\n"
    )
    device.draw_points(load(CONSTANT, vert), canvas, 2, blend="add")
    image = device.read(canvas.color_attachments[0])[..., 0]
    assert image.tolist() == [[0.75] * 2 + [0.0] * 2] * 2 + [[0.0] * 2 + [0.75] * 2] * 2


def test_depth_test_culling_and_vertex_inputs(device: Device, load: Load) -> None:
    color = device.texture((4, 4), "rgba32f", label="color")
    depth = device.texture((4, 4), "depth24", label="depth")
    target = device.framebuffer([color], depth, label="target")
    target.clear(depth=1.0)
    vert = (
        "in vec2 in_xy; in float in_unused; uniform float u_z;\nvoid main() { gl_Position = vec4(in_xy, u_z, 1.0); }\n"
    )
    program = load("uniform float u_c;\nout vec4 color;\nvoid main() { color = vec4(u_c); }\n", vert)
    ccw = device.buffer(np.array([-1, -1, 0, 3, -1, 0, -1, 3, 0], np.float32), label="triangle")
    index = device.buffer(np.array([0, 1, 2], np.uint32), label="index")
    array = device.vertex_array(program, [(ccw, "2f 1f", "in_xy", "in_unused")], index)
    with pytest.raises(ShaderError, match="no vertex input 'in_normal'.*declared are: in_unused, in_xy"):
        device.vertex_array(program, [(ccw, "2f 1f", "in_xy", "in_normal")])

    def at(z: float, value: float, **state) -> float:
        device.draw(array, program.set(u_z=z, u_c=value), target, depth_func="<", **state)
        return float(device.read(color)[0, 0, 0])

    assert at(0.5, 1.0) == 1.0
    assert at(0.8, 2.0) == 1.0  # behind
    assert at(0.2, 3.0, depth_write=False) == 3.0
    assert at(0.4, 4.0) == 4.0  # in front of 0.5, as 0.2 was not written
    assert at(0.1, 5.0, cull="front") == 4.0
    assert at(0.1, 6.0, cull="back") == 6.0
    target.clear(depth=1.0)  # depth is cleared although the draws before had it write-protected
    assert at(0.9, 7.0) == 7.0
    with pytest.raises(UsageError, match="mode 'quads' is unknown"):
        device.draw(array, program, target, mode="quads")
    with pytest.raises(UsageError, match="blend 'over' is unknown"):
        device.draw(array, program, target, blend="over")
    for thing in (array, ccw, index, target, color, depth):
        thing.release()


def test_a_shadow_map_needs_no_colour(device: Device, load: Load) -> None:
    depth = device.texture((4, 4), "depth32f", label="shadow", compare=True)
    target = device.framebuffer(depth=depth, label="shadow")
    target.clear(depth=1.0)
    vert = "void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, -0.5, 1.0); }\n"
    program = load("void main() {}\n", vert)
    array = device.ctx.vertex_array(program.gl, [])
    device.draw(array, program, target, vertices=3, depth_func="<", viewport=(0, 0, 2, 4))
    assert device.read(depth).tolist() == [[0.25, 0.25, 1.0, 1.0]] * 4
    for thing in (array, target, depth):
        thing.release()


def test_framebuffers_can_be_made_after_the_bound_one_was_released(device: Device) -> None:
    for _ in range(2):
        texture = device.texture((2, 2), "rgba8", label="short-lived")
        framebuffer = device.framebuffer([texture], label="short-lived")
        framebuffer.use()
        framebuffer.release()
        texture.release()


# -- timers ---------------------------------------------------------------------


def test_timers_nest_and_cost_nothing_while_off(device: Device, load: Load, canvas) -> None:
    program = load(CONSTANT)
    with device.timer("off"):
        device.draw_fullscreen(program, canvas)
    assert "off" not in device.timings
    device.timing_enabled = True
    try:
        with device.timer("outer"), device.timer("inner"):
            device.draw_fullscreen(program, canvas)
        timings = device.finish_timings()
    finally:
        device.timing_enabled = False
    assert 0.0 <= timings["inner"] <= timings["outer"] < 10_000.0
    assert device.timer_kind == ("wall clock" if device.is_software else "GPU query")


def test_timestamp_queries_measure_on_this_driver_too(device: Device, load: Load, canvas) -> None:
    """The way a real GPU is timed, run here: llvmpipe's numbers mean little, but they arrive, without error."""
    from glcaustics.gpu.timer import Timers

    timers = Timers(device.ctx, device.raw, is_software=False)
    timers.enabled = True
    for _ in range(3):
        with timers.measure("outer"), timers.measure("inner"):
            device.draw_fullscreen(load(CONSTANT), canvas)
    found = timers.collect(wait=True)
    assert 0.0 <= found["inner"] <= found["outer"]
    timers.release()
