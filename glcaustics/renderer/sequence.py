"""From frame to frame: the geometry moves, the camera looks, and what histories were seen by is remembered."""

from __future__ import annotations

import numpy as np

from glcaustics.gpu import Device
from glcaustics.passes.camera import CameraState
from glcaustics.passes.eye_medium import EyeMediumFinder
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import GpuScene
from glcaustics.scene.model import FloatArray, LightKind, OpticalKind, Scene

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear sRGB (Rec. 709)


class FrameSequence:
    """Makes the `FrameState` of each frame. A picture shifted by a part of a pixel is no frame of its own, unless TAA
    is on: motion is counted from frame to frame.
    """

    def __init__(self, device: Device, setup: FrameSetup) -> None:
        self.gpu = GpuScene(device)
        self.drawn: CameraState | None = None
        self.pictures = 0
        self._setup = setup
        self._eye = EyeMediumFinder()
        self._time_s: float | None = None
        self._previous: tuple[CameraState, dict[str, FloatArray]] | None = None

    @property
    def eye_medium(self) -> str | None:
        """Words for what the eye was in when the last state was made; None: air."""
        return self._eye.found.words if self._eye.found is not None else None

    def state(self, scene: Scene, time_s: float, jitter_px: tuple[float, float] = (0.0, 0.0)) -> FrameState:
        """The frame of a scene at a time, its geometry on the GPU; the picture is shifted by `jitter_px` pixels."""
        if time_s != self._time_s:
            self.gpu.update(scene.instances_at(time_s))
            self._time_s = time_s
        else:
            self.gpu.hold()
        boxes_ws = np.stack([item.bounds_ws for item in self.gpu.items])
        view = scene.view_at(time_s)
        camera = CameraState.make(view, self._setup.size, self._setup.scene_bounds_ws, jitter_px, boxes_ws)
        before, transforms = self._previous or (camera, {})
        instances = [item.instance for item in self.gpu.items]
        medium = self._eye.find(instances, boxes_ws, view.position_ws, self.gpu.version)
        return FrameState(
            time_s=time_s,
            camera=camera,
            previous_camera=before,
            gpu=self.gpu,
            exposure=exposure_of(scene, self._setup.bounds_ws),
            previous_transforms=transforms,
            index=self.pictures,
            eye_medium=medium,
            history_camera=self.drawn,
        )

    def remember(self, frame: FrameState, *, as_frame: bool) -> None:
        """After a picture was drawn. `as_frame`: the next frame's motion is counted from it."""
        self.pictures += 1
        self.drawn = frame.camera
        if as_frame:
            self._previous = (frame.camera, {i.instance.name: i.world_from_object for i in self.gpu.items})


def exposure_of(scene: Scene, receivers_ws: FloatArray) -> float:
    """The scene's exposure, or one that shows a white surface in full light a stop above middle grey's. Where nothing
    is there that the lights could fall on - glass alone - what is seen is the sky, and its light alone counts.

    Args:
        receivers_ws: (2, 3), metres; the receivers' box, in whose centre positional lights are judged.
    """
    if scene.exposure is not None:
        return scene.exposure
    sky = float(np.dot(scene.sky.zenith, LUMINANCE)) * np.pi
    receives = any(instance.optical_kind is OpticalKind.DIFFUSE for instance in scene.instances)
    if sky > 0.0 and not receives:
        return 1.3 * np.pi / sky
    centre = receivers_ws.mean(axis=0)
    lux = 0.0
    for light in scene.lights:
        power = light.intensity * float(np.dot(light.color, LUMINANCE))
        if light.kind is not LightKind.DIRECTIONAL:
            power /= max(float(np.sum((centre - np.asarray(light.position_ws)) ** 2)), 1e-30)
        lux += power
    return 1.3 * np.pi / max(lux + sky, 1e-30)
