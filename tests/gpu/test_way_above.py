"""Where a ray comes down to what is nearest around it (`common/way_clear.glsl`): nothing may stand before that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glcaustics.gpu import Device, Program, ShaderLoader, create_device, glsl_root
from tests.gpu.feature_scenes import BACKEND

pytestmark = pytest.mark.gpu
SIZE = (200, 120)  # not a whole number of cells
CELLS = (-(-SIZE[0] // 16), -(-SIZE[1] // 16))
SHADER = """
#include "common/way_clear.glsl"
uniform sampler2D t_near;
uniform sampler2D t_step;
layout(location = 0) out vec4 o_u;
void main() {
    vec4 way = texelFetch(t_step, ivec2(gl_FragCoord.xy), 0);
    vec2 size = vec2(textureSize(t_step, 0));
    vec2 room = mix(gl_FragCoord.xy, size - gl_FragCoord.xy, greaterThan(way.xy, vec2(0.0)));
    vec2 leaves = room / max(abs(way.xy), vec2(1e-6));
    float u_screen = clamp(min(leaves.x, leaves.y), 0.0, 1.0);
    GlcRasterRay ray = GlcRasterRay(vec3(gl_FragCoord.xy, way.w), way.xyz, 1.0, vec2(1.0), u_screen);
    o_u = vec4(glc_way_above(t_near, size, ray));
}
"""


def fetched(device: Device, program: Program, size: tuple[int, int]) -> np.ndarray:
    target = device.texture(size, "rgba32f")
    device.draw_fullscreen(program, device.framebuffer([target]))
    return np.frombuffer(target.read(), np.float32).reshape(size[1], size[0], 4)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_nothing_stands_before_where_a_ray_is_started(tmp_path: Path, scale: float) -> None:
    """A few posts of all heights on a sloping ground, rays of all lengths and slopes, one towards the eye in eight."""
    rng = np.random.default_rng(4)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]] + 0.5
    surface = 0.2 + 1e-3 * y + np.where(rng.uniform(size=x.shape) > 0.9996, rng.uniform(0.0, 0.3, x.shape), 0.0)
    start = np.maximum(surface, 0.2) + rng.uniform(0.01, 0.3, x.shape)
    turn, length = rng.uniform(0.0, 2.0 * np.pi, x.shape), rng.uniform(1.0, 150.0, x.shape)
    fall = np.where(rng.uniform(size=x.shape) < 0.125, 0.1, -rng.uniform(0.0, 0.6, x.shape))
    step = np.stack([length * np.cos(turn), length * np.sin(turn), scale * fall, scale * start], axis=-1)
    padded = np.full((16 * CELLS[1], 16 * CELLS[0]), -1.0)
    padded[: SIZE[1], : SIZE[0]] = surface
    nearest = scale * padded.reshape(CELLS[1], 16, CELLS[0], 16).max(axis=(1, 3))
    with create_device(BACKEND) as device:
        bounds = device.texture(CELLS, "rg32f", data=np.stack([nearest, nearest], axis=-1).astype(np.float32))
        near = device.program("passes/depth_chain/near").set(t_bounds=bounds, u_origin=(0, 0), u_cells=CELLS)
        around = device.texture(CELLS, "rgba32f", data=np.ascontiguousarray(fetched(device, near, CELLS)))
        for name in ("common", "interface"):
            (tmp_path / name).symlink_to(glsl_root() / name)
        (tmp_path / "x.frag").write_text(SHADER)
        program = Program(device.ctx, ShaderLoader(tmp_path).load("x", None), "x", ())
        program.set(t_near=around, t_step=device.texture(SIZE, "rgba32f", data=step.astype(np.float32)))
        u = fetched(device, program, SIZE)[..., 0].astype(np.float64)
    for part in np.linspace(0.0, 1.0, 101):
        px = np.stack([x, y], axis=-1) + (part * u)[..., None] * step[..., :2]
        column, row = (np.clip(px[..., k].astype(int), 0, SIZE[k] - 1) for k in (0, 1))
        gap = start + part * u * fall - surface[row, column]
        assert gap.min() > -1e-5, (part, gap.min())
    assert (u * length).mean() > 5.0  # pixels: and that is worth something
    assert (u[fall > 0.0] > 0.0).mean() > 0.5
