"""The compiler's surfaces for patches, which it computes without meshes, lie on the meshes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import Element, Pose, PropPlan
from recipe_compiler.library import blueprints, surfaces, towns
from recipe_compiler.library.surfaces import FlatSurface, WholeSurface
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.props import prop_bodies
from recipe_runtime.meshes.skin import split_parts
from recipe_runtime.meshes.town import _body

LEAST = {"sign": 0.6, "fence": 0.8}  # a sign's rectangle encloses its plate, and a fence has posts
Array = NDArray[np.float64]


@lru_cache(maxsize=1)
def elements() -> dict[str, Element]:
    """Return an element of each kind that has surfaces, from the towns."""
    found: dict[str, Element] = {}
    for name in towns.NAMES:
        for element in towns.build(name, 0, {}).plan.elements:
            if any(surfaces.element_surfaces(element)):
                found.setdefault(element.kind, element)
    return found


def covered(mesh: Mesh, surface: FlatSurface, slots: tuple[str, ...] = ()) -> float:
    """Return the fraction of a 9 x 9 grid on a surface at which the mesh has a triangle that can show a patch."""
    normal = np.cross(surface.down, surface.right)
    corners = mesh.vertices.astype(float)[mesh.triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1), 1e-12)[:, None]
    here = (face @ normal > 0.9) & (np.abs((corners - surface.origin) @ normal) <= surface.reach).all(axis=1)
    if slots:
        here &= np.array([mesh.surfaces[s].slot in slots for s in mesh.surface])
    flat = np.stack(
        [(corners[here] - surface.origin) @ surface.right, -(corners[here] - surface.origin) @ surface.down]
    )
    x, z = (np.linspace(a + 0.01, b - 0.01, 9) for a, b in (surface.x, surface.z))
    return float(np.mean([_inside(flat, u, v) for u in x for v in z]))


def _inside(flat: Array, u: float, v: float) -> bool:
    """Return whether a point is within each triangle [2, T, 3]."""
    (x, y), sides = flat, []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        sides.append((x[:, b] - x[:, a]) * (v - y[:, a]) - (y[:, b] - y[:, a]) * (u - x[:, a]))
    return bool((np.stack(sides) >= -1e-6).all(axis=0).any())


@pytest.mark.parametrize("kind", sorted(surfaces.KINDS))
def test_a_towns_surfaces_lie_on_its_meshes(kind: str) -> None:
    element = elements()[kind]
    mesh = _body(element).mesh("static")
    for surface in surfaces.element_surfaces(element):
        assert isinstance(surface, FlatSurface)
        share = covered(mesh, surface)
        assert share >= LEAST.get(kind, 0.97), (surface.name, share)


def test_a_boards_surfaces_are_its_sides_and_its_patch_fills_it() -> None:
    low, high = (-0.01, -1.0, 0.0), (0.01, 1.0, 1.5)
    board = PropPlan(
        name="patch.a", mesh=None, pose=Pose(x=3, y=4, z=1, yaw=40, pitch=10, roll=5), tag=20, low=low, high=high
    )
    front, back = surfaces.prop_surfaces(board)
    mesh = next(prop_bodies([board], Assets())).mesh("static")
    assert isinstance(front, FlatSurface) and isinstance(back, FlatSurface)
    assert covered(mesh, front) == covered(mesh, back) == 1.0
    face = front.face(*front.middle, *front.size)
    corners = mesh.vertices[mesh.triangles[mesh.surface == 0]].reshape(-1, 3)
    uvs = mesh.uvs[mesh.triangles[mesh.surface == 0]].reshape(-1, 2)
    for corner, uv in zip(face.corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        there = corners[(uvs == uv).all(axis=1)]  # as for an image on the board
        np.testing.assert_allclose(there, np.broadcast_to(corner, there.shape), atol=2e-6)


def bodies() -> Iterator[tuple[blueprints.Blueprint, Body]]:
    for blueprint in blueprints.LIBRARY:
        yield blueprint, actor_body(blueprints.specimen(blueprint)[0])


@pytest.mark.slow
def test_every_painted_triangle_lies_within_an_island() -> None:
    """For all blueprints: no two sides of a part share texels, and only mirrors lie outside the map."""
    for blueprint, body in bodies():
        whole = [s for s in surfaces.actor_surfaces(blueprints.specimen(blueprint)[0]) if isinstance(s, WholeSurface)]
        assert whole
        for surface in whole:
            parts = {face.part for _, face in surface.islands}
            for part, mesh in split_parts(body.parts):
                own = np.array([mesh.surfaces[s].slot in surface.slots for s in mesh.surface], bool)
                if part == "chassis" and surface.name == "shirt":
                    continue
                if not own.any():
                    continue
                assert part in parts, f"{blueprint.id}: {part} has {surface.slots}, but the map has no island of it"
                points = mesh.vertices[mesh.triangles[own]].reshape(-1, 3).astype(float)
                faces = [face for _, face in surface.islands if face.part == part]
                for face in faces:
                    offset = points - face.corner
                    u, v = offset @ face.right / face.width, offset @ face.down / face.height
                    assert np.abs(offset @ face.normal).max() <= face.reach
                    mirrors = 0.12 if surface.name == "body" and part == "chassis" else 0.0
                    assert u.min() >= -mirrors and u.max() <= 1 + mirrors, (blueprint.id, part, face)
                    assert v.min() >= -mirrors and v.max() <= 1 + mirrors, (blueprint.id, part, face)


def test_islands_do_not_overlap() -> None:
    for blueprint in blueprints.LIBRARY:
        for surface in surfaces.actor_surfaces(blueprints.specimen(blueprint)[0]):
            if not isinstance(surface, WholeSurface):
                continue
            regions = [face.region for _, face in surface.islands]
            for n, (a, b, c, d) in enumerate(regions):
                assert 0 <= a < c <= 1 and 0 <= b < d <= 1
                for e, f, g, h in regions[:n]:
                    assert c <= e or g <= a or d <= f or h <= b, blueprint.id
            for _, face in surface.islands:
                left, top, right, bottom = face.region
                texel = (right - left) * surface.aspect / face.width, (bottom - top) / face.height
                assert texel[0] == pytest.approx(texel[1], rel=1e-3), "texels are square"


def test_the_sides_of_a_vehicle_can_carry_a_rectangle() -> None:
    for blueprint, body in bodies():
        if blueprint.category != "vehicle" or "rider" in blueprint.shape:
            continue
        for surface in surfaces.actor_surfaces(blueprints.specimen(blueprint)[0]):
            if isinstance(surface, FlatSurface) and surface.name in ("left", "right"):
                assert covered(body.mesh("chassis"), surface) > 0.2, (blueprint.id, surface.name)
