"""What the scenes' generator scripts share: implicit surfaces, noise, mesh parts and files. NumPy and Pillow only.

Run by the make_*.py scripts beside the scenes; glcaustics itself never imports it.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

LICENCE = "MIT, made for glcaustics"


def ellipsoid(p, centre, radii):
    """Bound on the signed distance to an ellipsoid, exact enough near the surface (Quilez' form)."""
    q = (p - np.array(centre)) / radii
    k0 = np.linalg.norm(q, axis=-1)
    k1 = np.linalg.norm(q / radii, axis=-1)
    return np.where(k1 > 1e-9, k0 * (k0 - 1.0) / np.maximum(k1, 1e-9), -min(radii))


def capsule(p, a, b, ra, rb, flat=None):
    """Tapered capsule from a to b; `flat` = (axis vector, factor) squeezes it along that axis."""
    a, b = np.array(a), np.array(b)
    q, shrink = p - a, 1.0
    if flat is not None:
        axis, factor = np.array(flat[0]) / np.linalg.norm(flat[0]), flat[1]
        q = q + (q @ axis)[..., None] * axis * (1.0 / factor - 1.0)
        shrink = factor
    t = np.clip((q @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
    swell = ra + (rb - ra) * t + 0.055 * np.sin(np.pi * t)
    return (np.linalg.norm(q - t[..., None] * (b - a), axis=-1) - swell) * (0.5 + 0.5 * shrink)


def smooth_min(a, b, k):
    """Polynomial smooth minimum with a blend of width k (twice differentiable in the blend's inside)."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * h * k / 6.0


def smooth_max(a, b, k):
    return -smooth_min(-a, -b, k)


def gradient(field, p, h=1e-4):
    """Gradient (N, 3) of a field by central differences."""
    steps = np.eye(3) * h
    return np.stack([field(p + s) - field(p - s) for s in steps], axis=-1) / (2.0 * h)


def surface_nets(values, low, step):
    """One vertex a mixed cell, at the mean of its edge crossings; one quad a crossed edge, cut into two triangles."""
    nx, ny, nz = values.shape
    inside = values < 0.0
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]

    def at(array, c):
        return array[c[0] : nx - 1 + c[0], c[1] : ny - 1 + c[1], c[2] : nz - 1 + c[2]]

    count = sum(at(inside, c).astype(int) for c in corners)
    mixed = (count > 0) & (count < 8)
    number = np.full(mixed.shape, -1)
    number[mixed] = np.arange(mixed.sum())
    total, hits = np.zeros((mixed.sum(), 3)), np.zeros(mixed.sum())
    for a in corners:
        for axis in range(3):
            if a[axis]:
                continue
            b = tuple(1 if n == axis else a[n] for n in range(3))
            va, vb = at(values, a)[mixed], at(values, b)[mixed]
            cross = (va < 0) != (vb < 0)
            t = np.where(cross, va / np.where(cross, va - vb, 1.0), 0.0)
            total[cross] += (np.array(a, float) + np.eye(3)[axis] * t[:, None])[cross]
            hits += cross
    vertices = low + step * (np.argwhere(mixed) + total / hits[:, None])
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first, second = np.moveaxis(inside, axis, 0)[:-1], np.moveaxis(inside, axis, 0)[1:]
        where = np.argwhere(first != second)
        entering = second[tuple(where.T)]  # the solid lies on the far side of the edge
        other = [n for n in range(3) if n != axis]
        cell = np.zeros((len(where), 3), int)
        cell[:, axis], cell[:, other[0]], cell[:, other[1]] = where.T
        quad = []
        for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
            neighbour = cell.copy()
            neighbour[:, u] -= du
            neighbour[:, v] -= dv
            quad.append(number[tuple(neighbour.T)])
        quad = np.stack(quad, axis=1)
        quad[entering] = quad[entering][:, ::-1]
        quads.append(quad)
    return vertices, np.concatenate(quads)


def split_quads(vertices, quads):
    """Cut each quad along its shorter diagonal."""
    a, b, c, d = (vertices[quads[:, i]] for i in range(4))
    short = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    ac, bd = quads[short], quads[~short]
    parts = [ac[:, [0, 1, 2]], ac[:, [0, 2, 3]], bd[:, [0, 1, 3]], bd[:, [1, 2, 3]]]
    return np.concatenate(parts)


def without_saddles(values, step):
    """`values` with the nearest outside corner of every checkered cell face put inside, so that no edge has 4 faces."""
    values = values.copy()
    for _ in range(40):
        found = 0
        for axis in range(3):
            v = np.moveaxis(values, axis, 0)  # a view: what is written to it lands in `values`
            corners = [v[:, :-1, :-1], v[:, 1:, :-1], v[:, 1:, 1:], v[:, :-1, 1:]]
            inside = [c < 0.0 for c in corners]
            for k in (0, 1):
                checkered = inside[k] & inside[k + 2] & ~inside[1 - k] & ~inside[3 - k]
                found += int(checkered.sum())
                first = checkered & (corners[1 - k] <= corners[3 - k])
                corners[1 - k][first] = -1e-3 * step
                corners[3 - k][checkered & ~first] = -1e-3 * step
        if not found:
            return values
    raise RuntimeError("the field is too fine for this grid: saddles stay")


def polygonise(field, low, high, step):
    """Mesh of field = 0 in the box: vertices (V, 3) on the surface, unit normals (V, 3) outward, triangles (T, 3).

    Surface nets (Gibson 1998); the vertices are pulled onto the surface, the normals are the field's gradient.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    counts = np.ceil((high - low) / step).astype(int) + 1
    axes = [low[i] + step * np.arange(counts[i]) for i in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    vertices, quads = surface_nets(without_saddles(field(grid), step), low, step)
    for _ in range(6):  # Newton steps along the gradient, short ones so that neighbours keep their order
        slope = gradient(field, vertices)
        move = -field(vertices)[:, None] * slope / np.maximum((slope * slope).sum(axis=1, keepdims=True), 1e-6)
        length = np.linalg.norm(move, axis=1, keepdims=True)
        vertices = vertices + move * np.minimum(1.0, 0.3 * step / np.maximum(length, 1e-12))
    normals = gradient(field, vertices)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, normals, split_quads(vertices, quads)


def write_ply(path, vertices, normals, triangles, comment):
    """Binary little-endian PLY with normals."""
    head = f"ply\nformat binary_little_endian 1.0\ncomment {comment}\n"
    head += f"element vertex {len(vertices)}\n" + "".join(f"property float {n}\n" for n in "x y z nx ny nz".split())
    head += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.empty(len(triangles), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    data = np.concatenate([vertices, normals], axis=1).astype("<f4")
    path.write_bytes(head.encode("ascii") + data.tobytes() + faces.tobytes())


def write_glb(path, meshes, nodes=None):
    """A .glb of mesh parts {name: part}; `nodes`: [(mesh name, 4x4 matrix)], by default each mesh once.

    Positions are 32-bit floats, indices 16 bits where they fit; there are no materials, the scene file has them.
    """
    blob, views, accessors, gl_meshes, number = bytearray(), [], [], [], {}

    def accessor(array, kind, component, target, bounds=False):
        while len(blob) % 4:
            blob.append(0)
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes, "target": target})
        blob.extend(array.tobytes())
        entry = {"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind}
        if bounds:
            entry |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        accessors.append(entry)
        return len(accessors) - 1

    for name, (positions, normals, uv, triangles) in meshes.items():
        wide = len(positions) > 65535
        attributes = {
            "POSITION": accessor(np.asarray(positions, "<f4"), "VEC3", 5126, 34962, True),
            "NORMAL": accessor(np.asarray(normals, "<f4"), "VEC3", 5126, 34962),
            "TEXCOORD_0": accessor(np.asarray(uv, "<f4"), "VEC2", 5126, 34962),
        }
        index = np.asarray(triangles, "<u4" if wide else "<u2").ravel()
        indices = accessor(index, "SCALAR", 5125 if wide else 5123, 34963)
        number[name] = len(gl_meshes)
        gl_meshes.append({"name": name, "primitives": [{"attributes": attributes, "indices": indices}]})
    placed_nodes = []
    for count, (name, matrix) in enumerate(nodes or [(name, np.eye(4)) for name in meshes]):
        columns = [round(float(x), 6) for x in np.asarray(matrix).T.ravel()]
        placed_nodes.append({"name": f"{name} {count}", "mesh": number[name], "matrix": columns})
    head = {
        "asset": {"version": "2.0", "copyright": LICENCE, "generator": "scenes/procedural.py"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(placed_nodes)))}],
        "nodes": placed_nodes,
        "meshes": gl_meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    blob.extend(b"\0" * (-len(blob) % 4))
    total = 12 + 8 + len(text) + 8 + len(blob)
    words = np.array([0x46546C67, 2, total, len(text), 0x4E4F534A], "<u4").tobytes()
    Path(path).write_bytes(words + text + np.array([len(blob), 0x004E4942], "<u4").tobytes() + bytes(blob))


def save_png(path, color, colors=0):
    """Write sRGB values in [0, 1], (H, W, 3), as a PNG, with a palette of `colors` when given (small files)."""
    picture = Image.fromarray((np.clip(color, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
    if colors:
        picture = picture.quantize(colors, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)


def save_jpg(path, color, quality=80):
    """Write sRGB values in [0, 1], (H, W, 3), as a JPEG: for large pictures without sharp edges."""
    Image.fromarray((np.clip(color, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)).save(path, quality=quality)
