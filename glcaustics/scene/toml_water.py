"""The [[water]] tables of a scene file: waves or a height-map image on a rectangular grid."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from glcaustics.errors import SceneError
from glcaustics.scene.limits import check_image_size
from glcaustics.scene.model import Material, WaterBody
from glcaustics.scene.strict_table import StrictTable, nearest
from glcaustics.scene.toml_objects import existing_file
from glcaustics.scene.water import (
    MAX_GRID,
    HeightMapSurface,
    WaterSurface,
    Wave,
    WaveSurface,
    dispersion_omega,
    make_water,
)

WATER = Material(name="water", base_color=(1.0, 1.0, 1.0), roughness=0.0, transmission=1.0, ior=1.333)


def read_water(table: StrictTable, folder: Path, materials: Mapping[str, Material], default_name: str) -> WaterBody:
    """One [[water]] table. Without a material it is clear water of ior 1.333."""
    name = str(table.text("name", default_name))
    material = WATER
    if table.has("material"):
        chosen = table.text("material")
        if chosen not in materials:
            raise table.error(f"'material' is '{chosen}'", nearest(chosen, materials))
        material = materials[chosen]
    size = table.vector("size_m", 2, above=0.0)
    resolution = table.integers("resolution", 2, (128, 128), low=2, high=MAX_GRID)
    center = table.vector("center_m", 3, (0.0, 0.0, 0.0))
    if table.has("heightmap") and table.has("wave"):
        raise table.error("it has both 'heightmap' and 'wave'", "leave one of them out")
    surface = _height_map(table, folder, size) if table.has("heightmap") else _waves(table)
    table.finish()
    return make_water(name, material, surface, size_m=size, resolution=resolution, center_m=center)


def _waves(table: StrictTable) -> WaterSurface:
    """No wave at all is a flat surface."""
    scale = table.number("amplitude_scale", 1.0)
    moving = table.boolean("animated", True)
    depth = table.number("depth_m", math.inf, above=0.0, high=math.inf)
    waves = []
    for wave_table in table.tables("wave"):
        wave = _read_wave(wave_table, depth)
        omega = wave.omega if moving else 0.0
        waves.append(dataclasses.replace(wave, amplitude_m=scale * wave.amplitude_m, omega=omega))
    try:
        return WaveSurface(waves)
    except SceneError as cause:
        raise table.error(cause.what, cause.remedy) from None


def _one_of(table: StrictTable, first: str, second: str) -> str:
    if table.has(first) == table.has(second):
        raise table.error(f"it needs either '{first}' or '{second}'", "give exactly one of the two")
    return first if table.has(first) else second


def _read_wave(table: StrictTable, depth_m: float) -> Wave:
    if _one_of(table, "k", "wavelength_m") == "k":
        kx, kz = table.vector("k", 2)
        if kx == 0.0 and kz == 0.0:
            raise table.error("'k' is zero", "give the wave vector [kx, kz] in rad/m")
    else:
        k = 2.0 * math.pi / table.number("wavelength_m", above=0.0)
        angle = math.radians(table.number("direction_deg"))
        kx, kz = k * math.cos(angle), k * math.sin(angle)
    k = math.hypot(kx, kz)
    if _one_of(table, "amplitude_m", "curvature_per_m") == "amplitude_m":
        amplitude = table.number("amplitude_m")
    else:
        amplitude = table.number("curvature_per_m") / (k * k)  # the curvature at the crest is a k^2
    phase = table.number("phase_rad", 0.0)
    omega = table.number("omega_rad_per_s", dispersion_omega(k, depth_m))
    steepness = table.number("steepness", 0.0, low=0.0, high=1.0)
    table.finish()
    return Wave(amplitude, kx, kz, phase, omega, steepness)


def _height_map(table: StrictTable, folder: Path, size_m: tuple[float, float]) -> WaterSurface:
    path = existing_file(table, "heightmap", folder)
    scale = table.number("height_scale_m")
    level = table.number("mean_level", 0.5, low=0.0, high=1.0)
    return HeightMapSurface((read_heights(path) - level) * scale, size_m)


def read_heights(path: Path) -> npt.NDArray[np.float64]:
    """A grey image as (rows, columns) float64 in [0, 1]; 8 and 16 bits, colours by their luma; row 0 lies at -z.

    Raises:
        SceneError: if Pillow cannot read the file.
    """
    try:
        with PillowImage.open(path) as picture:
            check_image_size(path.name, *picture.size, where=str(path))
            if picture.mode in ("I;16", "I;16B", "I;16L", "I"):
                return np.asarray(picture, dtype=np.float64) / 65535.0
            if picture.mode == "F":
                return np.asarray(picture, dtype=np.float64)
            return np.asarray(picture.convert("L"), dtype=np.float64) / 255.0
    except (OSError, ValueError, PillowImage.DecompressionBombError) as cause:
        raise SceneError(f"height map cannot be read ({cause})", where=str(path), remedy="use a PNG") from cause
