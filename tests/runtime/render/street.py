"""A small street without a town: ground, walls, boxes and balls, made of plain triangles for the renderer's tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.canonical import digest_array
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, Pose, Sun, Weather
from recipe_compiler.library.weather import preset
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.mesh import Body, Light, Mesh, Pattern, Surface
from recipe_runtime.render.renderer import Renderer

Colours = dict[str, dict[str, str]]  # by body and slot

_AXES = ((0, 1, 2), (1, 2, 0), (2, 0, 1))


def quad(corners: ArrayLike, uvs: ArrayLike, surface: Surface) -> Mesh:
    """A flat quadrilateral; corners counter-clockwise seen from outside."""
    c = np.array(corners, np.float32)
    u, v = (c[1] - c[0]).astype(float), (c[3] - c[0]).astype(float)
    n = np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])
    n = n / np.sqrt((n * n).sum())
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normals = np.repeat(n[None], 4, 0).astype(np.float32)
    return Mesh(c, normals, np.array(uvs, np.float32), triangles, np.zeros(2, np.int32), (surface,))


def ground(size: float, surface: Surface, z: float = 0.0, x: float = 0.0, y: float = 0.0) -> Mesh:
    """A square of ground, uv in metres."""
    corners = [[x - size, y - size, z], [x + size, y - size, z], [x + size, y + size, z], [x - size, y + size, z]]
    return quad(corners, [c[:2] for c in corners], surface)


def box(low: ArrayLike, high: ArrayLike, surface: Surface, lights: tuple[Light, ...] = ()) -> Mesh:
    """An axis-aligned box with hard edges, uv in metres."""
    vertices: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    uvs: list[list[float]] = []
    triangles: list[list[int]] = []
    ends = np.array(low, float), np.array(high, float)
    for a, b, c in _AXES:
        for side, value in zip((-1.0, 1.0), ends, strict=True):
            first = len(vertices)
            for s, t in ((0, 0), (1, 0), (1, 1), (0, 1)):
                p = np.zeros(3)
                p[a], p[b], p[c] = value[a], ends[s][b], ends[t][c]
                vertices.append(p)
                normals.append(np.eye(3)[a] * side)
                uvs.append([p[1] if a == 0 else p[0], p[2] if a != 2 else p[1]])
            face = [[0, 1, 2], [0, 2, 3]] if side > 0 else [[0, 2, 1], [0, 3, 2]]
            triangles += [[first + i for i in t] for t in face]
    return Mesh(
        np.array(vertices, np.float32),
        np.array(normals, np.float32),
        np.array(uvs, np.float32),
        np.array(triangles, np.int32),
        np.zeros(len(triangles), np.int32),
        (surface,),
        lights,
    )


def ball(radius: float, surface: Surface, rings: int = 24, centre: Sequence[float] = (0.0, 0.0, 0.0)) -> Mesh:
    """A ball of latitude rings."""
    points, triangles = [], []
    around = 2 * rings
    for i in range(rings + 1):
        sp, cp = exact.sin_cos_deg(180.0 * i / rings)
        for j in range(around):
            st, ct = exact.sin_cos_deg(360.0 * j / around)
            points.append([sp * ct, sp * st, cp])
    for i in range(rings):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = a + around, b + around
            triangles += [[a, c, d], [a, d, b]]
    n = np.array(points)
    triangles = [t for k, t in enumerate(triangles) if not (k < 2 * around and k % 2 == 1)]
    vertices = (n * radius + np.array(centre)).astype(np.float32)
    faces = np.array(triangles, np.int32)
    return Mesh(
        vertices, n.astype(np.float32), n[:, :2].astype(np.float32), faces, np.zeros(len(faces), np.int32), (surface,)
    )


ROAD = Surface("asphalt", Pattern.ASPHALT, 1)
LINE = Surface("paint", Pattern.ROAD_PAINT, 24)
PAVING = Surface("slabs", Pattern.SLABS, 2)
BRICKS = Surface("wall", Pattern.BRICK, 3)
PANES = Surface("window", Pattern.WINDOW, 3)
LEAVES = Surface("leaves", Pattern.FOLIAGE, 9)
CLOTH = Surface("shirt", Pattern.CLOTH, 12)
PAINT = Surface("paint", Pattern.CAR_PAINT, 14)
BULB = Surface("lamp", Pattern.LAMP, 6)


def street() -> list[Body]:
    """A street with a wall of windows, a tree, a lamp, a walker and a car."""
    lamp = Light((4.0, 3.6, 4.4), (0.0, 0.0, -1.0), (1.0, 0.8, 0.55), 220.0, 0.4)
    panes = quad([[20, 6, 1], [2, 6, 1], [2, 6, 5], [20, 6, 5]], [[9, 0], [0, 0], [0, 2], [9, 2]], PANES)
    parts = [
        ("road", ground(60, ROAD)),
        ("line", quad([[0, -0.1, 0.01], [40, -0.1, 0.01], [40, 0.1, 0.01], [0, 0.1, 0.01]], [[0, 0]] * 4, LINE)),
        ("paving", box([-20, 3, 0], [40, 6, 0.14], PAVING)),
        ("wall", box([0, 6.02, 0], [30, 9, 8], BRICKS)),
        ("panes", panes),
        ("crown", ball(1.3, LEAVES, 10, (11.0, 4.2, 3.4))),
        ("trunk", box([10.9, 4.1, 0.1], [11.1, 4.3, 2.6], Surface("bark", Pattern.BARK, 9))),
        ("pole", box([3.95, 3.55, 0.1], [4.05, 3.65, 4.5], Surface("pole", Pattern.METAL, 6), (lamp,))),
        ("bulb", box([3.85, 3.45, 4.5], [4.15, 3.75, 4.6], BULB)),
    ]
    walker = Body("hero", 12001, (("body", box([-0.2, -0.25, 0.0], [0.2, 0.25, 1.7], CLOTH)),))
    beam = Light((2.0, 0.6, 0.6), (1.0, 0.0, -0.1), (1.0, 0.95, 0.85), 900.0, 0.9)
    car = Body("car", 14001, (("body", box([-2, -0.85, 0.25], [2, 0.85, 1.4], PAINT, (beam,))),))
    return [*(Body(name, 0, (("base", mesh),)) for name, mesh in parts), walker, car]


def parts_at(frame: int = 0) -> Array:
    """Return the transforms of the walker and the car at a frame."""
    return np.stack(
        [from_pose(Pose(x=7.0, y=2.0 - 0.1 * frame, yaw=20)), from_pose(Pose(x=12.0 - 0.2 * frame, y=-2.0, yaw=170))]
    )


CAMERA = CameraPlan(width=96, height=64, fov=80)
EYE = from_pose(Pose(x=0.0, y=-1.0, z=1.7, yaw=8, pitch=4))

LOOKS = {
    "road": {"asphalt": "#4a4a4c"},
    "line": {"paint": "#e8e8e4"},
    "paving": {"slabs": "#a09a90"},
    "wall": {"wall": "#8a4f3c"},
    "panes": {"window": "#d8d4cc"},
    "crown": {"leaves": "#4c6b2c"},
    "trunk": {"bark": "#5a4634"},
    "pole": {"pole": "#3a4044"},
    "bulb": {"lamp": "#ffd8a0"},
    "hero": {"shirt": "#b03030"},
    "car": {"paint": "#1f4f9a"},
}

_CLEAR = {name: value for name, value in preset("ClearNoon").items() if name in Weather.model_fields}


def appearance(
    altitude: float = 45.0, azimuth: float = 250.0, looks: Colours | None = None, **weather: float
) -> AppearancePlan:
    """Return an appearance of the street: clear noon, changed by the given parameters."""
    return AppearancePlan(
        seed=3,
        weather=Weather(**{**_CLEAR, **weather}),
        sun=Sun(azimuth=azimuth, altitude=altitude),
        looks=looks or LOOKS,
        responses={"street": CameraResponse()},
    )


WEATHERS = {
    "noon": appearance(60.0),
    "sunny": appearance(10.0),
    "rainy": appearance(45.0, cloudiness=60, precipitation=60, precipitation_deposits=60, wind_intensity=60),
    "foggy": appearance(45.0, fog_density=100, fog_distance=1),
    "night": appearance(-40.0),
}


def golden_pictures() -> dict[str, NDArray[np.uint8]]:
    """The street in five weathers, 96 x 64."""
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    return {name: renderer.shade(seen, weather, "street", 7, 7 / 30) for name, weather in WEATHERS.items()}


def golden_digests() -> dict[str, str]:
    """Digests of the street's labels and of its pictures in five weathers."""
    seen = Renderer(street()).observe(CAMERA, EYE, parts_at())
    arrays: dict[str, NDArray[np.generic]] = {
        "depth": seen.depth,
        "instance": seen.instance,
        "semantic": seen.semantic,
        **golden_pictures(),
    }
    return {name: digest_array(f"golden/{name}", array) for name, array in arrays.items()}
