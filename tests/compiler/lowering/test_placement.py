"""Starts of actors, and their instance numbers."""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np
import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ActorPlan, Pose
from recipe_compiler.library import towns
from recipe_compiler.lowering.placement import instance_numbers

from tests.compiler.kitchen import compiled, only, small


class GroundPlan:
    """A vehicle or pedestrian from above, as points 0.25 m apart."""

    def __init__(self, pose: Pose, length: float, width: float) -> None:
        self.pose, self.half = pose, (length / 2, width / 2)
        along = np.linspace(-length / 2, length / 2, int(4 * length) + 2)
        aside = np.linspace(-width / 2, width / 2, int(4 * width) + 2)
        u, v = (axis.ravel() for axis in np.meshgrid(along, aside))
        yaw = np.radians(pose.yaw)
        self.points = np.stack([pose.x + u * np.cos(yaw) - v * np.sin(yaw), pose.y + u * np.sin(yaw) + v * np.cos(yaw)])

    def overlaps(self, other: GroundPlan) -> bool:
        """Return whether a point of the other one lies in this one."""
        yaw = np.radians(self.pose.yaw)
        dx, dy = other.points[0] - self.pose.x, other.points[1] - self.pose.y
        u, v = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        return bool(((np.abs(u) < self.half[0]) & (np.abs(v) < self.half[1])).any())


def ground_plan(actor: ActorPlan) -> GroundPlan:
    if actor.category == "pedestrian":
        return GroundPlan(actor.start, 0.5, 0.5)
    return GroundPlan(actor.start, actor.shape["length"], actor.shape["width"])


@pytest.mark.slow
def test_no_actor_starts_inside_another() -> None:
    recipe = small(town="downtown", traffic={"vehicles": 30, "pedestrians": 60})
    for index in range(20):
        recipe["base"]["actors"][f"walker{index}"] = {"blueprint": "walker.pedestrian.*"}
    actors = only(recipe).scene.actors
    grounds = [ground_plan(actor) for actor in actors]
    for index, one in enumerate(grounds):
        for other in grounds[:index]:
            assert not one.overlaps(other) and not other.overlaps(one)


def test_an_explicit_start_is_used_and_placed_on_the_ground() -> None:
    hero = only(small()).scene.actors[0]
    assert (hero.start.x, hero.start.y, hero.start.yaw) == (-4, 10, -90)  # towards its goal
    assert hero.start.z > 0  # the height of the kerb


@pytest.mark.parametrize(
    ("town", "x", "y", "yaw"),
    [("suburb", -1.6, 60, -90), ("suburb", 1.6, 20, 90), ("downtown", -40, 37.6, 180), ("highway", -8, 0, -90)],
)
def test_a_vehicle_without_a_goal_stays_in_the_lane_of_its_start(town: str, x: float, y: float, yaw: float) -> None:
    """Regression: its random route began in the opposite lane if it started in a lane towards -x or -y."""
    car = {"blueprint": "vehicle.sedan.a", "speed": 8, "start": {"x": x, "y": y}}
    car_plan = next(a for a in only(small(town=town, actors={"car": car})).scene.actors if a.name == "car")
    first = car_plan.route[0]
    assert car_plan.start.yaw % 360 == pytest.approx(yaw % 360, abs=1.0)
    assert min(abs(first.x - x), abs(first.y - y)) <= 0.15, "the route begins in the same lane"


def test_the_yaw_of_a_start_decides_the_direction() -> None:
    car = {"blueprint": "vehicle.sedan.a", "speed": 8, "start": {"x": -1.6, "y": 60, "yaw": 90}}
    car_plan = next(a for a in only(small(town="suburb", actors={"car": car})).scene.actors if a.name == "car")
    assert car_plan.start.yaw == 90 and car_plan.route[0].y > 60


def test_an_actor_that_does_not_move_has_no_route() -> None:
    recipe = small()
    recipe["base"]["actors"]["hero1"]["speed"] = 0
    hero = only(recipe).scene.actors[0]
    assert (hero.route, hero.speed) == ((), 0)


def test_an_actor_has_the_same_number_in_every_variant() -> None:
    recipe = small()
    guest = {"blueprint": "walker.pedestrian.*", "start": {"x": -4, "y": 3}}
    recipe["deltas"] = {"cast": {"all": {}, "fewer": {"actors": {"hero1": None}}, "more": {"actors": {"guest": guest}}}}
    numbers: dict[str, set[int]] = {}
    for variant in compiled(recipe).plan.variants:
        for actor in variant.scene.actors:
            numbers.setdefault(actor.name, set()).add(actor.instance)
    assert all(len(seen) == 1 for seen in numbers.values())
    assert (numbers["hero1"], numbers["hero2"]) == ({1}, {2})
    assert 300 <= min(numbers["guest"]) <= 399
    assert (numbers["traffic.pedestrian.1"], numbers["traffic.vehicle.1"]) == ({501}, {751})


def test_instance_numbers_are_unique_up_to_the_limit() -> None:
    numbers = instance_numbers([f"a{n}" for n in range(299)], [f"d{n}" for n in range(100)])
    assert sorted(numbers.values()) == list(range(1, 400))
    with pytest.raises(ValueError, match="the limit of 299 actors is exceeded, 300"):
        instance_numbers([f"a{n}" for n in range(300)], [])


def test_explicit_looks_are_used_and_do_not_change_the_scene() -> None:
    plain, dressed = small(), small()
    dressed["base"]["actors"]["hero1"]["look"] = {"shirt": "#AA0000"}
    before, after = only(plain), only(dressed)
    assert after.appearance.looks.root["hero1"]["shirt"] == "#aa0000"
    assert before.scene.digest == after.scene.digest
    rest = {k: v for k, v in after.appearance.looks.root["hero1"].items() if k != "shirt"}
    assert rest.items() <= before.appearance.looks.root["hero1"].items()


def traffic_of(**traffic: Any) -> list[ActorPlan]:
    recipe = small(actors={}, town="downtown", traffic=traffic)
    return [actor for actor in only(recipe).scene.actors if actor.name.startswith("traffic.")]


def test_a_density_gives_a_number_by_the_length_of_the_streets() -> None:
    town = towns.build("downtown", 0, {})
    actors = traffic_of(density={"vehicles": 10, "pedestrians": 5})
    lane = sum(2 * e.size[0] for e in town.plan.elements if e.kind == "road") / 1000
    assert sum(a.category == "vehicle" for a in actors) == round(10 * lane)
    assert sum(a.category == "pedestrian" for a in actors) == round(5 * lane)


def test_a_mix_determines_the_types_of_vehicles() -> None:
    mix = {"vehicle.sedan.*": 3, "vehicle.bus.city": 1, "walker.pedestrian.0001": 1}
    actors = traffic_of(vehicles=60, pedestrians=4, mix=mix)
    kinds = [a.blueprint for a in actors if a.category == "vehicle"]
    assert {k.rsplit(".", 1)[0] for k in kinds} == {"vehicle.sedan", "vehicle.bus"}
    assert 5 <= kinds.count("vehicle.bus.city") <= 27  # a quarter of 60
    assert {a.blueprint for a in actors if a.category == "pedestrian"} == {"walker.pedestrian.0001"}


def test_traffic_can_have_its_own_seed() -> None:
    recipe = small(traffic={"vehicles": 4, "seed": 7})
    other = copy.deepcopy(recipe) | {"seed": 31}
    of = [[a for a in only(r).scene.actors if a.name.startswith("traffic.")] for r in (recipe, other)]
    assert of[0] == of[1] != traffic_of(vehicles=4)


@pytest.mark.slow
def test_traffic_near_a_sensor_is_nearer_to_it_at_frame_0() -> None:
    def distance(near: dict[str, str]) -> float:
        starts = [a.start for a in traffic_of(vehicles=12, pedestrians=12, **near)]
        return float(np.mean([np.hypot(p.x + 8, p.y) for p in starts]))

    assert distance({"near": "street"}) < 0.8 * distance({})


def test_ignoring_lights_is_drawn_for_each_actor() -> None:
    assert all(a.obeys for a in traffic_of(vehicles=20))
    assert not any(a.obeys for a in traffic_of(vehicles=20, ignore_lights_percentage=100))
    assert 0 < sum(a.obeys for a in traffic_of(vehicles=40, ignore_lights_percentage=50)) < 40


def test_an_actor_with_a_start_is_held_through_the_warm_up() -> None:
    scene = only(small(actors={"hero1": small()["base"]["actors"]["hero1"]})).scene
    assert scene.clock.warmup == 10.0
    assert [actor.name for actor in scene.actors if actor.held] == ["hero1"]
    still = only(small(clock={"fps": 10, "frames": 4, "warmup": 0})).scene
    assert still.clock.warmup == 0.0
    assert not any(actor.held for actor in still.actors)
    assert only(small(traffic={"parked": 1})).scene.clock.warmup == 0.0


@pytest.mark.parametrize(
    ("traffic", "message"),
    [
        ({"near": "stret"}, 'traffic.near: there is no sensor "stret"'),
        ({"mix": {"vehicle.tank": 1}}, 'traffic.mix: "vehicle.tank" matches no blueprint'),
        ({"vehicles": 2, "density": {"vehicles": 3}}, "`density.vehicles` is given too"),
        ({"mix": {"vehicle.*": 0}}, "traffic.mix"),
    ],
)
def test_invalid_traffic_is_refused(traffic: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        only(small(traffic=traffic))
    assert message in str(caught.value)


def test_a_sensor_on_an_unknown_actor_of_the_traffic_is_refused() -> None:
    recipe = small(traffic={"density": {"vehicles": 1}})
    recipe["base"]["sensors"]["street"]["mount"] = {"on": "traffic.vehicle.200"}
    with pytest.raises(InputError, match=r"there is no actor \"traffic.vehicle.200\"; the traffic has fewer"):
        only(recipe)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["vehicles", "pedestrians", "parked"])
@pytest.mark.parametrize("town", towns.NAMES)
def test_a_town_has_room_for_exactly_as_many_as_the_message_says(town: str, key: str) -> None:
    """The number was that of spawn points, of which a vehicle takes two or more. It holds for all variants."""
    least = {name: [p.low] * p.length if p.length else p.low for name, p in towns.TOWNS[town].PARAMETERS.items()}

    def recipe(number: int) -> dict[str, Any]:
        recipe = small(town={"name": town, **least}, traffic={key: number})
        recipe["base"]["actors"] = {}
        return recipe | {"sweep": {"repeats": 3}}

    def room(number: int) -> int:
        with pytest.raises(InputError) as caught:
            compiled(recipe(number))
        (problem,) = caught.value.problems
        found = re.fullmatch(rf"traffic.{key}: the town has room for (\d+) [a-z ]+", problem.message)
        assert found, problem.message
        return int(found[1])

    most = room(99 if key == "parked" else 250)
    assert room(most + 1) == most
    compiled(recipe(most))
