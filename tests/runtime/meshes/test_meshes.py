"""Meshes: valid triangles, colours for every slot, parts in the order of the Trace, reproducible bytes."""

from __future__ import annotations

import hashlib
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ActorPlan, Element, Pose, TownPlan
from recipe_compiler.ir.semantic_tags import Tag
from recipe_compiler.library import towns
from recipe_compiler.library.blueprints import LIBRARY, Blueprint
from recipe_runtime.body.skeleton import part_names
from recipe_runtime.frames.portrait import matrices, stance
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.meshes import town as town_module
from recipe_runtime.meshes.builder import Builder, icosphere, noise, noises
from recipe_runtime.meshes.merging import distinct
from recipe_runtime.meshes.mesh import NO_MESH, Body, Mesh, Pattern, Surface
from recipe_runtime.meshes.skin import BodyVertices
from recipe_runtime.meshes.smoothing import Sheet, flatten
from recipe_runtime.meshes.vectors import cross, unit

from tests.runtime.actors import actor

TOWN = towns.build("downtown", 0, {"blocks": [1, 1]})


@cache
def bodies_of_town() -> tuple[Body, ...]:
    return town_bodies(TOWN.plan)


def plan(blueprint: Blueprint) -> ActorPlan:
    return actor("someone", blueprint, instance=3, speed=1.0)


def check(mesh: Mesh) -> None:
    assert [a.dtype for a in (mesh.vertices, mesh.normals, mesh.uvs)] == [np.float32] * 3
    assert mesh.triangles.dtype == mesh.surface.dtype == np.int32
    assert len(mesh.triangles) == len(mesh.surface) > 0
    assert 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.vertices)
    assert set(mesh.surface.tolist()) == set(range(len(mesh.surfaces)))
    assert np.isfinite(mesh.vertices).all() and np.isfinite(mesh.uvs).all()
    length = np.sqrt((mesh.normals.astype(np.float64) ** 2).sum(1))
    assert np.abs(length - 1).max() < 1e-5


def seen(mesh: Mesh, distance: float) -> int:
    """Return the number of triangles that a camera sees at a distance."""
    if mesh.level is None:
        return len(mesh.triangles)
    shown = np.array([*(level.near <= distance < level.far for level in mesh.levels), True])
    return int(shown[mesh.level].sum())


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a).astype(np.float64, copy=False)


def test_the_last_town_is_cached_unless_it_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """The scenes of a sweep over actors share the meshes of their town."""
    element = Element(name="bench", kind="bench", pose=Pose(), size=(1.6, 0.6, 0.9))
    town = TownPlan(name="one", elements=(element,))
    kept = town_bodies(town)
    assert town_bodies(TownPlan.model_validate(town.model_dump())) is kept
    moved = town.model_copy(update={"elements": (element.model_copy(update={"pose": Pose(x=1.0)}),)})
    assert digest(town_bodies(moved)) != digest(kept)
    again = town_bodies(town)
    assert again is not kept and digest(again) == digest(kept)
    monkeypatch.setattr(town_module, "_KEPT_ELEMENTS", 0)
    assert town_bodies(town) is not town_bodies(town)


def digest(bodies: tuple[Body, ...]) -> str:
    sha = hashlib.sha256()
    for body in bodies:
        for name, mesh in body.parts:
            sha.update(name.encode())
            for array in (mesh.vertices, mesh.normals, mesh.uvs, mesh.triangles, mesh.surface):
                sha.update(array.tobytes())
    return sha.hexdigest()


@pytest.mark.parametrize("blueprint", LIBRARY, ids=lambda b: b.id)
def test_actors(blueprint: Blueprint) -> None:
    body = actor_body(plan(blueprint))
    assert body.instance == blueprint.tag * 1000 + 3
    assert digest((body,)) == digest((actor_body(plan(blueprint)),))
    assert tuple(name for name, _ in body.parts) == part_names(blueprint.shape)
    ridden = blueprint.attributes.get("number_of_wheels") == "2"
    for _, mesh in body.parts:
        if mesh is NO_MESH:
            continue
        check(mesh)
        assert {s.slot for s in mesh.surfaces} <= set(blueprint.palette)
        flipped = (face_normals(mesh) * mesh.normals[mesh.triangles[:, 0]]).sum(1) < 0
        assert flipped.mean() < 0.02
    tags = {s.tag for _, mesh in body.parts for s in mesh.surfaces}
    assert tags == ({blueprint.tag, 13} if ridden else {blueprint.tag})
    near, far = (18_000, 10_000) if ridden else (12_000, 7000) if blueprint.category == "vehicle" else (11_000, 2500)
    assert sum(seen(mesh, 0.0) for _, mesh in body.parts) < near
    assert sum(seen(mesh, 100.0) for _, mesh in body.parts) < far


@pytest.mark.parametrize("blueprint", LIBRARY, ids=lambda b: b.id)
def test_actors_have_their_size_and_stand_on_the_ground(blueprint: Blueprint) -> None:
    actor = plan(blueprint).model_copy(update={"speed": 0.0})
    parts = matrices(stance(actor))
    points = BodyVertices.of(actor_body(actor).parts).placed(parts)
    low, high = points.min(1), points.max(1)
    assert abs(low[2]) < 0.01
    assert high[2] == pytest.approx(blueprint.shape["height"], abs=0.03)
    if blueprint.category == "vehicle":
        assert high[0] - low[0] == pytest.approx(blueprint.shape["length"], abs=0.13)  # bumpers and number plates
        assert high[1] - low[1] == pytest.approx(blueprint.shape["width"], abs=0.45)  # mirrors


def test_vehicles_carry_headlights() -> None:
    chassis = actor_body(plan(next(b for b in LIBRARY if b.id == "vehicle.sedan.a"))).mesh("chassis")
    assert len(chassis.lights) == 2
    assert all(light.direction[0] > 0.9 and light.position[0] > 2 for light in chassis.lights)


@pytest.mark.slow
@pytest.mark.parametrize("name", towns.NAMES)
def test_every_town_has_valid_meshes_and_a_budget(name: str) -> None:
    town = towns.build(name, 0, {})
    bodies = town_bodies(town.plan)
    assert [body.name for body in bodies] == [e.name for e in town.plan.elements]
    assert sum(len(body.mesh("static").triangles) for body in bodies) < 1_300_000
    for body in bodies:
        assert body.instance == 0 and [part for part, _ in body.parts] == ["static"]
        check(body.mesh("static"))
        surfaces = body.mesh("static").surfaces
        assert {s.tag for s in surfaces} <= set(Tag)
        assert {s.slot for s in surfaces} <= set(town.looks[body.name])
    town_bodies(TownPlan(name="other", elements=()))  # otherwise the cached town would be compared with itself
    assert digest(bodies) == digest(town_bodies(town.plan))


def test_street_normals_point_up_and_lamps_shine_down() -> None:
    for element, body in zip(TOWN.plan.elements, bodies_of_town(), strict=True):
        mesh = body.mesh("static")
        if element.kind in ("road", "junction", "ground"):
            assert (face_normals(mesh)[:, 2] > 0).all()
        if element.kind == "lamp":
            assert [light.direction for light in mesh.lights] == [(0.0, 0.0, -1.0)]


def test_each_window_pane_has_a_number() -> None:
    """The integer part of uv is constant within a pane and differs between the panes of a building."""
    for element, body in zip(TOWN.plan.elements, bodies_of_town(), strict=True):
        if element.kind != "building" or element.shape["style"] == 4:  # a glass facade
            continue
        mesh = body.mesh("static")
        panes = [n for n, s in enumerate(mesh.surfaces) if s.pattern == Pattern.WINDOW and s.slot == "window"]
        names = np.floor(mesh.uvs[mesh.triangles[np.isin(mesh.surface, panes)]])
        assert (names == names[:, :1]).all()
        assert len(np.unique(names[:, 0], axis=0)) > 5


def test_smooth_normals_of_a_sphere_point_outwards() -> None:
    points, faces = icosphere(2)
    builder = Builder()
    builder.smooth(Surface("a", Pattern.PLAIN, 1), points, faces, crease=0.5)
    mesh = builder.mesh()
    assert np.abs(mesh.normals - mesh.vertices).max() < 0.05


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32 - 1),
    crease=st.sampled_from([-1.0, 0.3, 0.9]),
    hole=st.integers(0, 7),
    copies=st.integers(1, 3),
)
@settings(max_examples=30, deadline=None)
def test_corner_normals_are_the_sums_of_the_faces_around_a_corner(
    seed: int, crease: float, hole: int, copies: int
) -> None:
    """The normals of sheets computed together equal, bit for bit, those of a loop over each sheet alone."""
    rng = np.random.default_rng(seed)
    points = np.round(rng.integers(-3, 4, (3, 4, 3)) * 0.25, 6)
    surface = Surface("a", Pattern.PLAIN, 1)
    cells: list[list[Surface | None]] = [[surface] * 4 for _ in range(2)]
    cells[hole // 4][hole % 4] = None
    builder = Builder()
    for _ in range(copies):
        builder.grid(cells, points, crease=crease)
    flat = flatten([sheet for sheet in builder._pending if isinstance(sheet, Sheet)])
    expected = _shaded_by_a_loop(points.reshape(-1, 3), crease, hole)
    assert flat.normals.tolist() == expected * copies  # (-0.0 == 0.0: a mesh stores no sign of zero)


def _shaded_by_a_loop(points: NDArray[np.float64], crease: float, hole: int) -> list[list[list[float]]]:
    """Corner normals of the triangles of a closed grid of 3 rings of 4 points, without those of one cell."""
    quads = [
        (4 * r + c, 4 * r + (c + 1) % 4, 4 * r + 4 + (c + 1) % 4, 4 * r + 4 + c) for r in range(2) for c in range(4)
    ]
    named = [(cell, t) for cell, (a, b, c, d) in enumerate(quads) for t in ((a, b, c), (a, c, d))]
    faces = []
    for cell, triangle in named:
        p = [points[k] for k in triangle]
        normal = cross((p[1] - p[0])[None], (p[2] - p[0])[None])[0]
        if np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) > 1e-10:
            faces.append((cell, [tuple(v) for v in p], normal, unit(normal[None])[0]))
    found = []
    for cell, corners, _, mine in faces:
        row = []
        for corner in corners:
            total = np.zeros(3)
            for _, around, normal, direction in faces:
                near = mine[0] * direction[0] + mine[1] * direction[1] + mine[2] * direction[2] >= crease
                if near or direction is mine:
                    for _ in range(around.count(corner)):
                        total = total + normal
            row.append(unit(total[None])[0].tolist())
        if cell != hole:
            found.append(row)
    return found


@pytest.mark.slow
@given(st.lists(st.integers(0, 3), min_size=1, max_size=40))
def test_equal_vertices_are_numbered_in_their_order(kinds: list[int]) -> None:
    first, which = distinct(
        np.array([[kind, 1, 2, 3, 4, 5, 6, kind % 2] for kind in kinds], np.float32), None, [np.arange(len(kinds))]
    )
    order = list(dict.fromkeys(kinds))
    assert first.tolist() == [kinds.index(kind) for kind in order]
    assert which.tolist() == [order.index(kind) for kind in kinds]


@pytest.mark.slow
@given(st.integers(0, 2**40), st.lists(st.integers(0, 2**40), min_size=1))
def test_the_array_noise_equals_the_scalar_noise(key: int, indices: list[int]) -> None:
    assert noises(key, np.array(indices)).tolist() == [noise(key, index) for index in indices]
