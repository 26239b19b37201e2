"""Where a light's caustics land, found by sending a coarse light through the scene once: the window of the receiver view.

A caustic map fitted to the receivers as a whole wastes its texels on where no caustic falls; the light frustum of published code
leaves three quarters unused. Two coarse rounds, each with its own read-back, before the first frame; none in a frame.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from glcaustics.caustics.branches import branches_of, read_rgba32f
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes.frame import FrameSetup, FrameState, LightSetup
from glcaustics.passes.geometry import points_of
from glcaustics.passes.light_views import LightView, fit_view
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.model import FloatArray, OpticalKind

if TYPE_CHECKING:
    from glcaustics.caustics.caustic_map import CausticMap

COARSE_CASTER, COARSE_MAP = 128, 384
LOST_SHARE = 2.5e-4  # of the flux that may fall outside of the window, on each of its four sides
AIR = {False: 0.02, True: 0.06}  # border of the window; more where the water moves


def fit_receiver(
    method: CausticMap, device: Device, setup: FrameSetup, light: LightSetup, frame: FrameState
) -> dict[str, float]:
    """Set `light.receiver` to the window that holds the landing light.

    Returns:
        Share of the light that lands, by branch kind ("refract", "reflect").
    """
    landed: dict[str, float] = {}
    coarse_options = {**setup.options, "march_steps": max(32, int(setup.options["march_steps"]))}
    everything = setup.instances()
    receivers = points_of([i for i in everything if i.optical_kind is OpticalKind.DIFFUSE])
    casters = points_of([i for i in everything if i.optical_kind is not OpticalKind.DIFFUSE])
    view = fit_view(light.light, receivers, COARSE_MAP)
    caster = fit_view(light.light, casters, COARSE_CASTER, depth_points_ws=points_of(everything))
    points = np.zeros((0, 3))
    for _ in range(2):
        coarse = FrameSetup(
            setup.scene, setup.size, coarse_options, setup.transmissive_shadows, setup.seed, False,
            [], setup.static_instances, setup.sampled_instances, setup.bounds_ws, setup.scene_bounds_ws,
        )  # fmt: skip
        coarse_light = replace(light, caster=caster, receiver=view)
        coarse.lights = [coarse_light]
        points, weights, landed = _coarse_solve(method, device, coarse, coarse_light, frame)
        if len(points) == 0:
            return landed
        view = _window(light, points, weights, COARSE_MAP, setup.is_animated, receivers)
    light.receiver = _window(light, points, weights, int(setup.options["map_size"]), setup.is_animated, receivers)
    return landed


def _coarse_solve(
    method: CausticMap, device: Device, setup: FrameSetup, light: LightSetup, frame: FrameState
) -> tuple[FloatArray, FloatArray, dict[str, float]]:
    """Landing points (N, 3), their flux (N,), and the landed share of each kind."""
    graph = FrameGraph()
    method.declare_solves(graph, setup, light)
    branches = branches_of(setup, light)
    runner = PlanRunner(device, graph.compile(outputs=[r for b in branches for r in (b.landing, b.flux)]), setup)
    try:
        runner.run(frame)
        points, weights = [], []
        shares: dict[str, list[float]] = {}
        tried_flux = 0.0
        for branch in branches:
            landing = read_rgba32f(runner, branch.landing)
            flux = read_rgba32f(runner, branch.flux)[..., :3].astype(np.float64).sum(axis=2)
            ok = landing[..., 3] > 0.0
            points.append(landing[ok][:, :3].astype(np.float64))
            weights.append(flux[ok])
            shares.setdefault(branch.kind, []).append(float(flux[ok].sum()))
            tried_flux += float(flux.sum())
    finally:
        runner.release()
    landed = {kind: sum(values) / max(tried_flux, 1e-300) for kind, values in shares.items()}
    return np.concatenate(points), np.concatenate(weights), landed


def _window(
    light: LightSetup, points: FloatArray, weights: FloatArray, texels: int, animated: bool, receivers: FloatArray
) -> LightView:
    """The view that holds all of the landing flux but LOST_SHARE on each side."""
    first = fit_view(light.light, points, texels, depth_points_ws=receivers)
    if first.faces == 6:
        return first
    u, v = _window_coordinates(first, points)
    keep = _inner(u, weights) & _inner(v, weights)
    kept = points[keep] if keep.any() else points
    border = max(2.0, AIR[animated] * texels)
    return fit_view(light.light, kept, texels, depth_points_ws=np.concatenate([receivers, kept]), border_texels=border)


def _window_coordinates(view: LightView, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ view.matrices[0].T
    w = np.where(clip[:, 3] > 0.0, clip[:, 3], 1.0)
    return clip[:, 0] / w, clip[:, 1] / w


def _inner(values: FloatArray, weights: FloatArray) -> Any:
    """Mask of the values between the two weighted quantiles."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    total = cumulative[-1] if len(cumulative) else 0.0
    low = values[order[np.searchsorted(cumulative, LOST_SHARE * total)]]
    high = values[order[min(np.searchsorted(cumulative, (1.0 - LOST_SHARE) * total), len(order) - 1)]]
    return (values >= low) & (values <= high)
