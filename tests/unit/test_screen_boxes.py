"""Where boxes lie in the picture."""

from __future__ import annotations

import numpy as np

from glcaustics.passes.camera import CameraState
from glcaustics.passes.geometry import screen_boxes_px
from glcaustics.scene.model import Camera


def test_boxes_before_beside_and_behind_the_eye() -> None:
    camera = Camera.look_at((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), yfov_rad=np.pi / 2)
    bounds = np.array([[-9.0] * 3, [9.0] * 3])
    state = CameraState.make(camera, (200, 100), bounds)
    boxes = np.array(
        [
            [[-1.0, -0.5, -5.0], [1.0, 0.5, -2.0]],  # nearest face at 2 m: half of 1 m and 0.5 m over 2 m
            [[30.0, 0.0, -5.0], [31.0, 1.0, -4.0]],  # beside the picture
            [[-1.0, -1.0, 3.0], [1.0, 1.0, 4.0]],  # behind
            [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]],  # around the eye
        ]
    )
    found = screen_boxes_px(boxes, state.clip_from_world, (200, 100))
    np.testing.assert_allclose(found[0], [[75.0, 37.5], [125.0, 62.5]], rtol=1e-6)
    for hidden in found[1:3]:
        assert not (hidden[0] < hidden[1]).all()
    np.testing.assert_allclose(found[3], [[0.0, 0.0], [200.0, 100.0]])
