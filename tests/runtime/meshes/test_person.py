"""People: a surface without cracks in any pose, human proportions, a telephone at the ear."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.library.blueprints import LIBRARY, Blueprint
from recipe_runtime.body import walk_cycle
from recipe_runtime.body.skeleton import Figure, part_names
from recipe_runtime.frames.portrait import matrices
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.mesh import Mesh

from tests.runtime.actors import actor

PEOPLE = [b for b in LIBRARY if b.category == "pedestrian"]


def skin_of(blueprint: Blueprint) -> Mesh:
    return actor_body(actor("it", blueprint)).parts[0][1]


def slot(mesh: Mesh, name: str) -> NDArray[np.float64]:
    """Return the vertices of the nearest version with a colour slot."""
    assert mesh.level is not None
    near = np.array([level.near == 0.0 for level in mesh.levels])[mesh.level]
    own = near & np.array([s.slot == name for s in mesh.surfaces])[mesh.surface]
    found: NDArray[np.float64] = mesh.vertices[np.unique(mesh.triangles[own])].astype(np.float64)
    return found


@pytest.mark.parametrize("blueprint", PEOPLE[:6], ids=lambda b: b.id)
def test_vertices_of_a_garment_at_one_place_stay_together(blueprint: Blueprint) -> None:
    """Sleeves do not come off the trunk, and trouser legs do not come off the hips, whatever the joints do."""
    mesh = skin_of(blueprint)
    assert mesh.skin is not None and mesh.level is not None
    weights = np.zeros((len(mesh.vertices), len(part_names(blueprint.shape))))
    for column in range(mesh.skin.parts.shape[1]):
        np.add.at(weights, (np.arange(len(weights)), mesh.skin.parts[:, column]), mesh.skin.weights[:, column])
    for name in ("shirt", "trousers"):
        for level in range(len(mesh.levels)):
            own = (mesh.level == level) & np.array([s.slot == name for s in mesh.surfaces])[mesh.surface]
            used = np.unique(mesh.triangles[own])
            _, place = np.unique(mesh.vertices[used], axis=0, return_inverse=True)
            place = place.reshape(-1)
            for part in range(weights.shape[1]):
                low, high = np.full(place.max() + 1, 255.0), np.zeros(place.max() + 1)
                np.minimum.at(low, place, weights[used, part])
                np.maximum.at(high, place, weights[used, part])
                assert (high - low).max() <= 1.0, (name, level, part)


@pytest.mark.parametrize("blueprint", PEOPLE, ids=lambda b: b.id)
def test_an_adults_head_is_a_seventh_of_the_height(blueprint: Blueprint) -> None:
    """Children's heads are larger, a fifth to a seventh."""
    height, skin = blueprint.shape["height"], slot(skin_of(blueprint), "skin")
    face = skin[(np.abs(skin[:, 1]) < 0.01) & (skin[:, 0] > 0.02 * height) & (skin[:, 2] > 0.75 * height)]
    chin = face[face[:, 0] > face[:, 0].max() - 0.035 * height][:, 2].min()
    least, most = (6.6, 8.2) if height > 1.55 else (4.6, 7.4)
    assert least < height / (height - chin) < most


def test_a_person_who_telephones_holds_the_hand_at_the_ear() -> None:
    (blueprint, *_) = [b for b in PEOPLE if b.shape["phone"]]
    figure = Figure.of(blueprint.shape)
    names, parts = part_names(blueprint.shape), matrices(walk_cycle.steady_pose(figure, 0.1, 1.4))
    arm, head = parts[names.index("forearm_right")], parts[names.index("head")]
    palm = arm[:, :3] @ np.array([0.0, 0.0, -0.21 * figure.height]) + arm[:, 3]
    ear = head[:, 3] + head[:, :3] @ (np.array([0.0, -0.05, 0.08]) * figure.height)
    assert np.linalg.norm(palm - ear) < 0.12
