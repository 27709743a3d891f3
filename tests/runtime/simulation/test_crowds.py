"""Dense crowds on a pavement: nobody is stuck, walks into the road, or is pushed away from its goal."""

from __future__ import annotations

import random

import numpy as np
import pytest
from recipe_compiler.ir.plan import ActorPlan
from recipe_runtime.simulation.walking.route import Route

from tests.runtime.simulation.test_walking import FPS, Way, moved, speeds, track, walker

FRONT, KERB = -9.0, -3.0  # x of the house front and of the kerb, metres


def crowd(count: int, metres: float, beyond: float, seed: int) -> list[ActorPlan]:
    """People in six columns on some metres of pavement, who walk in both directions and stop close to each other."""
    draw, rows = random.Random(seed), -(-count // 6)
    actors = []
    for n in range(count):
        x, y = -8.4 + 0.9 * (n % 6), metres * (n // 6 / (rows - 1) - 0.5)
        way = 1.0 if draw.random() < 0.5 else -1.0
        goal = draw.uniform(-8.4, -4.6), way * (metres / 2 + beyond + draw.uniform(-2.0, 2.0))
        actors.append(walker(f"p{n}", ((x + draw.uniform(-0.08, 0.08), y), goal)))
    return actors


@pytest.mark.slow
def test_a_crowd_in_both_directions_flows() -> None:
    """Of a hundred people on twenty metres, a fifth stood at the house front, and some walked on the road."""
    people = crowd(36, 6.0, 3.5, seed=2)
    trace = moved(*people, seconds=28.0)
    tracks = np.stack([track(trace, actor.name) for actor in people], axis=1)
    assert tracks[..., 0].min() > FRONT and tracks[..., 0].max() < KERB
    apart = np.linalg.norm(tracks[:, :, None] - tracks[:, None], axis=-1) + 9.0 * np.eye(len(people))
    assert apart.min() > 2 * 0.13 * 1.6 - 0.05
    for n, actor in enumerate(people):
        left = np.hypot(*(tracks[:, n] - (actor.route[-1].x, actor.route[-1].y)).T)
        stands = (speeds(trace, actor.name) < 0.1) & (left > 1.5)
        longest = max(map(len, "".join(".#"[int(s)] for s in stands).split(".")))
        assert longest / FPS < 10.0 and left.min() < 1.5, actor.name
        assert speeds(trace, actor.name).max() < 1.5


@pytest.mark.slow
def test_people_who_stand_side_by_side_make_way_and_return() -> None:
    """A row of people at their goals was a wall, which ended the walk of all others."""
    row = [walker(f"row{n}", ((-8.6 + 0.6 * n, -0.5), (-8.6 + 0.6 * n, 0.0))) for n in range(10)]
    trace = moved(*row, walker("hero", ((-6.0, -7.0), (-6.0, 7.0))), seconds=24.0)
    assert track(trace, "hero")[-1] == pytest.approx((-6.0, 7.0), abs=0.1)
    for actor in row:
        goal = actor.route[-1].x, actor.route[-1].y
        assert np.hypot(*(track(trace, actor.name)[-1] - goal)) < 0.65


@pytest.mark.slow
def test_an_actor_without_a_route_stands_firm() -> None:
    trace = moved(walker("post", ((-6.0, 0.0),), 0.0), walker("hero", ((-6.0, -4.0), (-6.0, 4.0))), seconds=9.0)
    assert np.ptp(track(trace, "post"), axis=0).max() < 0.01
    assert track(trace, "hero")[-1] == pytest.approx((-6.0, 4.0), abs=0.1)


@pytest.mark.parametrize("beyond", [0.2, 3.0])
def test_a_pedestrian_beyond_its_goal_walks_back(beyond: float) -> None:
    """Regression: the distance to the stop was negative, so it walked away from its goal, ever faster."""
    way: Way = ((-6.0, -4.0), (-6.0, 4.0))
    route = Route(walker("hero", way))
    route.advance(-6.0, 4.0 + beyond)
    assert route.to_stop(-6.0, 4.0 + beyond) == pytest.approx(beyond)
    assert route.direction(-6.0, 4.0 + beyond, 1.0, passing=False) == pytest.approx((0.0, -1.0))
