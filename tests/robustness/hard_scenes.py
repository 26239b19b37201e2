"""Scenes at the edge of what makes sense: each has to give finite numbers everywhere, or a one-line error."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from glcaustics.scene.model import Camera, Instance, Light, LightKind, Material, Mesh, Scene, Sky
from glcaustics.scene.transform import scaled
from tests.gpu.feature_scenes import (
    GLASS,
    MIRROR,
    WATER,
    WHITE,
    box,
    from_above,
    lamp,
    plane,
    scene_of,
    sheet,
    sun,
    translation,
)
from tests.gpu.physics_meshes import height_sheet, icosphere, make_mesh

EYE = Camera.look_at((1.5, 1.2, 2.0), (0.0, 0.0, 0.0), yfov_rad=math.radians(50.0))
SKY = Sky(zenith=(0.2, 0.3, 0.5), horizon=(0.4, 0.4, 0.4), ground=(0.1, 0.1, 0.1))


def waves() -> Instance:
    mesh = height_sheet("waves", 1.0, 24, 24, lambda x: 0.05 * np.cos(9.0 * x), lambda x: -0.45 * np.sin(9.0 * x))
    return Instance("waves", mesh, WATER)


def ball(material: Material = GLASS, at: tuple[float, float, float] = (0.2, 0.6, 0.1), radius: float = 0.3) -> Instance:
    return Instance("ball", icosphere("ball", radius, 8), material, translation(*at))


def ring() -> Instance:
    """A mirror: inside of a box's wall."""
    return box("mirror", (0.05, 0.5, 0.8), (-0.7, 0.3, 0.0), MIRROR)


def everything(*more: Instance, lights: tuple[Light, ...] = (), camera: Camera = EYE) -> Scene:
    """Waves, a ball of glass, a mirror and a floor."""
    return scene_of(
        [plane("floor", 2.0, -0.6), waves(), ball(), ring(), *more], list(lights or (sun(25.0),)), camera, sky=SKY
    )


def with_material(material: Material) -> Scene:
    solid, sheet_ = replace(GLASS, ior=material.ior), replace(WATER, ior=material.ior)
    return scene_of(
        [plane("floor", 2.0, -0.6), ball(solid), sheet("water", 1.0, 0.0, sheet_)],
        [sun(30.0), lamp((0.3, 1.5, 0.2))],
        EYE,
    )


def degenerate(material: Material) -> Instance:
    """Triangles without area: a point, a line, and two good ones."""
    points = [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1), (0.2, 0, 0.1)]
    triangles = [(0, 2, 1), (0, 3, 2), (4, 4, 4), (0, 1, 1), (0, 2, 0)]
    return Instance("slivers", make_mesh("slivers", points, [(0, 1, 0)] * 5, triangles, False), material)


def zero_extent() -> Scene:
    """A mesh whose vertices all coincide, on its own."""
    mesh = Mesh(
        "dot",
        np.zeros((3, 3), np.float32),
        np.tile(np.array([0, 1, 0], np.float32), (3, 1)),
        np.zeros((3, 2), np.float32),
        np.array([[0, 1, 2]], np.uint32),
        False,
    )
    return scene_of([Instance("dot", mesh, WATER), plane("floor", 1.0, -0.5)], [sun(10.0), lamp((0, 1, 0))], EYE)


def averted_normals() -> Scene:
    """Normals that point into the surface and along it."""
    good = waves()
    normals = good.mesh.normals.copy()
    normals[::2] *= -1.0
    normals[1::4] = (1.0, 0.0, 0.0)
    return scene_of(
        [plane("floor", 2.0, -0.6), replace(good, mesh=replace(good.mesh, normals=normals))], [sun(20.0)], EYE
    )


def looking(eye: tuple[float, float, float], target: tuple[float, float, float] = (0.0, -0.6, 0.0)) -> Camera:
    return Camera.look_at(eye, target, yfov_rad=math.radians(60.0))


def light_in_plane(kind: LightKind) -> Scene:
    if kind is LightKind.DIRECTIONAL:
        light = Light(kind, direction_ws=(1.0, 0.0, 0.0))
    else:
        light = Light(kind, position_ws=(0.0, 0.0, 0.0), direction_ws=(0.0, -1.0, 0.0), intensity=2.0)
    return scene_of([plane("floor", 2.0, -0.6), sheet("water", 1.0, 0.0)], [light], EYE)


def elongated() -> Scene:
    """A pool of 100 m x 0.05 m."""
    stretch = np.diag([50.0, 1.0, 0.025, 1.0])
    floor = replace(plane("floor", 1.2, -0.3), world_from_object=stretch)
    water = replace(waves(), world_from_object=stretch)
    return scene_of([floor, water], [sun(30.0), lamp((0.0, 1.0, 0.0))], looking((1.0, 1.0, 1.0)))


def ground(size_m: float) -> Scene:
    return scene_of(
        [plane("ground", size_m, -0.6), waves(), ball()],
        [sun(30.0), lamp((0.5, 2.0, 0.3), 3.0)],
        EYE,
        sky=SKY,
    )


def spot(outer_deg: float, at: tuple[float, float, float] = (0.2, 1.5, 0.1)) -> Light:
    return Light(
        LightKind.SPOT,
        intensity=5.0,
        position_ws=at,
        direction_ws=(0.0, -1.0, 0.0),
        inner_cone_rad=0.0,
        outer_cone_rad=math.radians(outer_deg),
    )


def turning_lights(count: int) -> tuple[Light, ...]:
    kinds = [sun(20.0 + i, 0.1) if i % 3 == 0 else lamp((math.cos(i), 1.5, math.sin(i)), 0.3) for i in range(count)]
    return tuple(spot(10.0 + i) if i % 5 == 4 else light for i, light in enumerate(kinds))


SCENES: dict[str, Callable[[], Scene]] = {
    "grazing sun": lambda: everything(lights=(sun(89.5),)),
    "sun from below": lambda: everything(lights=(sun(160.0),)),
    "sun in the plane of the water": lambda: light_in_plane(LightKind.DIRECTIONAL),
    "lamp in the plane of the water": lambda: light_in_plane(LightKind.POINT),
    "spot in the plane of the water": lambda: light_in_plane(LightKind.SPOT),
    "ior 1": lambda: with_material(replace(GLASS, ior=1.0)),
    "ior 1.0001": lambda: with_material(replace(GLASS, ior=1.0001)),
    "ior 2.4": lambda: with_material(replace(GLASS, ior=2.4)),
    "black absorber": lambda: with_material(
        replace(GLASS, attenuation_color=(0.0, 0.0, 0.0), attenuation_distance_m=1e-9)
    ),
    "triangles without area, water": lambda: scene_of([plane("floor", 2.0, -0.6), degenerate(WATER)], [sun(20.0)], EYE),
    "triangles without area, floor": lambda: scene_of([degenerate(WHITE), ball()], [sun(20.0), lamp((0, 2, 0))], EYE),
    "mesh without extent": zero_extent,
    "averted normals": averted_normals,
    "no receiver": lambda: scene_of([waves(), ball(), ring()], [sun(20.0), lamp((0.1, 2.0, 0.3))], EYE, sky=SKY),
    "only a mirror": lambda: scene_of([ring()], [sun(20.0)], EYE),
    "only water": lambda: scene_of([waves()], [sun(20.0)], EYE),
    "camera under water": lambda: everything(camera=looking((0.1, -0.3, 0.2), (0.5, 0.5, 0.0))),
    "camera in glass": lambda: everything(camera=looking((0.2, 0.6, 0.1))),
    "camera on a vertex": lambda: everything(camera=looking(tuple(float(v) for v in ball().positions_ws()[0]))),
    "camera in the plane of the water": lambda: scene_of(
        [plane("floor", 2.0, -0.6), sheet("water", 1.0, 0.0)], [sun(20.0)], looking((0.5, 0.0, 1.5), (0.0, 0.0, 0.0))
    ),
    "camera on the floor": lambda: everything(camera=looking((0.5, -0.6, 0.5), (0.0, -0.6, 0.0))),
    "camera looks away": lambda: everything(camera=looking((0.0, 5.0, 0.0), (0.0, 9.0, 0.0))),
    "ground 1e4 times the object": lambda: ground(1e4),
    "scene of 1e-4": lambda: scaled(everything(lights=(sun(20.0), lamp((0.3, 1.5, 0.4)))), 1e-4),
    "scene of 1e5": lambda: scaled(everything(lights=(sun(20.0), lamp((0.3, 1.5, 0.4)))), 1e5),
    "far from the origin": lambda: moved(everything(), (2000.0, -300.0, 1000.0)),
    "elongated pool": elongated,
    "no lights": lambda: scene_of([plane("floor", 2.0, -0.6), waves(), ball()], [], EYE, sky=SKY),
    "no lights and no sky": lambda: scene_of([plane("floor", 2.0, -0.6), waves()], [], EYE),
    "black lights": lambda: everything(lights=(sun(20.0, 0.0), replace(lamp((0, 2, 0)), color=(0.0, 0.0, 0.0)))),
    "20 lights": lambda: everything(lights=turning_lights(20)),
    "light in a solid": lambda: everything(lights=(lamp((0.2, 0.6, 0.1)),)),
    "light on a vertex": lambda: everything(lights=(lamp(tuple(float(v) for v in ball().positions_ws()[0])),)),
    "light on the floor": lambda: everything(lights=(lamp((0.0, -0.6, 0.0)),)),
    "light among the waves": lambda: everything(lights=(lamp((0.1, 0.01, 0.1)),)),
    "light under water": lambda: everything(lights=(lamp((0.1, -0.3, 0.1)),)),
    "light where the camera is": lambda: everything(lights=(lamp((1.5, 1.2, 2.0)),)),
    "light far away": lambda: everything(lights=(lamp((1e5, 2e5, 0.0), 1e10),)),
    "spot of half a degree": lambda: everything(lights=(spot(0.5),)),
    "spot of 90 degrees": lambda: everything(lights=(spot(90.0),)),
    "spot that misses": lambda: everything(lights=(spot(5.0, (50.0, 1.0, 0.0)),)),
    "spot from under the floor": lambda: everything(lights=(spot(40.0, (0.0, -5.0, 0.0)),)),
    "very bright light": lambda: everything(lights=(sun(20.0, 1e9),)),
    "very dim light": lambda: everything(lights=(sun(20.0, 1e-12),)),
    "emission alone": lambda: scene_of(
        [plane("floor", 2.0, -0.6, replace(WHITE, emissive=(3.0, 2.0, 1.0))), waves()], [], EYE
    ),
    "coinciding surfaces": lambda: everything(sheet("second water", 1.0, 0.0), plane("second floor", 2.0, -0.6)),
    "nested solids": lambda: everything(
        ball(replace(GLASS, ior=1.2), radius=0.2), ball(replace(GLASS, ior=1.8), radius=0.1)
    ),
    "floor above the water": lambda: everything(plane("roof", 2.0, 1.0, up=False), lights=(sun(20.0),)),
    "mirrored instance": lambda: everything(
        replace(ball(at=(0, 0, 0)), name="flipped", world_from_object=np.diag([-1.0, 2.0, 0.5, 1.0]))
    ),
    "orthographic along the floor": lambda: everything(
        camera=Camera.look_at((3.0, -0.6, 0.0), (0.0, -0.6, 0.0), orthographic=True, ymag_m=1.0)
    ),
    "narrow field of view": lambda: everything(camera=Camera.look_at((0, 50, 80), (0, 0, 0), yfov_rad=1e-3)),
    "wide field of view": lambda: everything(camera=Camera.look_at((0, 0.4, 0.9), (0, 0, 0), yfov_rad=3.1)),
    "strong dispersion": lambda: scene_of(
        [plane("floor", 2.0, -0.6), ball(replace(GLASS, dispersion=20.0))], [sun(20.0)], from_above(1.0, -0.6)
    ),
}


def moved(scene: Scene, by: tuple[float, float, float]) -> Scene:
    """The same scene elsewhere."""
    shift = translation(*by)
    instances = tuple(replace(i, world_from_object=shift @ i.world_from_object) for i in scene.instances)
    camera = replace(scene.camera, world_from_camera=shift @ scene.camera.world_from_camera)
    return replace(scene, instances=instances, camera=camera)
