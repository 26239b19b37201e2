"""What a caustics method is: it declares its passes, the frame graph decides."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph, TextureDesc
from glcaustics.passes.frame import FrameSetup, FrameState
from glcaustics.passes.geometry import SPECULAR_KINDS
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import OpticalKind, Scene

IRRADIANCE = "caustics.irradiance"  # what every method writes: E_c at the camera's opaque pixels, W/m^2 or lux
NOISY_IRRADIANCE = "caustics.irradiance_noisy"  # what a noisy method writes instead when it is denoised


def irradiance_of(layer: str) -> str:
    """E_c at the opaque surfaces of a layer of `gbuffer.LAYERS`."""
    return f"caustics{layer}.irradiance"


class CausticsMethod(ABC):
    """A way to compute E_c, the irradiance by refracted and reflected light, at the camera's opaque pixels.

    A method adds its passes to the graph in `declare`; the last of them writes `caustics.irradiance`. One instance
    serves one renderer, so it may keep what it measured in `prepare`.

    Attributes:
        name: as in `--method`. summary: one line. paper: author, year, title.
        ladder: quality -> options; more cost and less error from step to step.
        option_help: option -> one line with its unit and range.
        noisy: it has the option "denoise"; with it, it writes `NOISY_IRRADIANCE`, which the denoiser takes.
        lights_second_layer: with two depth layers it writes `irradiance_of` the second one too.
        noise_share: standard deviation of its noise as a share of that of independent photons (Poisson), at most.
        follows_size_and_roughness: light is spread by the size of its source and by rough specular surfaces; without,
            sources are points and those surfaces smooth, which is announced.
        unbiased_options: under which its mean is the truth: what closed forms are tested with.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    paper: ClassVar[str]
    ladder: ClassVar[Mapping[str, Mapping[str, Any]]]
    option_help: ClassVar[Mapping[str, str]] = {}
    noisy: ClassVar[bool] = False
    lights_second_layer: ClassVar[bool] = False
    noise_share: ClassVar[float] = 0.0
    follows_size_and_roughness: ClassVar[bool] = False
    unbiased_options: ClassVar[Mapping[str, Any]] = {}

    @classmethod
    def why_not(cls, scene: Scene) -> str | None:
        """Why this scene does not need the method; None when it does."""
        kinds = {instance.optical_kind for instance in scene.instances_at(0.0)}
        if not kinds & set(SPECULAR_KINDS):
            return "nothing in the scene refracts or reflects"
        if OpticalKind.DIFFUSE not in kinds:
            return "nothing in the scene receives caustics"
        if not any(light.shines for light in scene.lights):
            return "no light shines"
        return None

    @classmethod
    @abstractmethod
    def validate(cls, options: Mapping[str, Any]) -> None:
        """Raise UsageError for an option out of its range."""

    def prepare(self, device: Device, setup: FrameSetup, frame: FrameState) -> None:  # noqa: B027  may be nothing
        """Once, before the first frame: measure what the light views have to hold."""

    @abstractmethod
    def declare(self, graph: FrameGraph, setup: FrameSetup) -> None:
        """Add the passes; the last one writes `caustics.irradiance`."""

    @abstractmethod
    def leave_out(self, graph: FrameGraph, setup: FrameSetup, because: str) -> None:
        """Record the passes that this scene does not need."""

    def stats_resources(self) -> tuple[str, ...]:
        """Resources that `solve_stats` reads; kept to the end of the frame when statistics are collected."""
        return ()

    def solve_stats(self, runner: PlanRunner) -> list[dict[str, Any]]:
        """One dictionary a solve: iterations, converged, failed, flux and lost flux by cause."""
        return []

    @staticmethod
    def irradiance_desc(setup: FrameSetup) -> TextureDesc:
        """The texture of `caustics.irradiance`."""
        return TextureDesc("rgba32f", setup.size, "lux", filter="linear")
