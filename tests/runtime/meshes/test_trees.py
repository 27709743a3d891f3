"""Crowns of trees: gaps, levels of detail, and the light that each leaf receives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_runtime.meshes import town_bodies
from recipe_runtime.meshes.mesh import Mesh
from recipe_runtime.meshes.trees import SPECIES


def grown(species: int, key: int = 1) -> Mesh:
    shape = {"trunk": 0.18, "key": float(key), "species": float(species)}
    element = Element(name="it", kind="tree", pose=Pose(), size=(4.4, 4.4, 8.0), shape=shape)
    return town_bodies(TownPlan(name="t", elements=(element,)))[0].mesh("static")


def level_of(mesh: Mesh, level: int) -> NDArray[np.float64]:
    """Return the corners [T, 3, 3] of a level's leaves."""
    assert mesh.level is not None
    leaves = np.array([s.slot == "leaves" for s in mesh.surfaces])[mesh.surface]
    corners: NDArray[np.float64] = mesh.vertices.astype(np.float64)[mesh.triangles[(mesh.level == level) & leaves]]
    return corners


@pytest.mark.parametrize("species", range(len(SPECIES)))
def test_a_crown_has_gaps_but_is_no_skeleton(species: int) -> None:
    """Of parallel rays through the crown's outline, some pass and most meet a leaf."""
    corners = level_of(grown(species), 1)
    y, z = (g.reshape(-1) for g in np.meshgrid(np.linspace(-1.4, 1.4, 29), np.linspace(3.0, 7.4, 45)))
    inside = np.zeros(len(y), bool)
    for a, b, c in corners[:, :, 1:]:
        signs = [(q[0] - p[0]) * (z - p[1]) - (q[1] - p[1]) * (y - p[0]) for p, q in ((a, b), (b, c), (c, a))]
        inside |= np.all(np.array(signs) > 0, axis=0) | np.all(np.array(signs) < 0, axis=0)
    assert 0.35 < inside.mean() < 0.99


@pytest.mark.parametrize("species", range(len(SPECIES)))
def test_levels_follow_each_other_and_get_coarser(species: int) -> None:
    mesh = grown(species)
    assert [level.near for level in mesh.levels] == [0.0, *(level.far for level in mesh.levels[:-1])]
    assert [level.casts for level in mesh.levels].count(True) == 1
    counts = [len(level_of(mesh, n)) for n in range(len(mesh.levels))]
    assert counts[0] > 1.5 * counts[1] > 2.0 * counts[2]


def test_the_inside_of_a_crown_is_darker_than_its_top() -> None:
    mesh = grown(0)
    leaves = np.unique(mesh.triangles[np.array([s.slot == "leaves" for s in mesh.surfaces])[mesh.surface]])
    points, sky = mesh.vertices[leaves], mesh.uvs[leaves, 1]
    inner = (np.abs(points[:, :2]) < 0.5).all(axis=1) & (np.abs(points[:, 2] - 4.8) < 0.6)
    assert sky[points[:, 2] > 7.0].mean() > 1.4 * sky[inner].mean()


def test_trees_differ_by_their_key() -> None:
    assert not np.array_equal(grown(0, 1).vertices, grown(0, 2).vertices)
