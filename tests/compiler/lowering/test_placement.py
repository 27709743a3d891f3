"""Where actors start, and their instance numbers."""

from __future__ import annotations

import copy

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.lowering.placement import instance_numbers

from tests.compiler.kitchen import compiled, only, small


def test_nobody_starts_inside_another() -> None:
    recipe = small(town="downtown", traffic={"vehicles": 30, "pedestrians": 60})
    for index in range(20):
        recipe["base"]["actors"][f"walker{index}"] = {"blueprint": "walker.pedestrian.*"}
    reach = {"pedestrian": 0.6, "vehicle": 4.0}
    actors = only(recipe).scene.actors
    for index, one in enumerate(actors):
        for other in actors[:index]:
            gap = (one.start.x - other.start.x) ** 2 + (one.start.y - other.start.y) ** 2
            assert gap >= (reach[one.category] + reach[other.category]) ** 2 - 1e-6


def test_a_start_that_is_given_is_kept_and_stands_on_the_ground() -> None:
    hero = only(small()).scene.actors[0]
    assert (hero.start.x, hero.start.y, hero.start.yaw) == (-4, 10, -90)  # towards its goal
    assert hero.start.z > 0  # the kerb's height


def test_who_does_not_move_has_no_way_to_go() -> None:
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


def test_numbers_are_unique_up_to_the_last() -> None:
    numbers = instance_numbers([f"a{n}" for n in range(299)], [f"d{n}" for n in range(100)])
    assert sorted(numbers.values()) == list(range(1, 400))
    with pytest.raises(ValueError, match="the limit of 299 actors is exceeded, 300"):
        instance_numbers([f"a{n}" for n in range(300)], [])


def test_too_many_actors_are_refused_with_a_remedy() -> None:
    recipe = copy.deepcopy(small())
    for n in range(300):
        recipe["base"]["actors"][f"a{n}"] = {"blueprint": "walker.pedestrian.*"}
    with pytest.raises(InputError, match="use `traffic` for crowds"):
        compiled(recipe)


def test_looks_are_kept_where_they_are_given_and_change_no_scene() -> None:
    plain, dressed = small(), small()
    dressed["base"]["actors"]["hero1"]["look"] = {"shirt": "#AA0000"}
    before, after = only(plain), only(dressed)
    assert after.appearance.looks.root["hero1"]["shirt"] == "#aa0000"
    assert before.scene.digest == after.scene.digest
    rest = {k: v for k, v in after.appearance.looks.root["hero1"].items() if k != "shirt"}
    assert rest.items() <= before.appearance.looks.root["hero1"].items()
