"""Every shape that `plan_bounds` allows has a mesh with at most the number of triangles in its table."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir import plan_bounds
from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_compiler.ir.plan_bounds import KINDS
from recipe_compiler.library import blueprints
from recipe_runtime.meshes import actor_body, town_bodies


def number(span: plan_bounds.Range) -> st.SearchStrategy[float]:
    low, high = span
    if isinstance(low, int) and isinstance(high, int):
        return st.sampled_from((low, high)) | st.integers(low, high)
    return st.sampled_from((low, high)) | st.floats(low, high)


def triangles(kind: str, size: tuple[Any, ...], shape: dict[str, Any]) -> int:
    element = Element(name="one", kind=kind, pose=Pose(), size=size, shape=shape)
    assert list(plan_bounds.town_faults([element])) == []
    (body,) = town_bodies(TownPlan(name="one", elements=(element,)))
    return sum(len(mesh.triangles) for _, mesh in body.parts)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_every_allowed_element_has_a_mesh_of_bounded_size(kind: str, data: st.DataObject) -> None:
    row = KINDS[kind]
    size = data.draw(st.tuples(*map(number, row.size)))
    shape = data.draw(st.fixed_dictionaries({key: number(span) for key, span in row.shape.items()}))
    assert 0 < triangles(kind, size, shape) <= row.max_triangles


@pytest.mark.parametrize("kind", KINDS)
def test_the_largest_element_has_a_mesh_of_bounded_size(kind: str) -> None:
    row = KINDS[kind]
    size = tuple(span[1] for span in row.size)
    for style in range(6):
        largest = {key: min(style, high) if key in ("style", "face") else high for key, (_, high) in row.shape.items()}
        assert triangles(kind, size, largest) <= row.max_triangles
        flat = largest | ({"roof": 0} if "roof" in row.shape else {})
        assert triangles(kind, size, flat) <= row.max_triangles


@pytest.mark.slow
@pytest.mark.parametrize("blueprint", blueprints.LIBRARY, ids=lambda blueprint: blueprint.id)
@settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_every_allowed_actor_has_a_mesh(blueprint: blueprints.Blueprint, data: st.DataObject) -> None:
    actor, _ = blueprints.specimen(blueprint)
    spans = {k: v for k, v in plan_bounds.shape_of(actor.blueprint).items() if k != "body"}
    shape = data.draw(st.fixed_dictionaries({key: number(span) for key, span in spans.items()}))
    changed = actor.model_copy(update={"shape": {**actor.shape, **{key: float(v) for key, v in shape.items()}}})
    assert plan_bounds.actor_fault(changed) is None
    parts = [mesh for _, mesh in actor_body(changed).parts]
    skin = parts[0].skin  # the continuous surface of a person, which parts without a mesh move
    moved = set() if skin is None else set(skin.parts.reshape(-1).tolist())
    assert all(len(mesh.triangles) or number in moved for number, mesh in enumerate(parts))
