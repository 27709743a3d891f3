"""Towns: properties of the layout, and random draws keyed by name."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import cast

import pytest
from recipe_compiler.ir.plan import Point, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import towns
from recipe_compiler.library.towns import Town
from recipe_compiler.library.towns.streets import StreetGrid

TOWN = towns.build("downtown", 7, {})
GRID = cast(StreetGrid, TOWN.streets)


def rows(town: Town) -> dict[str, object]:
    return {e.name: (e.document(), town.looks[e.name]) for e in town.plan.elements}


def test_names_are_unique_and_every_element_has_its_colours() -> None:
    names = [e.name for e in TOWN.plan.elements]
    assert len(set(names)) == len(names)
    assert set(names) == set(TOWN.looks)


def test_additional_blocks_do_not_change_the_others() -> None:
    """After adding a row of blocks, elements with the same name are equal, except walls and the skyline."""
    before, after = (
        rows(towns.build("downtown", 7, {"blocks": [2, 1]})),
        rows(towns.build("downtown", 7, {"blocks": [2, 2]})),
    )
    inner = [n for n in before if n.startswith(("building.0.0.", "tree.0.0.", "building.-1.0.0", "building.1.0."))]
    assert len(inner) > 20
    for name in inner:
        assert after[name] == before[name]


def test_the_main_street_is_where_recipes_expect_it() -> None:
    for y in (-25.0, 0.0, 25.0):
        assert [TOWN.ground(x, y) for x in (-9, -3.1, -3, 0, 3, 3.1, 9)] == [0.15, 0.15, 0.0, 0.0, 0.0, 0.15, 0.15]
    assert TOWN.ground(4, 36) == 0.0
    assert TOWN.ground(500, 500) == 0.0


@pytest.mark.slow
def test_wall_0_closes_the_gap_opposite_the_street_camera() -> None:
    for seed in range(5):
        wall = next(e for e in towns.build("downtown", seed, {}).plan.elements if e.name == "wall.0")
        assert wall.pose.x == 9.0
        assert abs(wall.pose.y) <= 3.0
        assert wall.pose.yaw == 180


def test_footpaths_along_a_block_are_free() -> None:
    for e in TOWN.plan.elements:
        if e.kind in ("tree", "lamp", "bench", "bin", "bus_stop", "planter", "hydrant", "sign") and abs(e.pose.y) < 11:
            assert not 3.7 < abs(e.pose.x) < 9


def test_buildings_do_not_overlap() -> None:
    spans: dict[tuple[str, float], list[tuple[float, float]]] = {}
    for e in TOWN.plan.elements:
        if e.kind == "building" and e.pose.yaw in (0, 180):
            spans.setdefault((str(e.pose.yaw), e.pose.x), []).append(
                (e.pose.y - e.size[1] / 2, e.pose.y + e.size[1] / 2)
            )
    for found in spans.values():
        found.sort()
        assert all(a[1] <= b[0] + 1e-6 for a, b in pairwise(found))


@pytest.mark.parametrize("blocks", [[1, 1], [9, 1], [2, 3]])
def test_spawn_points_stand_on_their_ground(blocks: list[int]) -> None:
    town = towns.build("downtown", 0, {"blocks": blocks})
    assert len(town.spawn_points) > 20
    for point in town.spawn_points:
        height = 0.15 if point.category == "pedestrian" else 0.0
        assert point.pose.z == height == town.ground(point.pose.x, point.pose.y)


def walk(start: Pose, route: tuple[Point, ...]) -> list[tuple[float, float]]:
    points, at = [], (start.x, start.y)
    for p in route:
        steps = max(1, int(math.dist(at, (p.x, p.y))))
        points += [(at[0] + (p.x - at[0]) * k / steps, at[1] + (p.y - at[1]) * k / steps) for k in range(steps)]
        at = (p.x, p.y)
    return points


def test_routes_keep_to_roads_and_sidewalks() -> None:
    for n, point in enumerate(TOWN.spawn_points[::17]):
        route = TOWN.route(point.category, point.pose, 150.0, Stream(0, "route", str(n)))
        track = walk(point.pose, route)
        assert len(track) > 120
        heights = [TOWN.ground(x, y) for x, y in track]
        if point.category == "vehicle":
            assert set(heights) == {0.0}
        else:
            assert sum(h > 0 for h in heights) > 0.6 * len(heights)
            on_road = [(x, y) for (x, y), h in zip(track, heights, strict=True) if h == 0.0]
            assert all(min(abs(x - s) for s in GRID.xs) < 11 for x, _ in on_road)
            assert all(min(abs(y - s) for s in GRID.ys) < 11 for _, y in on_road)


def test_vehicles_keep_right() -> None:
    point = next(p for p in TOWN.spawn_points if p.category == "vehicle")
    assert TOWN.route("vehicle", Pose(x=1.5, y=0, yaw=90), 20.0, Stream(0))[0].x == 1.5
    assert point.pose.yaw in (0, 90, 180, 270)


def test_a_route_depends_only_on_its_stream() -> None:
    start = Pose(x=1.5, y=0, yaw=90)
    one = [TOWN.route("vehicle", start, 300.0, Stream(0, "a")) for _ in range(2)]
    assert one[0] == one[1] != TOWN.route("vehicle", start, 300.0, Stream(0, "b"))


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"blocks": [0, 3]}, r"blocks is \[0, 3\]; it must be a list of 2 whole numbers from 1 to 9"),
        ({"blocks": [1.5, 3]}, "2 whole numbers"),
        ({"blocks": [True, 3]}, "2 whole numbers"),
        ({"blocks": 3}, "2 whole numbers"),
        ({"block": [1, 1]}, "no parameter 'block'; it has: blocks, storeys"),
    ],
)
def test_wrong_parameters_are_refused(params: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        towns.build("downtown", 0, params)


def test_an_unknown_town_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown town 'uptown'; the towns are: downtown, highway, plaza, suburb"):
        towns.build("uptown", 0, {})
