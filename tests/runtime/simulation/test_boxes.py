"""Obstacles are grouped into one body in the engine; contacts still identify the obstacle that was hit."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir.plan import Clock, Element, Pose, ScenePlan, TownPlan
from recipe_runtime.simulation.boxes import Box, neighbourhoods
from recipe_runtime.simulation.loop import Simulation

from tests.runtime.simulation.test_collisions import actor, blind, run

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@given(
    places=st.lists(st.tuples(st.floats(-300, 300), st.floats(-300, 300)), max_size=90),
    most=st.integers(1, 16),
)
def test_every_box_is_in_one_group(places: list[tuple[float, float]], most: int) -> None:
    boxes = [Box(str(n), place, UPRIGHT, (1.0, 1.0)) for n, place in enumerate(places)]
    groups = list(neighbourhoods(boxes, most))
    assert Counter(box.name for group in groups for box in group) == Counter(box.name for box in boxes)
    assert all(0 < len(group) <= most for group in groups)
    assert len(groups) <= len(boxes) / most + len(boxes) ** 0.5 + 1  # few groups are not full


def test_boxes_near_each_other_share_a_group() -> None:
    """Groups of a grid of boxes are tiles, so that few of them are near an actor."""
    boxes = [Box(f"{i}/{j}", (10.0 * i, 10.0 * j), UPRIGHT, (1.0, 1.0)) for i in range(16) for j in range(16)]
    for group in neighbourhoods(boxes, 16):
        for axis in (0, 1):
            places = [box.place[axis] for box in group]
            assert max(places) - min(places) <= 40.0


@pytest.mark.parametrize(("yaw", "x", "y", "distance"), [(0, 3, 0, 1), (90, 3, 0, 2), (90, 0, 5, 3), (45, 0.5, 0.5, 0)])
def test_distance_of_a_rotated_box(yaw: int, x: float, y: float, distance: float) -> None:
    half = {0: UPRIGHT, 90: (0.0, 0.0, 0.5**0.5, 0.5**0.5), 45: (0.0, 0.0, 0.38268343236509, 0.92387953251129)}[yaw]
    assert Box("", (0.0, 0.0), half, (2.0, 1.0)).distance(x, y) == pytest.approx(distance)


def test_contacts_name_the_obstacle_that_was_hit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four cars drive at four of twenty walls side by side; each stops at its own, and the event names it."""
    walls = [
        Element(name=f"wall{k}", kind="wall", pose=Pose(x=12.0 + 0.5 * k, y=4.0 * k, yaw=180), size=(0.3, 3.8, 2.0))
        for k in range(20)
    ]
    cars = [actor(f"car{k}", "vehicle.sedan.a", Pose(y=4.0 * k), (60.0, 4.0 * k), speed=8.0) for k in (0, 7, 13, 19)]
    town = TownPlan(name="flat", elements=tuple(walls))
    made = Simulation(ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=town, actors=tuple(cars)))
    blind(monkeypatch, made)
    run(made, 6.0)
    events = made.contacts.events()
    assert {(event.first, event.second) for event in events} == {(f"wall{k}", f"car{k}") for k in (0, 7, 13, 19)}
    for agent, k in zip(made.agents, (0, 7, 13, 19), strict=True):
        assert agent.x + agent.reach == pytest.approx(12.0 + 0.5 * k, abs=0.8)
    made.close()
