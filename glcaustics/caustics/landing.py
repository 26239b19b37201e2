"""Where a light's caustics land, found by sending a coarse light through the scene once: the window of the receiver
view.

A caustic map fitted to the receivers as a whole wastes its texels on where no caustic falls; the light frustum of
published code leaves three quarters unused. Two coarse rounds, each with its own read-back, before the first frame;
none in a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from glcaustics.caustics.branches import NO_EXIT, SOLID, branches_of, read_rgba32f, solids_entered
from glcaustics.caustics.map_warp import MapWarp, fit_warp
from glcaustics.caustics.solid_views import SolidViews
from glcaustics.gpu import Device
from glcaustics.graph import FrameGraph
from glcaustics.passes.fit_view import fit_view
from glcaustics.passes.frame import FrameSetup, FrameState, LightSetup
from glcaustics.passes.geometry import boxes_of, points_of
from glcaustics.passes.light_views import LightView
from glcaustics.passes.receiver_views import CORE, ReceiverView, receiver_views
from glcaustics.passes.runner import PlanRunner
from glcaustics.scene.mesh_tools import is_convex
from glcaustics.scene.model import FloatArray, Instance, Light, OpticalKind

if TYPE_CHECKING:
    from glcaustics.caustics.light_solve import LightMapMethod

COARSE_CASTER, COARSE_MAP = 128, 384
CORE_CUTS = (
    0.01,
    0.04,
    0.15,
)  # of the flux that may fall outside of a core, on each of its four sides; core within core
CORE_AREA = 0.1  # of the window's area that a core may have at most: else one map serves as well
CORE_BORDER = 0.1  # of a core's texels on each side
LAYERED_SHARE = 0.01  # of the light in solids: from there on a second pair of their layers is drawn
LOST_SHARE = 2.5e-4  # of the flux that may fall outside of the window, on each of its four sides
AIR = {False: 0.02, True: 0.06}  # border of the window; more where the water moves


@dataclass(frozen=True)
class _InSolids:
    """Shares of the flux that enters solids: `trapped` finds no way out; `entered` goes into another, and lands."""

    trapped: float = 0.0
    entered: float = 0.0


def fit_receivers(
    method: LightMapMethod, device: Device, setup: FrameSetup, light: LightSetup, frame: FrameState
) -> tuple[dict[str, float], dict[str, MapWarp]]:
    """Set the windows of `light.receivers` so that they hold the landing light.

    Returns:
        Share of the light that lands, by branch kind; and the warps of the maps that get one, by the view's name.
    """
    everything = setup.instances()
    receivers = points_of([i for i in everything if i.optical_kind is OpticalKind.DIFFUSE])
    boxes = boxes_of(i for i in everything if i.optical_kind is OpticalKind.DIFFUSE)
    coarse = _coarse(setup, light)
    (coarse_light,) = coarse.lights
    shares: dict[str, float] = {}
    trapped, solids = 0.0, _InSolids()
    one_pair_serves = _one_pair_serves(everything)
    for layers, texels in ((1, COARSE_MAP), (2, int(setup.options["map_size"]))):
        method.solids.set_layers(light, 1 if one_pair_serves else layers)
        landed, shares, solids = _coarse_solve(method, device, coarse, coarse_light, frame)
        for name, (points, weights) in landed.items():
            if len(points):
                seen_from = coarse_light.receivers[name].view.light
                view = _window(seen_from, points, weights, texels, setup.is_animated, receivers, boxes)
                coarse_light.receivers[name] = replace(coarse_light.receivers[name], view=view)
        trapped = max(trapped, solids.trapped)
    _decide_layers(method.solids, light, one_pair_serves, trapped, solids.entered)
    light.receivers = coarse_light.receivers
    warps: dict[str, MapWarp] = {}
    for name, (points, weights) in landed.items():
        around = coarse_light.receivers[name]
        if method.warps:
            if len(points) and around.view.faces == 1:
                u, v = _window_coordinates(around.view, points)
                warp = fit_warp(u, v, weights, around.view.size)
                warps |= {name: warp} if warp is not None else {}
            continue
        for cut in CORE_CUTS:
            core = _core(around, points, weights, cut, int(setup.options["map_size"]), receivers, boxes)
            if core is not None:
                light.receivers[core.name] = around = core
    return shares, warps


def fit_layers(method: LightMapMethod, device: Device, setup: FrameSetup, light: LightSetup, frame: FrameState) -> None:
    """Decide `method.solids.layers` alone, for photons, which need no windows; `method` solves for them."""
    one_pair_serves = _one_pair_serves(setup.instances())
    trapped, shares = 0.0, _InSolids()
    if not one_pair_serves:
        coarse = _coarse(setup, light)
        for layers in (1, 2):
            method.solids.set_layers(light, layers)
            _, _, shares = _coarse_solve(method, device, coarse, coarse.lights[0], frame)
            trapped = max(trapped, shares.trapped)
    _decide_layers(method.solids, light, one_pair_serves, trapped, shares.entered)


def _coarse(setup: FrameSetup, light: LightSetup) -> FrameSetup:
    """The scene under this light alone, with coarse views."""
    everything = setup.instances()
    casters = points_of([i for i in everything if i.optical_kind is not OpticalKind.DIFFUSE])
    caster = fit_view(
        light.light, casters, COARSE_CASTER, depth_points_ws=points_of(everything), boxes_ws=boxes_of(everything)
    )
    coarse_light = replace(light, caster=caster, receivers=receiver_views(everything, light.light, COARSE_MAP))
    options = {**setup.options, "march_steps": max(32, int(setup.options["march_steps"]))}
    return replace(setup, options=options, lights=[coarse_light])


def _core(
    around: ReceiverView,
    points: FloatArray,
    weights: FloatArray,
    cut: float,
    texels: int,
    receivers: FloatArray,
    boxes: FloatArray,
) -> ReceiverView | None:
    """A view of the small part of a window in which most of the light lands, if there is one: a lens's focus."""
    if len(points) == 0 or around.view.faces == 6:
        return None
    u, v = _window_coordinates(around.view, points)
    keep = _inner(u, weights, cut) & _inner(v, weights, cut)
    if not keep.any() or float(np.ptp(u[keep]) * np.ptp(v[keep])) > CORE_AREA * 4.0:
        return None
    kept = points[keep]
    border = CORE_BORDER * texels
    depths = np.concatenate([receivers, kept])
    view = fit_view(around.view.light, kept, texels, depth_points_ws=depths, boxes_ws=boxes, border_texels=border)
    if view.faces == 6:
        return None
    # The border holds the splats that reach into the inner part from outside of it.
    inner = (1.0 - 0.9 * 2.0 * border / view.size[0], 1.0 - 0.9 * 2.0 * border / view.size[1])
    return ReceiverView(around.name + CORE, view, around.clip_plane, inner)


def _coarse_solve(
    method: LightMapMethod, device: Device, setup: FrameSetup, light: LightSetup, frame: FrameState
) -> tuple[dict[str, tuple[FloatArray, FloatArray]], dict[str, float], _InSolids]:
    """Landing points (N, 3) and their flux (N,) in each receiver view, and the landed share of each branch kind."""
    graph = FrameGraph()
    branches = branches_of(setup, light, method.name)
    method.declare_solves(graph, setup, light, branches)
    runner = PlanRunner(device, graph.compile(outputs=[r for b in branches for r in (b.landing, b.flux)]), setup)
    points: dict[str, list[FloatArray]] = {}
    weights: dict[str, list[FloatArray]] = {}
    shares: dict[str, float] = {}
    tried_flux, solid_flux, trapped_flux, entered_flux = 0.0, 0.0, 0.0, 0.0
    try:
        runner.run(frame)
        for branch in branches:
            landing = read_rgba32f(runner, branch.landing)
            flux = read_rgba32f(runner, branch.flux)[..., :3].astype(np.float64).sum(axis=2)
            ok = landing[..., 3] > 0.0
            points.setdefault(branch.view, []).append(landing[ok][:, :3].astype(np.float64))
            weights.setdefault(branch.view, []).append(flux[ok])
            shares[branch.kind] = shares.get(branch.kind, 0.0) + float(flux[ok].sum())
            tried_flux += float(flux.sum())
            if branch.kind == SOLID:
                solid_flux += float(flux.sum())
                trapped_flux += float(flux[landing[..., 3] == NO_EXIT].sum())
                entered_flux += float(flux[solids_entered(landing[..., 3]) > 0].sum())
    finally:
        runner.release()
    solids = _InSolids(trapped_flux / max(solid_flux, 1e-300), entered_flux / max(solid_flux, 1e-300))
    landed = {name: (np.concatenate(points[name]), np.concatenate(weights[name])) for name in points}
    return landed, {kind: flux / max(tried_flux, 1e-300) for kind, flux in shares.items()}, solids


def _one_pair_serves(everything: tuple[Instance, ...]) -> bool:
    """Whether there is at most one solid, and it is convex: light that leaves it meets no other."""
    solids = [i for i in everything if i.optical_kind is OpticalKind.SOLID]
    return all(is_convex(i.mesh.positions_m, i.mesh.triangles) for i in solids) if len(solids) < 2 else False


def _decide_layers(
    solids: SolidViews, light: LightSetup, one_pair_serves: bool, trapped: float, entered: float
) -> None:
    """`trapped`, `entered`: of the flux in solids, what finds no way out by one pair, and what enters another."""
    because = "the scene's only solid is convex"
    if not one_pair_serves:
        because = (
            f"{100.0 * trapped:.2g} % of the light in solids finds no way out by one pair of layers, "
            f"and {100.0 * entered:.2g} % enters another"
        )
    layers = 2 if not one_pair_serves and max(trapped, entered) > LAYERED_SHARE else 1
    solids.set_layers(light, layers, because)


def _window(
    light: Light,
    points: FloatArray,
    weights: FloatArray,
    texels: int,
    animated: bool,
    receivers: FloatArray,
    boxes: FloatArray,
) -> LightView:
    """The view that holds all of the landing flux but LOST_SHARE on each side."""
    first = fit_view(light, points, texels, depth_points_ws=receivers, boxes_ws=boxes)
    if first.faces == 6:
        return first
    u, v = _window_coordinates(first, points)
    keep = _inner(u, weights) & _inner(v, weights)
    kept = points[keep] if keep.any() else points
    border = max(2.0, AIR[animated] * texels)
    held = np.concatenate([receivers, kept])
    return fit_view(light, kept, texels, depth_points_ws=held, border_texels=border, boxes_ws=boxes)


def _window_coordinates(view: LightView, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ view.matrices[0].T
    w = np.where(clip[:, 3] > 0.0, clip[:, 3], 1.0)
    return clip[:, 0] / w, clip[:, 1] / w


def _inner(values: FloatArray, weights: FloatArray, cut: float = LOST_SHARE) -> Any:
    """Mask of the values between the two weighted quantiles."""
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    last = len(order) - 1
    low, high = (
        values[order[min(int(np.searchsorted(cumulative, share * cumulative[-1])), last)]] for share in (cut, 1.0 - cut)
    )
    return (values >= low) & (values <= high)
