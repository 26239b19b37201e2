"""Every built-in scene against its stored picture.

The pictures are replaced only by `./run test tests/golden --rewrite-goldens`: look at them before you commit them.
A failure leaves what was rendered, and the difference times 32, in tests/golden/failed/.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import glcaustics as glc
from tests.golden import picture_diff

FOLDER = Path(__file__).parent
FAILED = FOLDER / "failed"
SIZE = (256, 192)
TIME_S = 0.5  # waters that move have moved
SCENES = [name for name, _, _ in glc.builtin_scenes()]

pytestmark = [pytest.mark.gpu, pytest.mark.golden]


def render(name: str) -> picture_diff.Picture:
    backend = os.environ.get("GLC_TEST_BACKEND", "egl")
    scene = glc.load_scene(name)
    with glc.Renderer(scene, size=SIZE, quality="medium", backend=backend, aovs=(), seed=0) as renderer:
        frame = renderer.render(time=TIME_S)
    assert np.isfinite(frame.image).all()
    assert len(np.unique(frame.ldr)) > 16, "a picture of hardly any shades shows no scene"
    return frame.ldr


@pytest.mark.parametrize("name", SCENES)
def test_scene_looks_as_stored(name: str, request: pytest.FixtureRequest) -> None:
    actual, golden = render(name), FOLDER / f"{name}.png"
    if request.config.getoption("--rewrite-goldens"):
        Image.fromarray(actual).save(golden)
        return
    if not golden.is_file():
        kept = picture_diff.keep_failure(FAILED, name, actual, None)
        pytest.fail(f"no golden {golden.name}; rendered: {kept[0]}; store it with --rewrite-goldens")
    expected = picture_diff.load(golden)
    found = picture_diff.difference(actual, expected)
    if not found.within_tolerance:
        kept = picture_diff.keep_failure(FAILED, name, actual, expected)
        pytest.fail(f"{name}: {found}; see {', '.join(map(str, kept))}")


def test_every_golden_belongs_to_a_scene() -> None:
    assert {path.stem for path in FOLDER.glob("*.png")} <= set(SCENES)
