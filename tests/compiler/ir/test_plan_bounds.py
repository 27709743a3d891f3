"""Every compiled plan is within the tables of `plan_bounds`, and plans outside of them are refused."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir import plan_bounds
from recipe_compiler.ir.plan import Element, Pose
from recipe_compiler.ir.plan_bounds import KINDS
from recipe_compiler.ir.plan_types import MAX_ELEMENTS
from recipe_compiler.library import blueprints, towns
from recipe_compiler.library.towns import palettes

from tests.compiler.library.test_towns import extreme


def parameters(name: str) -> st.SearchStrategy[dict[str, Any]]:
    def one(parameter: towns.TownParameter) -> st.SearchStrategy[Any]:
        number = st.integers(parameter.low, parameter.high)
        if parameter.length is None:
            return number
        several = st.lists(number, min_size=parameter.length, max_size=parameter.length)
        return several.map(lambda values: tuple(sorted(values) if parameter.rising else values))

    return st.fixed_dictionaries({key: one(parameter) for key, parameter in towns.TOWNS[name].PARAMETERS.items()})


CASES = st.sampled_from(towns.NAMES).flatmap(lambda name: st.tuples(st.just(name), parameters(name)))


@pytest.mark.slow
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(CASES, st.integers(0, 2**32 - 1))
def test_every_town_is_within_the_tables(case: tuple[str, dict[str, Any]], seed: int) -> None:
    assert list(plan_bounds.town_faults(towns.build(case[0], seed, case[1]).plan.elements)) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", towns.NAMES)
def test_the_largest_town_is_within_the_tables(name: str) -> None:
    elements = towns.build(name, 3, extreme(name, largest=True)).plan.elements
    assert list(plan_bounds.town_faults(elements)) == []
    assert len(elements) <= MAX_ELEMENTS


def test_there_is_a_row_for_every_kind_and_no_other() -> None:
    assert set(KINDS) == set(palettes.PALETTES)


@pytest.mark.parametrize("blueprint", blueprints.LIBRARY, ids=lambda blueprint: blueprint.id)
def test_every_blueprint_is_within_the_tables(blueprint: blueprints.Blueprint) -> None:
    assert plan_bounds.actor_fault(blueprints.specimen(blueprint)[0]) is None


def middle(kind: str) -> Element:
    row = KINDS[kind]
    shape = {key: low if isinstance(low, int) else (low + high) / 2 for key, (low, high) in row.shape.items()}
    x, y, z = ((low + high) / 2 for low, high in row.size)
    return Element(name="one", kind=kind, pose=Pose(), size=(x, y, z), shape=shape)


@pytest.mark.parametrize("kind", KINDS)
def test_an_element_outside_the_bounds_of_its_kind_is_refused(kind: str) -> None:
    element, row = middle(kind), KINDS[kind]
    assert list(plan_bounds.town_faults([element])) == []
    for axis in range(3):
        size = tuple(90_000.0 if n == axis else value for n, value in enumerate(element.size))
        assert "its size along" in next(plan_bounds.town_faults([element.model_copy(update={"size": size})]))
    for key in row.shape:
        large = element.model_copy(update={"shape": {**element.shape, key: 1e9}})
        assert f"its {key} is 1e+09" in next(plan_bounds.town_faults([large]))
        without = {k: v for k, v in element.shape.items() if k != key}
        assert "its shape lacks" in next(plan_bounds.town_faults([element.model_copy(update={"shape": without})]))
    more = element.model_copy(update={"shape": {**element.shape, "storeys": 1.0}})
    assert "which no" in next(plan_bounds.town_faults([more]))
    assert "at most" in next(plan_bounds.town_faults([element] * (row.max_count + 1)))


def test_an_actor_of_another_shape_category_or_blueprint_is_refused() -> None:
    for blueprint in blueprints.LIBRARY:
        actor, _ = blueprints.specimen(blueprint)
        for key in actor.shape:
            changed = actor.model_copy(update={"shape": {**actor.shape, key: 1e9}})
            assert "is 1e+09" in (plan_bounds.actor_fault(changed) or "")
        assert "lacks" in (plan_bounds.actor_fault(actor.model_copy(update={"shape": {}})) or "")
        assert "is no" in (plan_bounds.actor_fault(actor.model_copy(update={"tag": 17})) or "")
        assert "there is no blueprint" in (plan_bounds.actor_fault(actor.model_copy(update={"blueprint": "x"})) or "")
