"""Walking routes: around obstacles, straight where free, and without a start or goal inside an obstacle."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.compile import compile_recipe
from recipe_compiler.estimate import TooLargeError
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.ground.obstacles import Obstacle, ObstacleMap
from recipe_compiler.ir.ground.path_planner import CLEARANCE, Planner
from recipe_compiler.ir.plan import ActorPlan, ScenePlan
from recipe_compiler.library import towns
from recipe_compiler.lowering.enclosures import Yards
from recipe_compiler.lowering.walking_routes import RecipeWork

from tests.compiler.kitchen import compiled, small

CLOSE = 1e-5


def walker(x: float, y: float, **more: Any) -> dict[str, Any]:
    return {"blueprint": "walker.pedestrian.0001", "start": {"x": x, "y": y}, **more}


def scene(**base: Any) -> ScenePlan:
    return compiled(small(**base)).plan.variants[0].scene


def refused(**base: Any) -> str:
    with pytest.raises(InputError) as caught:
        compiled(small(**base))
    return str(caught.value)


def named(plan: ScenePlan) -> dict[str, ActorPlan]:
    return {actor.name: actor for actor in plan.actors}


def way(plan: ActorPlan) -> list[tuple[float, float]]:
    return [(plan.start.x, plan.start.y), *((p.x, p.y) for p in plan.route)]


def box(x: float, y: float, degrees: float, depth: float, width: float) -> Obstacle:
    turn = math.radians(degrees)
    return Obstacle("box", "prop", x, y, math.cos(turn), math.sin(turn), depth, width)


boxes = st.builds(box, st.floats(-8, 8), st.floats(-8, 8), st.floats(0, 360), st.floats(0.05, 3), st.floats(0.05, 3))


@pytest.mark.slow
@given(obstacles=st.lists(boxes, max_size=12), start=st.tuples(st.floats(-12, 12), st.floats(-12, 12)))
@settings(max_examples=60, deadline=None)
def test_a_route_keeps_its_distance_from_all_obstacles(obstacles: list[Obstacle], start: tuple[float, float]) -> None:
    planner, goal = Planner(ObstacleMap(obstacles)), (0.0, 11.0)
    if not (planner.clear(*start) and planner.clear(*goal)):
        return
    points = planner.shortest_path(start, goal)
    if points is None:
        return
    assert points[-1] == goal
    for (ax, ay), (bx, by) in pairwise([start, *points]):
        for part in range(41):
            x, y = ax + (bx - ax) * part / 40, ay + (by - ay) * part / 40
            assert all(obstacle.outside(x, y) > CLEARANCE - CLOSE for obstacle in obstacles)


@given(obstacles=st.lists(boxes, max_size=12))
@settings(max_examples=30, deadline=None)
def test_a_free_route_is_straight_and_routes_are_equal_in_both_directions(obstacles: list[Obstacle]) -> None:
    planner, a, b = Planner(ObstacleMap(obstacles)), (-11.0, -11.0), (11.0, 11.0)
    there, back = planner.shortest_path(a, b), planner.shortest_path(b, a)
    if not any(o.meets((*a, *b), CLEARANCE) for o in obstacles):
        assert there == [b]
    assert (there is None) == (back is None)
    if there is not None and back is not None:
        length = [sum(math.dist(p, q) for p, q in pairwise(points)) for points in ([a, *there], [b, *back])]
        assert length[0] == pytest.approx(length[1], abs=1e-4)


def test_the_route_around_a_box_is_the_shorter_one() -> None:
    planner = Planner(ObstacleMap([box(0, 0.5, 0, 1.0, 2.0)]))
    points = planner.shortest_path((-5.0, 0.0), (5.0, 0.0))
    assert points is not None
    assert [(round(x, 1), round(y, 1)) for x, y in points] == [(-1.4, -1.9), (1.4, -1.9), (5.0, 0.0)]


def test_no_route_leads_into_a_closed_ring() -> None:
    ring = [
        box(4 * math.cos(a), 4 * math.sin(a), math.degrees(a), 0.3, 2.0) for a in (k * math.pi / 4 for k in range(8))
    ]
    planner = Planner(ObstacleMap(ring))
    assert planner.shortest_path((-9.0, 0.0), (0.0, 0.0)) is None
    assert planner.shortest_path((-9.0, 0.0), (9.0, 0.0)) is not None


def test_a_recipe_whose_routes_take_too_long_is_refused_without_allow_large(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(small(actors={"p": walker(-4, 10, goal={"x": -4, "y": -10})})))
    assert compile_recipe(path).plan
    monkeypatch.setattr(RecipeWork, "MOST", 5)
    with pytest.raises(TooLargeError, match="planning the routes of its pedestrians takes too long"):
        compile_recipe(path)
    assert compile_recipe(path, allow_large=True).plan


@cache
def planner_of(name: str) -> Planner:
    return Planner(towns.build(name, 0, {}).obstacles)


@pytest.mark.parametrize("name", towns.NAMES)
def test_the_nearest_free_place_is_free(name: str) -> None:
    planner = planner_of(name)
    for n in range(40):
        x, y = -60.0 + 3.1 * n, -40.0 + 2.3 * n
        free = planner.nearest_free(x, y)
        assert free is not None
        assert planner.clear(*free)
        assert not planner.clear(x, y) or math.dist(free, (x, y)) < 0.2


@pytest.mark.slow
def test_routes_lead_around_a_board_and_a_standing_van() -> None:
    prop = {"board": {"size": {"width": 2, "height": 2}, "at": {"x": -5, "y": 0, "yaw": 90}}}
    plan = named(scene(actors={"hero": walker(-5, 5, goal={"x": -5, "y": -5})}, props=prop))["hero"]
    assert len(plan.route) > 1
    assert min(abs(x + 5) for x, y in way(plan)[1:-1]) > 1.0 + CLEARANCE - CLOSE
    van = {"blueprint": "vehicle.van.a", "start": {"x": 0, "y": 0, "yaw": 90}, "speed": 0}
    plan = named(scene(actors={"hero": walker(-4, 0, goal={"x": 4, "y": 0}), "van": van}))["hero"]
    assert max(abs(y) for _, y in way(plan)) > 2.5


def test_a_route_has_its_waypoints_and_avoids_obstacles_between_them() -> None:
    corners = [(-5.0, 20.0), (-24.0, 33.0), (-5.0, 20.0)]
    plan = named(scene(actors={"hero": walker(-5, -20, route=[{"x": x, "y": y} for x, y in corners])}))["hero"]
    assert [point for point in way(plan) if point in corners] == corners
    assert len(plan.route) > 3


@pytest.mark.parametrize(
    ("actor", "label"),
    [
        (walker(-14, -19), "start"),
        ({"blueprint": "vehicle.sedan.a", "start": {"x": -14, "y": -19}}, "start"),
        (walker(-8, -19, goal={"x": -14, "y": -19}), "goal"),
        (walker(-8, -19, route=[{"x": -8, "y": -18}, {"x": -14, "y": -19}]), "route[1]"),
    ],
)
def test_a_place_inside_a_building_is_refused_with_the_nearest_free_one(actor: dict[str, Any], label: str) -> None:
    """Otherwise the actor would be invisible or walk on the spot at the wall."""
    message = refused(actors={"lost": actor})
    assert f"actors.lost.{label}: it is inside building." in message
    assert "; the nearest free point is x: " in message
    x, y = _suggested(message)
    assert abs(x + 14) < 7
    assert named(scene(actors={"lost": walker(x, y)}))["lost"].start.y == y


@pytest.mark.parametrize("label", ["start", "goal"])
def test_the_suggested_place_is_not_in_a_closed_yard(label: str) -> None:
    """The yard behind the building is nearer than the street, but enclosed."""
    yards, planner = Yards(towns.build("downtown", 0, {})), planner_of("downtown")
    nearest = planner.nearest_free(36, -15)
    assert nearest is not None and yards.around(*nearest)
    lost = walker(36, -15) if label == "start" else walker(-8, -19, goal={"x": 36, "y": -15})
    free = _suggested(refused(actors={"lost": lost}))
    assert not yards.around(*free)
    assert named(scene(actors={"lost": walker(-8, -10, goal={"x": free[0], "y": free[1]})}))["lost"].route


def _suggested(message: str) -> tuple[float, float]:
    x, y = (float(part.split(":")[1]) for part in message.partition("point is ")[2].split("\n")[0].split(","))
    return x, y


@pytest.mark.slow
def test_a_goal_that_cannot_be_reached_is_refused() -> None:
    message = refused(actors={"lost": walker(36, 0, goal={"x": -4, "y": 0})})
    assert "actors.lost.goal: it cannot be reached from x: 36, y: 0; move it to a lane or a sidewalk" in message
    message = refused(actors={"lost": walker(-4, 0, goal={"x": 36, "y": 0})})
    assert "actors.lost.goal: it cannot be reached from x: -4, y: 0; the nearest free point is x: " in message


@cache
def crowd(name: str = "downtown", count: int = 60, frames: int = 300) -> ScenePlan:
    return scene(
        town=name,
        traffic={"pedestrians": count},
        clock={"fps": 10, "frames": frames},
        actors={},
        sensors={
            "street": {"mount": {"x": -7, "y": 0, "z": 2}, "capture": ["rgb"], "camera": {"width": 64, "height": 48}}
        },
    )


@pytest.mark.parametrize("name", towns.NAMES)
def test_pedestrians_of_the_traffic_walk_around_furniture(name: str) -> None:
    obstacles = towns.build(name, 0, {}).obstacles
    for actor in crowd(name).actors:
        if actor.companion is None:
            for (ax, ay), (bx, by) in pairwise(way(actor)):
                assert not obstacles.across((ax, ay, bx, by), CLEARANCE - 0.01)


@pytest.mark.slow
def test_pedestrians_of_the_traffic_pause_run_and_walk_in_pairs() -> None:
    actors = [
        a
        for seed in range(3)
        for a in scene(town={"name": "downtown", "seed": seed}, traffic={"pedestrians": 100, "seed": seed}).actors
        if a.name.startswith("traffic.")
    ]
    by_name = {a.name: a for a in actors[-100:]}
    share = {
        "companion": sum(a.companion is not None for a in actors) / len(actors),
        "pauses": sum(bool(a.pauses) for a in actors) / len(actors),
        "runs": sum(a.speed >= 2.6 for a in actors) / len(actors),
    }
    assert 0.1 < share["companion"] < 0.24
    assert 0.1 < share["pauses"] < 0.35
    assert 0.02 < share["runs"] < 0.12
    assert all(a.speed <= 3.2 for a in actors)
    for actor in by_name.values():
        if actor.companion is not None:
            leader = by_name[actor.companion]
            assert leader.companion is None
            assert (actor.route, actor.speed) == (leader.route, leader.speed)
            assert math.dist((actor.start.x, actor.start.y), (leader.start.x, leader.start.y)) == pytest.approx(0.7)
        assert all(pause.waypoint < len(actor.route) for pause in actor.pauses)


@pytest.mark.slow
def test_additional_pedestrians_change_no_other_and_a_longer_clip_extends_routes() -> None:
    few, many = crowd(count=40), crowd(count=60)
    assert many.actors[:40] == few.actors
    for short, long in zip(crowd(frames=100).actors, crowd(frames=300).actors, strict=True):
        assert long.route[: len(short.route)] == short.route
        assert long.pauses[: len(short.pauses)] == short.pauses
        assert long.model_copy(update={"route": (), "pauses": ()}) == short.model_copy(
            update={"route": (), "pauses": ()}
        )
