"""Part "eye": how fast Newton's method finds what eye rays show and where light rays land, and what it costs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from glcaustics.bench.cells import Measured, Part
from glcaustics.bench.convergence import seeded_cameras
from glcaustics.bench.eye_cost import eye_cost
from glcaustics.bench.eye_rays import PUBLISHED, eye_study
from glcaustics.bench.light_rays import light_study
from glcaustics.bench.machine import instrument_key
from glcaustics.bench.measure import picture
from glcaustics.bench.plan import EyePlan, Plan
from glcaustics.scene.load import load_scene

FloatArray = npt.NDArray[np.float64]
NOTHING = {"none": np.zeros(0)}  # a cell has arrays; these have none to keep
INSTRUMENTS = ("eye_rays", "eye_truth", "eye_cost", "light_rays", "light_solver", "solver_variants", "convergence")


def count_steps(plan: Plan) -> int:
    """How many steps `run` goes through."""
    return (3 + plan.eye.cost_views) * len(plan.eye.scenes)


class EyePart(Part):
    """Runs the instruments of eye and light rays over the eye plan's scenes."""

    @property
    def settings(self) -> EyePlan:
        return self.plan.eye

    def run(self) -> dict[str, Any]:
        """The report's key of this part: `eye`."""
        eye, light, costs = [], [], []
        for name in self.settings.scenes:
            eye += self._eye(name)
            light += self._light(name)
            costs += self._costs(name)
            self._picture(name)
        return {
            "eye": {
                "settings": asdict(self.settings),
                "eye_rays": eye,
                "light_rays": light,
                "costs": costs,
                "published": PUBLISHED,
            }
        }

    def _key(self, name: str, what: str, *parts: Any) -> str:
        return self.cells.key("eye", instrument_key(*INSTRUMENTS), what, name, *parts)

    def _eye(self, name: str) -> list[dict[str, Any]]:
        p = self.settings

        def make() -> Measured:
            return {"scenes": eye_study([name], p.views, p.size, backend=self.cells.backend)["scenes"]}, NOTHING

        key = self._key(name, "eye rays", p.views, p.size)
        return list(self.cells.cell(f"{name}: eye rays, {p.views} views", key, make)[0]["scenes"])

    def _light(self, name: str) -> list[dict[str, Any]]:
        p = self.settings

        def make() -> Measured:
            found = light_study([name], p.views, quality=p.light_quality, backend=self.cells.backend)
            return {"scenes": found["scenes"]}, NOTHING

        key = self._key(name, "light rays", p.views, p.light_quality)
        return list(self.cells.cell(f"{name}: light rays, {p.views} lights", key, make)[0]["scenes"])

    def _costs(self, name: str) -> list[dict[str, Any]]:
        """Cost of the solvers in fetch passes, view by view, with reflections and without."""
        p, found = self.settings, []
        scene = load_scene(name)
        for number, camera in enumerate(seeded_cameras(scene, p.views)[: p.cost_views]):

            def make(camera: Any = camera) -> Measured:
                with_them, without = (
                    eye_cost(
                        scene,
                        camera,
                        p.cost_size,
                        rounds=p.rounds,
                        reflections=reflections,
                        backend=self.cells.backend,
                    )
                    for reflections in (True, False)
                )
                return {"with_reflections": with_them, "without": without}, NOTHING

            pose = np.asarray(camera.world_from_camera, np.float64)
            key = self._key(name, "cost", pose, p.cost_size, p.rounds)
            costs = self.cells.cell(f"{name}: cost of eye rays, view {number}", key, make)[0]
            found.append({"scene": name, "view": number, "size": list(p.cost_size), **costs})
        return found

    def _picture(self, name: str) -> None:
        p = self.settings

        def make() -> Measured:
            options = (p.picture_quality, self.cells.backend, p.picture_size, p.picture_samples)
            return {}, {"ldr": picture(name, "auto", *options)}

        key = self._key(name, "picture", p.picture_quality, p.picture_size, p.picture_samples)
        self.pictures[f"{name} view"] = self.cells.cell(f"{name}: picture", key, make)[1]["ldr"]
