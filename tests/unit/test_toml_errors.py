"""Ways to get a scene file wrong: each gives one line that names file, table, key, value and remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from glcaustics.errors import GlcError, SceneError
from glcaustics.scene import load_scene
from tests.unit.toml_file import MINIMAL, write

WATER = "[[water]]\nsize_m = [1, 1]\n"
MATERIAL = '[[material]]\nname = "m"\n'
SPOT = '[[light]]\nkind = "spot"\nintensity = 1\nposition = [0, 1, 0]\ndirection = [0, -1, 0]\n'
# (text put in place of which part, or appended; what the message must say)
BROKEN = [
    ("eye =", "eey =", r"\[camera\].*'eye' is missing.*'eey'"),
    ("[camera]", "[camera]\nfov = 3", r"\[camera\].*unknown key 'fov'.*yfov_deg"),
    ("[camera]", "[camera]\nyfov_deg = 180", r"'yfov_deg' is 180.*\(?\[?"),
    ("[camera]", "[camera]\nyfov_deg = 0", r"'yfov_deg' is 0.*greater than 0"),
    ("[camera]", '[camera]\nyfov_deg = "wide"', r"'yfov_deg' is 'wide'.*number"),
    ("[camera]", "[camera]\nyfov_deg = true", r"'yfov_deg' is True.*number"),
    ("[camera]", "[camera]\nymag_m = 1", r"unknown key 'ymag_m'"),
    ("[camera]", "[camera]\nup = [0, 0, 0]", r"'up' is zero"),
    ("target = [0, 0, 0]", "target = [0, 1, 3]", r"'eye' and 'target'"),
    ("target = [0, 0, 0]", "target = [0, 0]", r"'target' is \[0, 0\].*list of 3"),
    ("target = [0, 0, 0]", "target = [0, 0, nan]", r"'target' is nan.*finite"),
    ("target = [0, 0, 0]", "target = [0, 0, inf]", r"'target' is inf.*finite"),
    ("[camera]", "[camera]\n[[camera.key]]", r"\[camera.key\[0\]\].*'time_s' is missing"),
    ("[camera]", "[camara]", r"unknown table 'camara'.*'camera'"),
    ("[camera]", "[[camera]]", r"'camera' is .*write it as a table: \[camera\]"),
    ("[[light]]", "[light]", r"'light' is not an array of tables.*\[\[light\]\]"),
    ('"directional"', '"directionel"', r"\[light\[0\]\].*'kind' is 'directionel'.*'directional'"),
    ("intensity = 1000", "intensity = -1", r"'intensity' is -1.*\[0, "),
    ("intensity = 1000", "lux = 1000", r"'intensity' is missing"),
    ("direction = [0, -2, 0]", "direction = [0, 0, 0]", r"'direction' is zero"),
    ("direction = [0, -2, 0]", "direction = [0, -2, 0]\nposition = [1, 1, 1]", r"unknown key 'position'"),
    ('"box"', '"bx"', r"\[object\[0\]\].*'shape' is 'bx'.*'box'"),
    ("size_m = [1, 2, 3]", "size_m = [1, 2, 0]", r"'size_m' is 0.*greater than 0"),
    ("size_m = [1, 2, 3]", "radius_m = 1", r"'size_m' is missing"),
    ("size_m = [1, 2, 3]", "size_m = [1, 2, 3]\nradius_m = 1", r"unknown key 'radius_m'"),
    ("size_m = [1, 2, 3]", "size_m = [1, 2, 3]\nscale = 0", r"'scale' is 0"),
    ("size_m = [1, 2, 3]", "size_m = [1, 2, 3]\nscale = -1", r"'scale' is -1"),
    ("size_m = [1, 2, 3]", 'size_m = [1, 2, 3]\nmaterial = "gls"', r"'material' is 'gls'"),
    ("size_m = [1, 2, 3]", 'size_m = [1, 2, 3]\nfile = "x.ply"', r"either 'shape' or 'file'"),
    ('shape = "box"\nsize_m = [1, 2, 3]', 'name = "x"', r"either 'shape' or 'file'"),
    ('shape = "box"\nsize_m = [1, 2, 3]', 'file = "x.ply"', r"'file' is 'x.ply'.*no file"),
    ('shape = "box"\nsize_m = [1, 2, 3]', 'file = "test.toml"', r"kind '.toml'.*\.ply"),
    ('shape = "box"', 'shape = "sphere"\nradius_m = 1\nsegments = 2', r"'segments' is 2.*\[8, 4096\]"),
    ('shape = "box"', 'shape = "sphere"\nradius_m = 1\nsegments = 9.5', r"'segments' is 9.5.*whole"),
    ('shape = "box"', 'shape = "torus"\nradius_m = 1\ntube_radius_m = 2', r"'tube_radius_m' is 2.*smaller"),
    ('shape = "box"', 'shape = "ring"\ninner_radius_m = 2\nouter_radius_m = 1', r"'outer_radius_m' is 1.*greater"),
    ("", "exposure = 1", r"unknown key 'exposure'"),
    ("", "[scene]\nexposure = 0", r"\[scene\].*'exposure' is 0"),
    ("", '[scene]\nquality = "hgih"', r"'quality' is 'hgih'.*'high'"),
    ("", '[scene]\nname = ""', r"'name' is ''"),
    ("", '[scene]\ngltf = "none.glb"', r"'gltf' is 'none.glb'.*no file"),
    ("", "[sky]\nzenit = [1, 1, 1]", r"\[sky\].*'zenit'.*'zenith'"),
    ("", "[sky]\nzenith = [-1, 1, 1]", r"'zenith' is -1"),
    ("", SPOT + "radius_m = -1", r"\[light\[1\]\].*'radius_m' is -1.*\[0, "),
    ("", SPOT + "angular_diameter_deg = 0.5", r"unknown key 'angular_diameter_deg'"),
    ("[[light]]", "[[light]]\nradius_m = 0.1", r"\[light\[0\]\].*unknown key 'radius_m'"),
    ("[[light]]", "[[light]]\nangular_diameter_deg = 91", r"'angular_diameter_deg' is 91.*\[0, 90\]"),
    ("", SPOT + "outer_cone_deg = 91", r"\[light\[1\]\].*'outer_cone_deg' is 91"),
    ("", SPOT + "inner_cone_deg = 50", r"'inner_cone_deg' is 50.*smaller"),
    ("", "[[material]]", r"\[material\[0\]\].*'name' is missing"),
    ("", MATERIAL + MATERIAL, r"\[material\[1\]\].*'m' a second time"),
    ("", MATERIAL + "ior = 0.9", r"'ior' is 0.9.*\[1, 4\]"),
    ("", MATERIAL + "base_color = [0, 0, 2]", r"'base_color' is 2.*\[0, 1\]"),
    ("", MATERIAL + "double_sided = 1", r"'double_sided' is 1.*true or false"),
    ("", MATERIAL + 'base_color_image = "no.png"', r"'base_color_image' is 'no.png'.*no file"),
    ("", MATERIAL + 'base_color_image = "test.toml"', r"image cannot be read"),
    ("", MATERIAL + "attenuation_distance_m = 0", r"'attenuation_distance_m' is 0"),
    ("", "[[water]]", r"\[water\[0\]\].*'size_m' is missing"),
    ("", WATER + "resolution = [1, 5]", r"'resolution' is \[1, 5\].*\[2, 4096\]"),
    ("", WATER + "resolution = [4096, 4096]", r"water 'water0'.*16777216"),
    ("", WATER + 'heightmap = "x.png"\nwave = []', r"both 'heightmap' and 'wave'"),
    ("", WATER + "wave = [{ amplitude_m = 1 }]", r"\[water\[0\].wave\[0\]\].*either 'k' or 'wavelength_m'"),
    ("", WATER + "wave = [{ k = [1, 0] }]", r"either 'amplitude_m' or 'curvature_per_m'"),
    ("", WATER + "wave = [{ k = [0, 0], amplitude_m = 1 }]", r"'k' is zero"),
    ("", WATER + "wave = [{ k = [1, 0], amplitude_m = 2, steepness = 1 }]", r"\[water\[0\]\].*cross themselves"),
    ("", WATER + "wave = [{ k = [1, 0], amplitude_m = 1, phase = 1 }]", r"unknown key 'phase'.*'phase_rad'"),
    ("", WATER + "wave = [{ wavelength_m = 1, amplitude_m = 1 }]", r"'direction_deg' is missing"),
    ("", "[[watr]]\nsize_m = [1, 1]", r"unknown table 'watr'.*'water'"),
    ("", "x = [", r"is not TOML"),
]


@pytest.mark.parametrize(("old", "new", "message"), BROKEN, ids=[f"{i:02d}" for i in range(len(BROKEN))])
def test_what_is_wrong_is_named_on_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in MINIMAL
    top = new.startswith("exposure")
    text = MINIMAL.replace(old, new) if old else (f"{new}\n{MINIMAL}" if top else f"{MINIMAL}\n{new}\n")
    path = write(tmp_path, text)
    with pytest.raises(GlcError, match=message) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value) or "water 'water0'" in str(caught.value)


def test_what_cannot_be_loaded_at_all(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="unknown scene 'pol'; did you mean 'pool'"):
        load_scene("pol")
    with pytest.raises(SceneError, match=r"none\.toml: cannot be read"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(SceneError, match=r"none\.glb"):
        load_scene(tmp_path / "none.glb")
    (tmp_path / "a.txt").write_text("x")
    with pytest.raises(SceneError, match=r"kind '\.txt' are not scenes"):
        load_scene(tmp_path / "a.txt")
    with pytest.raises(SceneError, match="the scene has no objects"):
        load_scene(write(tmp_path, ""))
