"""glTF meshes: accessors, triangulation, normals, winding, watertightness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glcaustics.scene.gltf import load_gltf
from glcaustics.scene.mesh_tools import face_normals, signed_volume
from glcaustics.scene.model import OpticalKind
from tests.unit.glb_builder import GLASS, METAL, WHITE, build_glb, builder, cube, plane, torus

STRIP = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]], float)


def only_mesh(path: Path):
    (instance,) = load_gltf(path).instances
    return instance.mesh


def torus_normals(positions: np.ndarray, major_m: float = 1.0) -> np.ndarray:
    """Exact outward normals of a torus round the y axis."""
    ring = positions * (1.0, 0.0, 1.0)
    ring *= major_m / np.linalg.norm(ring, axis=1, keepdims=True)
    outward = positions - ring
    return outward / np.linalg.norm(outward, axis=1, keepdims=True)


def test_glass_torus_over_a_floor_with_one_point_light_just_works(tmp_path: Path) -> None:
    glass = torus() | {"material": 0}
    glass["positions"] = glass["positions"] + (0.0, 1.0, 0.0)
    light = {"type": "point", "intensity": 500.0, "translation": [0.5, 5.0, 0.0]}
    path = build_glb(tmp_path / "t.glb", [glass, plane() | {"material": 1}], materials=[GLASS, WHITE], lights=[light])
    scene = load_gltf(path)
    ring, floor = scene.instances
    assert ring.optical_kind is OpticalKind.SOLID
    assert floor.optical_kind is OpticalKind.DIFFUSE
    assert [light.position_ws for light in scene.lights] == [(0.5, 5.0, 0.0)]
    exact = torus_normals(ring.mesh.positions_m.astype(float) - (0.0, 1.0, 0.0))
    assert np.min(np.sum(exact * ring.mesh.normals, axis=1)) > 0.999
    assert len(scene.announcements) == 2  # the camera and the sky


@pytest.mark.parametrize("form", ["glb", "external", "data_uri"])
def test_buffers_may_stand_in_the_file_beside_it_or_in_a_data_uri(tmp_path: Path, form: str) -> None:
    build = builder([torus()])
    path = tmp_path / ("a.glb" if form == "glb" else "a.gltf")
    build.write(path, external=form == "external", data_uri=form == "data_uri")
    assert only_mesh(path).watertight


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_index_types(tmp_path: Path, kind: type) -> None:
    mesh = torus(rings=12, sides=8)
    mesh["indices"] = mesh["indices"].astype(kind)
    assert only_mesh(build_glb(tmp_path / "a.glb", [mesh])).watertight


def test_unindexed_triangles(tmp_path: Path) -> None:
    mesh = torus()
    flat = {"positions": mesh["positions"][mesh["indices"].ravel()], "material": 0}
    instance = load_gltf(build_glb(tmp_path / "a.glb", [flat], materials=[GLASS])).instances[0]
    assert instance.optical_kind is OpticalKind.SOLID
    exact = torus_normals(instance.mesh.positions_m.astype(float))
    assert np.min(np.sum(exact * instance.mesh.normals, axis=1)) > 0.999  # welded although no vertex is shared


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 2, 3, 4, 5]), (6, [0, 1, 3, 5, 4, 2])])
def test_strips_and_fans_keep_their_winding(tmp_path: Path, mode: int, order: list[int]) -> None:
    for mesh in ({"positions": STRIP, "indices": order}, {"positions": STRIP[order]}):
        read = only_mesh(build_glb(tmp_path / "a.glb", [mesh | {"mode": mode}]))
        normals = face_normals(read.positions_m, read.triangles)
        assert np.allclose(normals, (0.0, 0.0, 1.0))
        corners = read.positions_m[read.triangles]
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert area.sum() == pytest.approx(2.0)


def test_normalised_integers_and_quantised_positions(tmp_path: Path) -> None:
    build = builder([])
    positions = build.add_accessor(np.array([[0, 0, 0], [32767, 0, 0], [0, -32767, -32768]], np.int16), normalized=True)
    normals = build.add_accessor(np.tile(np.array([0, 0, -127], np.int8), (3, 1)), normalized=True)
    uv = build.add_accessor(np.array([[0, 0], [255, 0], [0, 51]], np.uint8), normalized=True)
    part = build.primitive({"positions": positions, "normals": normals, "uv": uv})
    build.root["meshes"], build.root["nodes"] = [{"primitives": [part]}], [{"mesh": 0}]
    build.root["extensionsRequired"] = ["KHR_mesh_quantization"]
    mesh = only_mesh(build.write(tmp_path / "a.glb"))
    assert np.allclose(mesh.positions_m, [[0, 0, 0], [1, 0, 0], [0, -1, -1]], atol=1e-6)
    assert np.allclose(mesh.normals, (0, 0, -1))
    assert np.allclose(mesh.uv, [[0, 0], [1, 0], [0, 0.2]], atol=1e-6)
    plain = build.root["accessors"][positions]
    del plain["normalized"]
    assert np.allclose(only_mesh(build.write(tmp_path / "b.glb")).positions_m[1], (32767, 0, 0))


def test_interleaved_attributes(tmp_path: Path) -> None:
    build = builder([])
    mesh = torus(rings=12, sides=8)
    normals = torus_normals(mesh["positions"])
    rows = np.concatenate((mesh["positions"], normals), axis=1).astype("f4")
    view = build.add_view(rows.tobytes(), stride=24)
    for offset in (0, 12):
        entry = {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": len(rows), "type": "VEC3"}
        build.root["accessors"].append(entry)
    part = build.primitive({"positions": 0, "normals": 1, "indices": mesh["indices"]})
    build.root["meshes"], build.root["nodes"] = [{"primitives": [part]}], [{"mesh": 0}]
    read = only_mesh(build.write(tmp_path / "a.glb"))
    assert np.array_equal(read.positions_m, rows[:, :3])
    assert np.allclose(read.normals, normals, atol=1e-6)


def test_sparse_accessor_with_and_without_a_base(tmp_path: Path) -> None:
    for with_base in (True, False):
        build = builder([{"positions": np.full((3, 3), 7.0)}])
        accessor = build.root["accessors"][0]
        accessor["sparse"] = {
            "count": 2,
            "indices": {"bufferView": build.add_view(np.array([1, 2], np.uint16).tobytes()), "componentType": 5123},
            "values": {"bufferView": build.add_view(np.array([[8, 7, 7], [7, 8, 7]], "f4").tobytes())},
        }
        if not with_base:
            del accessor["bufferView"]
        read = only_mesh(build.write(tmp_path / "a.glb")).positions_m
        assert np.array_equal(read, [[7.0 * with_base] * 3, [8, 7, 7], [7, 8, 7]])


def test_several_primitives_become_several_instances(tmp_path: Path) -> None:
    parts = [plane() | {"material": 0}, torus() | {"material": 1}]
    path = build_glb(tmp_path / "a.glb", [{"name": "both", "primitives": parts}], materials=[WHITE, GLASS])
    instances = load_gltf(path).instances
    assert [i.name for i in instances] == ["both/0", "both/1"]
    assert [i.material.name for i in instances] == ["white", "glass"]
    assert [i.mesh.name for i in instances] == ["both/white", "both/glass"]


def test_primitives_that_share_a_vertex_buffer_keep_only_their_own_vertices(tmp_path: Path) -> None:
    build = builder([])
    mesh = torus()
    positions = build.add_accessor(mesh["positions"].astype("f4"))
    parts = [build.primitive({"positions": positions, "indices": half}) for half in np.split(mesh["indices"], 2)]
    build.root["meshes"], build.root["nodes"] = [{"primitives": parts}], [{"mesh": 0}]
    for instance in load_gltf(build.write(tmp_path / "a.glb")).instances:
        assert set(instance.mesh.triangles.ravel().tolist()) == set(range(len(instance.mesh.positions_m)))


def test_one_mesh_in_two_nodes_is_read_once(tmp_path: Path) -> None:
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]
    one, two = load_gltf(build_glb(tmp_path / "a.glb", [torus()], nodes=nodes)).instances
    assert one.mesh is two.mesh


def test_missing_normals_are_flat_on_diffuse_and_smooth_on_specular_surfaces(tmp_path: Path) -> None:
    flat = only_mesh(build_glb(tmp_path / "a.glb", [torus() | {"material": 0}], materials=[WHITE]))
    faces = face_normals(flat.positions_m, flat.triangles)
    assert np.allclose(flat.normals[flat.triangles], faces[:, None, :], atol=1e-5)
    for material in (GLASS, METAL):
        smooth = only_mesh(build_glb(tmp_path / "b.glb", [torus() | {"material": 0}], materials=[material]))
        assert np.min(np.sum(torus_normals(smooth.positions_m.astype(float)) * smooth.normals, axis=1)) > 0.999


def test_hard_edges_stay_sharp_on_glass(tmp_path: Path) -> None:
    mesh = only_mesh(build_glb(tmp_path / "a.glb", [cube() | {"material": 0}], materials=[GLASS]))
    assert mesh.watertight
    assert len(mesh.positions_m) == 24
    assert np.allclose(mesh.normals[mesh.triangles], face_normals(mesh.positions_m, mesh.triangles)[:, None, :])


def test_normals_in_the_file_are_kept_but_made_unit(tmp_path: Path) -> None:
    tilted = plane() | {"normals": np.tile([0.0, 2.0, 1.0], (4, 1))}
    mesh = only_mesh(build_glb(tmp_path / "a.glb", [tilted]))
    assert np.allclose(mesh.normals, np.array([0.0, 2.0, 1.0]) / np.sqrt(5.0))


def test_zero_and_nan_normals_are_recomputed(tmp_path: Path) -> None:
    normals = np.array([[0, 1, 0], [0, 0, 0], [np.nan, 0, 0], [0, 1, 0]], float)
    scene = load_gltf(build_glb(tmp_path / "a.glb", [plane() | {"normals": normals}]))
    assert np.allclose(scene.instances[0].mesh.normals, (0, 1, 0))
    assert "mesh 'floor': 2 normals of zero length recomputed" in scene.announcements


@pytest.mark.parametrize("size_m", [1e-6, 1.0, 1e6])
def test_degenerate_triangles_are_removed_at_any_scale(tmp_path: Path, size_m: float) -> None:
    mesh = torus()
    extra = [[0, 0, 1], [3, 5, 3]]
    mesh = mesh | {"positions": mesh["positions"] * size_m, "indices": np.concatenate((mesh["indices"], extra))}
    scene = load_gltf(build_glb(tmp_path / "a.glb", [mesh | {"material": 0}], materials=[GLASS]))
    (instance,) = scene.instances
    assert len(instance.mesh.triangles) == len(torus()["indices"])
    assert instance.optical_kind is OpticalKind.SOLID
    assert "mesh 'torus': 2 degenerate triangles removed" in scene.announcements


def test_watertight_open_and_seamed(tmp_path: Path) -> None:
    for seam in (True, False):
        assert only_mesh(build_glb(tmp_path / "a.glb", [torus(seam=seam)])).watertight
    for missing, edges, kind, words in (
        (1, 3, OpticalKind.SOLID, "solid, being all but closed"),
        (192, 32, OpticalKind.INTERFACE, "single interface"),
    ):
        holed = torus()
        holed["indices"] = holed["indices"][missing:]
        scene = load_gltf(build_glb(tmp_path / "b.glb", [holed | {"material": 0}], materials=[GLASS]))
        assert scene.instances[0].optical_kind is kind
        expected = f"mesh 'torus' transmits but is not watertight (has {edges} open edges); it is treated as a {words}"
        assert expected in scene.announcements


def test_an_open_sheet_is_announced_only_if_it_has_a_volume(tmp_path: Path) -> None:
    volume = GLASS | {"extensions": GLASS["extensions"] | {"KHR_materials_volume": {"thicknessFactor": 0.1}}}
    for material, announced in ((GLASS, False), (volume, True)):
        scene = load_gltf(build_glb(tmp_path / "a.glb", [plane() | {"material": 0}], materials=[material]))
        assert scene.instances[0].optical_kind is OpticalKind.INTERFACE
        assert any("treated as a single interface" in line for line in scene.announcements) is announced


def test_an_inside_out_solid_is_turned_round(tmp_path: Path) -> None:
    mesh = torus()
    mesh["indices"] = mesh["indices"][:, ::-1]
    for normals in (None, torus_normals(mesh["positions"]), -torus_normals(mesh["positions"])):
        scene = load_gltf(
            build_glb(tmp_path / "a.glb", [mesh | {"material": 0, "normals": normals}], materials=[GLASS])
        )
        read = scene.instances[0].mesh
        assert signed_volume(read.positions_m, read.triangles) > 0.0
        assert np.min(np.sum(torus_normals(read.positions_m.astype(float)) * read.normals, axis=1)) > 0.999
        assert "mesh 'torus' is inside out; its triangles are turned round" in scene.announcements


def test_a_room_seen_from_inside_is_left_alone(tmp_path: Path) -> None:
    room = cube()
    room["indices"] = np.array(room["indices"])[:, ::-1]
    mesh = only_mesh(build_glb(tmp_path / "a.glb", [room | {"material": 0}], materials=[WHITE]))
    assert signed_volume(mesh.positions_m, mesh.triangles) < 0.0


def test_a_sheet_follows_its_normals(tmp_path: Path) -> None:
    sheet = plane()
    sheet["indices"] = np.array(sheet["indices"])[:, ::-1]
    mesh = only_mesh(build_glb(tmp_path / "a.glb", [sheet]))
    assert np.allclose(face_normals(mesh.positions_m, mesh.triangles), (0, 1, 0))


@pytest.mark.parametrize("with_normals", [True, False])
def test_mirrored_nodes_keep_their_outside_outside(tmp_path: Path, with_normals: bool) -> None:
    mesh = torus() | {"material": 0}
    mesh["positions"] = mesh["positions"] + (2.0, 0.0, 0.0)
    if with_normals:
        mesh["normals"] = torus_normals(mesh["positions"] - (2.0, 0.0, 0.0))
    nodes = [{"mesh": 0}, {"mesh": 0, "scale": [-1.0, 1.0, 1.0]}, {"mesh": 0, "scale": [-2.0, -2.0, -2.0]}]
    scene = load_gltf(build_glb(tmp_path / "a.glb", [mesh], materials=[GLASS], nodes=nodes))
    for instance, center_x, size in zip(scene.instances, (2.0, -2.0, -4.0), (1.0, 1.0, 2.0), strict=True):
        assert instance.optical_kind is OpticalKind.SOLID
        points = instance.positions_ws()
        assert np.allclose(0.5 * (points.min(0) + points.max(0)), (center_x, 0, 0), atol=1e-5)
        assert signed_volume(points, instance.mesh.triangles) > 0.0
        to_world = np.linalg.inv(instance.world_from_object[:3, :3]).T
        normals = instance.mesh.normals @ to_world.T
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        exact = torus_normals(points - (center_x, 0, 0), size)
        assert np.min(np.sum(exact * normals, axis=1)) > 0.999


def test_points_and_lines_are_left_out(tmp_path: Path) -> None:
    lines = {"positions": STRIP, "mode": 1}
    scene = load_gltf(build_glb(tmp_path / "a.glb", [torus(), {"name": "wire"} | lines]))
    assert len(scene.instances) == 1
    assert "mesh 'wire': points and lines are not drawn" in scene.announcements


def test_morph_targets_skins_colours_and_animations_are_announced(tmp_path: Path) -> None:
    build = builder([torus()])
    part = build.root["meshes"][0]["primitives"][0]
    part["targets"] = [{"POSITION": 0}]
    part["attributes"]["COLOR_0"] = 0
    build.root["nodes"][0]["skin"] = 0
    build.root["animations"] = [{}]
    text = "\n".join(load_gltf(build.write(tmp_path / "a.glb")).announcements)
    for word in ("morph targets", "skinning", "vertex colours", "animations"):
        assert word in text
