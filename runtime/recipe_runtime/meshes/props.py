"""What stands in a street: walls, lamps, trees, benches, bins; and plain towers far away."""

from __future__ import annotations

from functools import cache

import numpy as np
from recipe_compiler import exact
from recipe_compiler.plan import Element

from recipe_runtime.meshes.builder import Array, Builder, Index, cross, icosphere, noise, tube, unit
from recipe_runtime.meshes.mesh import Light, Pattern, Surface
from recipe_runtime.meshes.tags import Tag

_WALL = Surface("wall", Pattern.BRICK, Tag.WALLS)
_COPING = Surface("coping", Pattern.CONCRETE, Tag.WALLS)
_POLE = Surface("metal", Pattern.METAL, Tag.POLES)
_LAMP = Surface("lamp", Pattern.LAMP, Tag.POLES)
_BARK = Surface("bark", Pattern.BARK, Tag.VEGETATION)
_LEAVES = Surface("leaves", Pattern.FOLIAGE, Tag.VEGETATION)
_PIT = Surface("pit", Pattern.BARK, Tag.TERRAIN)
_WOOD = Surface("wood", Pattern.BARK, Tag.STATIC)
_METAL = Surface("metal", Pattern.METAL, Tag.STATIC)
_TOWER = Surface("wall", Pattern.CONCRETE, Tag.BUILDINGS)
_PANES = Surface("window", Pattern.WINDOW, Tag.BUILDINGS)


def wall(b: Builder, e: Element) -> None:
    """A free-standing wall, its smooth face at x = 0 looking along +x, with a plinth and a coping."""
    thick, width, height = e.size
    half = width / 2
    b.box(_WALL, (-thick, -half, 0.0), (0.0, half, height - 0.12), "-z")
    b.box(_COPING, (-thick - 0.06, -half, height - 0.12), (0.06, half, height))
    b.box(_COPING, (-thick - 0.03, -half, 0.0), (0.03, half, 0.25), "-z")


def lamp(b: Builder, e: Element) -> None:
    """A street lamp: a pole, and an arm over the street (+x) with a lantern that lights downwards."""
    _, thick, height = e.size
    arm, r = e.shape["arm"], thick / 2
    b.grid(_POLE, tube([(0, 0, 0), (0, 0, 0.7), (0, 0, 0.78)], [1.6 * r, 1.5 * r, r], 8), crease=0.5)
    b.grid(_POLE, tube([(0, 0, 0.7), (0, 0, height - 0.5)], [r, 0.55 * r], 8))
    rings = []
    for k in range(5):  # a quarter turn from the pole into the arm
        s, c = exact.sin_cos_deg(22.5 * k)
        x, z = 0.5 * (1 - c), height - 0.5 + 0.5 * s
        ring = [exact.sin_cos_deg(60.0 * n) for n in range(6)]
        rings.append([(x + 0.5 * r * rc * c, 0.5 * r * rs, z - 0.5 * r * rc * s) for rs, rc in ring])
    rings.append([(arm, py, pz) for _, py, pz in rings[-1]])
    b.grid(_POLE, rings)
    b.box(_POLE, (arm - 0.15, -0.13, height - 0.06), (arm + 0.55, 0.13, height + 0.05))
    b.box(_LAMP, (arm - 0.08, -0.1, height - 0.09), (arm + 0.48, 0.1, height - 0.06), "+z")
    b.lights.append(Light((arm + 0.2, 0.0, height - 0.1), (0.0, 0.0, -1.0), (1.0, 0.78, 0.5), 1400.0, 0.25))


def tree(b: Builder, e: Element) -> None:
    """A street tree: a leaning trunk that forks, under a crown of uneven clumps of leaves."""
    spread, _, height = e.size
    key, r, fork = int(e.shape["key"]), e.shape["trunk"], 0.42 * height
    lean = (0.12 * noise(key, 1), 0.12 * noise(key, 2))
    path = [(lean[0] * t, lean[1] * t, fork * t) for t in (-0.01, 0.02, 0.12, 0.5, 1.0)]
    b.grid(_BARK, tube(path, [2.0 * r, 1.6 * r, 1.05 * r, 0.9 * r, 0.7 * r], 8), crease=0.0)
    for k in range(3):
        s, c = exact.sin_cos_deg(120.0 * k + 40.0 * noise(key, 3 + k))
        reach = spread * 0.22
        branch = [(lean[0], lean[1], fork - 0.15), (lean[0] + reach * c, lean[1] + reach * s, fork + 0.22 * height)]
        b.grid(_BARK, tube(branch, [0.5 * r, 0.25 * r], 5), crease=0.0)
    b.quads(_PIT, [((-0.6, -0.6, 0.004), (0.6, -0.6, 0.004), (0.6, 0.6, 0.004), (-0.6, 0.6, 0.004))])
    points, normals, uvs, triangles = _crown(key % 16)
    scale = np.array([spread, spread, height])
    moved = points * scale + np.array([lean[0], lean[1], 0.0])
    b.add(_LEAVES, moved, unit(normals / scale), uvs * spread, triangles)


@cache
def _crown(kind: int) -> tuple[Array, Array, Array, Index]:
    """One of sixteen crowns for a tree of height and spread 1: vertices, normals, uv, triangles."""
    b = Builder()
    clumps = [(0.0, 0.0, 0.80, 0.36)]
    for k in range(4):
        s, c = exact.sin_cos_deg(90.0 * k + 45.0 * noise(kind, 10 + k))
        out = 0.27 * (1 + 0.25 * noise(kind, 20 + k))
        clumps.append((out * c, out * s, 0.62 + 0.07 * noise(kind, 30 + k), 0.29 + 0.045 * noise(kind, 40 + k)))
    for n, (x, y, z, size) in enumerate(clumps):
        _clump(b, kind + 977 * n, np.array((x, y, z)), np.array((size, size, 0.52 * size)))
    mesh = b.mesh()
    points, normals, uvs = (a.astype(np.float64) for a in (mesh.vertices, mesh.normals, mesh.uvs))
    return points, normals, uvs, mesh.triangles.astype(np.int64)


def _clump(b: Builder, key: int, centre: Array, radii: Array) -> None:
    """A ragged ball of leaves, with sprays that stand out of it and break its outline."""
    points, faces = icosphere(1)
    ragged = np.array([1.0 + 0.22 * noise(key, k) for k in range(len(points))])
    b.smooth([_LEAVES] * len(faces), points * ragged[:, None] * radii + centre, faces, crease=0.75)
    tufts = []
    for k, out in enumerate(points[::3]):
        at = out * (1.0 + 0.16 * noise(key, 200 + k))
        normal = unit((out + [0.8 * noise(key, 300 + 4 * k + axis) for axis in range(3)])[None])[0]
        side = unit(cross(normal, np.array([0.3, 0.2, 1.0]))[None])[0]
        up, size = cross(normal, side), 0.42 + 0.14 * noise(key, 500 + k)
        spray = np.array([-0.5 * up, 0.55 * side + 0.2 * up, 0.8 * up, 0.1 * up - 0.5 * side])
        tufts.append((at + size * spray) * radii + centre)
    b.quads(_LEAVES, tufts)


def bench(b: Builder, e: Element) -> None:
    """A bench that looks along +x."""
    depth, width, height = e.size
    half = width / 2
    for k in range(3):
        x = -depth / 2 + 0.08 + 0.16 * k
        b.box(_WOOD, (x, -half, 0.42), (x + 0.12, half, 0.46))
    for k in range(2):
        z = 0.56 + 0.16 * k
        b.box(_WOOD, (-depth / 2 - 0.02, -half, z), (-depth / 2 + 0.02, half, min(z + 0.12, height)))
    for y in (-half + 0.2, half - 0.26):
        b.box(_METAL, (-depth / 2 + 0.02, y, 0.0), (-depth / 2 + 0.07, y + 0.06, height))
        b.box(_METAL, (depth / 2 - 0.07, y, 0.0), (depth / 2 - 0.02, y + 0.06, 0.42))
        b.box(_METAL, (-depth / 2, y, 0.37), (depth / 2, y + 0.06, 0.42))


def bin_(b: Builder, e: Element) -> None:
    """A round litter bin with a lid."""
    across, _, height = e.size
    r = across / 2
    rings = tube(
        [(0, 0, 0), (0, 0, 0.8 * height), (0, 0, 0.82 * height), (0, 0, 0.86 * height), (0, 0, height)],
        [0.85 * r, r, 1.08 * r, 1.08 * r, 0.45 * r],
        12,
    )
    b.grid(_METAL, rings, crease=0.6, caps=(None, _METAL))


def tower(b: Builder, e: Element) -> None:
    """A distant building: plain walls and rows of windows on all sides."""
    depth, width, height = e.size
    x, y, key = depth / 2, width / 2, int(e.shape["key"]) * 16
    b.box(_TOWER, (-x, -y, 0.0), (x, y, height), "-z")
    floors, gap = int(height / 3.5), 0.05
    strips, uvs = [], []
    for ax, ay, bx, by in ((x, -y, x, y), (-x, y, -x, -y), (x, y, -x, y), (-x, -y, x, -y)):
        ox, oy = (gap if ax == bx else 0.0) * (1 if ax > 0 else -1), (gap if ay == by else 0.0) * (1 if ay > 0 else -1)
        across = int((abs(bx - ax) + abs(by - ay)) / 3.0)
        for floor in range(1, floors):
            z0, z1 = floor * 3.5, floor * 3.5 + 1.9
            lo, hi = 0.03, 0.97
            p = (ax + (bx - ax) * lo + ox, ay + (by - ay) * lo + oy)
            q = (ax + (bx - ax) * hi + ox, ay + (by - ay) * hi + oy)
            strips.append(((p[0], p[1], z0), (q[0], q[1], z0), (q[0], q[1], z1), (p[0], p[1], z1)))
            u0, u1 = float(key), key + across - 0.001
            uvs.append(((u0, floor + 0.001), (u1, floor + 0.001), (u1, floor + 0.999), (u0, floor + 0.999)))
    b.quads(_PANES, np.array(strips), np.array(uvs))
