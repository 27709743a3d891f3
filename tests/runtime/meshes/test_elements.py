"""Each kind of town element is a valid mesh of its declared size, with CARLA's tags and a colour for every slot."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_compiler.library.towns.palettes import PALETTES
from recipe_runtime.meshes import town_bodies
from recipe_runtime.meshes.mesh import Mesh, Pattern

from tests.runtime.meshes.test_meshes import check, face_normals

_BUILDING = {"floors": 4, "storey": 3.0, "ground": 4.0, "bays": 4, "shop": 1, "awning": 1, "left": 1, "right": 0}
_HOUSE = {"floors": 2, "storey": 2.7, "pitch": 0.7, "garage": 1, "porch": 1}
_GANTRY = {"lanes": 3, "lane": 3.6, "first": -4.0, "key": 5}


@dataclass(frozen=True)
class Kind:
    """A kind of element: size, permitted overhang (x, y, z), tags, maximum number of triangles, shape."""

    kind: str
    size: tuple[float, float, float]
    tags: frozenset[int]
    most: int
    shape: dict[str, float] = field(default_factory=dict)
    beyond: tuple[float, float, float] = (0.0, 0.0, 0.0)
    front: bool = False  # the origin is at the centre of its front, and the element extends to -x

    def __str__(self) -> str:
        return "-".join([self.kind, *(f"{k}{v:g}" for k, v in self.shape.items() if k in ("style", "roof", "species"))])


def kind(name: str, size: tuple[float, float, float], tags: set[int], most: int, **shape: float) -> Kind:
    return Kind(name, size, frozenset(tags), most, shape)


def building(style: int, roof: int) -> Kind:
    shape = {**_BUILDING, "style": style, "roof": roof, "key": 9}
    return Kind("building", (12, 13, 13), frozenset({3}), 1600, shape, (1.3, 0.5, 6), front=True)


def house(style: int, roof: int) -> Kind:
    shape = {**_HOUSE, "style": style, "roof": roof, "key": 3}
    return Kind("house", (8, 11, 5.4), frozenset({3}), 1400, shape, (1.6, 0.5, 5.2), front=True)


KINDS = [
    *(building(style, roof) for style in range(6) for roof in (0, 1)),
    *(house(style, roof) for style in range(3) for roof in range(3)),
    *(kind("fence", (0.1, 8, 1.2), {5}, 800, style=s) for s in range(3)),
    *(
        Kind("tree", (4, 4, 7), frozenset({9, 10}), 5800, {"trunk": 0.15, "species": s, "key": k}, (0.13, 0.13, 0.0))
        for s in range(5)
        for k in (1, 77)
    ),
    Kind("wall", (0.25, 9, 2.6), frozenset({4}), 60, {}, (0.07, 0, 0), True),
    Kind("lamp", (0.16, 0.16, 6.5), frozenset({6}), 150, {"arm": 1.6}, (2.1, 0.06, 0.06)),
    Kind("bench", (0.5, 1.6, 0.85), frozenset({20}), 140, {}, (0.03, 0.01, 0.01)),
    kind("bin", (0.42, 0.42, 0.95), {20}, 120),
    kind("hedge", (0.8, 10, 1.2), {9}, 1100, key=4),
    kind("bush", (1.4, 1.4, 1.1), {9}, 800, key=4),
    kind("planter", (1.2, 1.2, 0.9), {20, 9, 10}, 1000, key=4),
    Kind("bicycles", (1.9, 1.8, 1.1), frozenset({20}), 4500, {"key": 4}, (0.1, 0.1, 0.0)),
    Kind("board", (0.5, 0.62, 1.1), frozenset({20}), 500, {"key": 4}, (0.02, 0.02, 0.0)),
    Kind("cafe", (1.3, 1.8, 2.4), frozenset({20}), 700, {"key": 4}, (0.05, 0.05, 0.05)),
    Kind("delivery", (0.8, 1.2, 1.3), frozenset({20}), 200, {"key": 4}, (0.01, 0.05, 0.0)),
    Kind("letter_box", (0.4, 0.44, 1.3), frozenset({20}), 300, {}, (0.03, 0.03, 0.0)),
    kind("hydrant", (0.3, 0.3, 0.8), {20}, 300),
    kind("bollard", (0.2, 0.2, 0.9), {6}, 150),
    kind("fountain", (7, 7, 2.6), {20, 23}, 1000),
    kind("statue", (2, 2, 4.5), {20}, 800, key=4),
    Kind("kiosk", (2.5, 3, 2.8), frozenset({20}), 200, {"key": 4}, (0.0, 0.02, 0.0)),
    kind("bus_stop", (1.6, 4, 2.6), {20}, 400),
    kind("billboard", (0.5, 6, 6), {6, 20}, 100, key=4),
    *(
        Kind("sign", (0.1, 0.6, 2.6), frozenset({6, 8}), 260, {"face": f, "value": 80}, (0.02, 0, 0)) for f in range(7)
    ),
    *(
        Kind("traffic_light", (0.26, 0.26, 5.6), frozenset({6, 7}), 280, {"arm": a, "go": g}, (0.35, a + 0.3, 0.4))
        for a, g in ((0.0, 1), (2.0, 0))
    ),
    *(
        Kind("gantry", (0.9, 14.0, 7.4), frozenset({6, 8}), 900, {**_GANTRY, "exit": x}, (0.3, 0.3, 0.5))
        for x in (0, 1)
    ),
    kind("guardrail", (0.4, 48.0, 0.8), {28}, 500, double=1),
    *(kind("tower", (20, 30, 45), {3}, 100, key=k) for k in (4, 5, 6, 7)),
]  # fmt: skip


def mesh_of(k: Kind) -> Mesh:
    element = Element(name="it", kind=k.kind, pose=Pose(), size=k.size, shape=k.shape)
    return town_bodies(TownPlan(name="t", elements=(element,)))[0].mesh("static")


@pytest.mark.parametrize("k", KINDS, ids=str)
def test_the_mesh_of_a_kind_is_valid(k: Kind) -> None:
    mesh = mesh_of(k)
    assert 0 < len(mesh.triangles) <= k.most
    check(mesh)
    assert {s.tag for s in mesh.surfaces} == k.tags
    assert {s.slot for s in mesh.surfaces} <= set(PALETTES[k.kind])


@pytest.mark.parametrize("k", KINDS, ids=str)
def test_a_kind_has_its_declared_size(k: Kind) -> None:
    mesh = mesh_of(k)
    x, y, z = k.size
    low = np.array([-x if k.front else -x / 2, -y / 2, 0.0])
    high = np.array([0.0 if k.front else x / 2, y / 2, z])
    beyond = np.array(k.beyond) + 1e-4
    foot = np.array([0.61, 0.61, 0.1]) if k.kind == "tree" else np.array([0.0, 0.0, 1e-4])  # its pit
    points = mesh.vertices.astype(np.float64)
    assert (points >= np.minimum(low - beyond, -foot)).all()
    assert (points <= np.maximum(high + beyond, foot)).all()
    assert (points.max(0) - points.min(0) >= 0.8 * np.array(k.size)).all()


@pytest.mark.parametrize("k", KINDS, ids=str)
def test_the_faces_of_a_kind_point_outwards(k: Kind) -> None:
    """Faces are counter-clockwise: their normals agree with those of their vertices, except for leaves."""
    mesh = mesh_of(k)
    face = face_normals(mesh)
    leaves = np.array([s.pattern == Pattern.FOLIAGE for s in mesh.surfaces])[mesh.surface]
    solid = ~leaves & ((face**2).sum(1) > 1e-12)
    facing = (face * mesh.normals[mesh.triangles[:, 0]].astype(np.float64)).sum(1)
    assert (facing[solid] > 0).all()


@pytest.mark.parametrize("k", KINDS, ids=str)
def test_a_kind_is_closed_from_outside(k: Kind) -> None:
    """Horizontal and downward rays from outside hit a front face first, except at slits beside thin mouldings."""
    mesh = mesh_of(k)
    leaves = np.array([s.pattern == Pattern.FOLIAGE for s in mesh.surfaces])[mesh.surface]
    corners = mesh.vertices.astype(np.float64)[mesh.triangles[~leaves]]
    if not len(corners):
        return
    random = np.random.Generator(np.random.Philox(5))
    low, high = (f(mesh.vertices.astype(np.float64), axis=0) for f in (np.min, np.max))
    met = [_first_face(corners, low + (high - low) * random.random(3), _downward(random)) for _ in range(150)]
    seen = [facing for facing in met if facing is not None]
    assert len(seen) > 0
    assert seen.count(False) <= 0.02 * len(seen)


def _downward(random: np.random.Generator) -> NDArray[np.float64]:
    angle, up = random.random() * 2 * np.pi, random.random() * 0.9
    flat = np.sqrt(1 - up * up)
    return np.array([-np.cos(angle) * flat, -np.sin(angle) * flat, -up])


def _first_face(corners: NDArray[np.float64], target: NDArray[np.float64], way: NDArray[np.float64]) -> bool | None:
    """Return whether the first triangle on a ray is a front face; None if the ray hits nothing."""
    eye = target - 200.0 * way
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(way, v)
    volume = (u * p).sum(1)
    solid = np.abs(volume) > 1e-12
    inverse = np.where(solid, 1.0, 0.0) / np.where(solid, volume, 1.0)
    s = eye - corners[:, 0]
    q = np.cross(s, u)
    a, b, far = (s * p).sum(1) * inverse, (way * q).sum(1) * inverse, (v * q).sum(1) * inverse
    hit = solid & (a >= 0) & (b >= 0) & (a + b <= 1)
    if not hit.any():
        return None
    first = hit & (far < far[hit].min() + 1e-4)
    return bool((volume[first] > 0).any())
