"""Fronts of cars and loads of trucks: what tells one make from another."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.library import blueprints
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.vehicle import shell_of

_CARS = [
    b
    for b in blueprints.LIBRARY
    if b.attributes.get("number_of_wheels") == "4" and b.attributes["base_type"] in ("car", "van")
]
_TRUCKS = [b for b in blueprints.LIBRARY if b.attributes.get("base_type") == "truck"]


def test_no_two_models_share_a_face() -> None:
    """All cars once had one grille and one pair of lamps; a taxi is a sedan with a sign."""
    faces = {}
    for car in _CARS:
        style = shell_of(car.shape).style
        faces[car.id] = style.front, style.lamps, style.tail
    faces.pop("vehicle.sedan.taxi")
    assert len(set(faces.values())) == len(faces)


@pytest.mark.parametrize("car", _CARS, ids=lambda b: b.id)
def test_the_grille_is_an_opening_of_the_nose(car: blueprints.Blueprint) -> None:
    """Near by and far away, the nose is dark within the grille, or nothing distinguishes a front from a rear."""
    style, mesh = shell_of(car.shape).style, actor_body(blueprints.specimen(car)[0]).mesh("chassis")
    low, high, half = style.front.grille
    dark = [k for k, surface in enumerate(mesh.surfaces) if surface.slot == "trim"]
    middles = mesh.vertices[mesh.triangles].mean(axis=1)
    shell = shell_of(car.shape)
    bottom, top = (shell.flank(0.999, share)[1] for share in (low, high))
    inside = (middles[:, 0] > 0.46 * shell.length) & (middles[:, 2] > bottom) & (middles[:, 2] < top)
    inside &= np.abs(middles[:, 1]) < half * shell.half
    assert (inside & np.isin(mesh.surface, dark)).sum() >= 4


@pytest.mark.parametrize("truck", _TRUCKS, ids=lambda b: b.id)
def test_a_load_has_its_own_colour_behind_the_cab(truck: blueprints.Blueprint) -> None:
    mesh = actor_body(blueprints.specimen(truck)[0]).mesh("chassis")
    slots = {surface.slot: k for k, surface in enumerate(mesh.surfaces)}
    x = {slot: mesh.vertices[mesh.triangles[mesh.surface == slots[slot]]][..., 0] for slot in ("cargo", "paint")}
    assert x["cargo"].max() < x["paint"].min() + 0.2
