"""All towns: lanes and footpaths are free, spawn points and routes are on the right ground, parked cars leave lanes
free, and a town's seed and size change only what they should. Then what recipes expect of single towns."""

from __future__ import annotations

import math
import re
from functools import cache
from itertools import pairwise

import pytest
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import towns
from recipe_compiler.library.towns import Town
from recipe_compiler.library.towns.streets import KERB, LANE, StreetGrid

TOWN = towns.build("downtown", 7, {})
Params = dict[str, object]


def extreme(name: str, largest: bool) -> Params:
    """Return the ends of the parameters' ranges with which a town has the most, or the fewest, elements."""
    found: Params = {}
    for key, p in towns.TOWNS[name].PARAMETERS.items():
        ends = [end if p.length is None else (end,) * p.length for end in (p.low, p.high)]
        few, many = sorted(ends, key=lambda value: towns.elements(name, {key: value}))
        found[key] = many if largest else few
    return found


def cases(name: str) -> list[Params]:
    """Return parameters to test a town with: its defaults, the smallest town, the densest, and the largest if small."""
    small, large = extreme(name, largest=False), extreme(name, largest=True)
    extent = next(iter(small))
    dense = large | {extent: small[extent]}
    return [{}, small, dense, *([large] if towns.elements(name, large) < 1000 else [])]


CASES = [(name, params) for name in towns.NAMES for params in cases(name)]
FRONTED = {"building", "house", "wall"}  # their origin is at their front
LYING = {"ground", "road", "junction", "sidewalk", "path", "parking", "carriageway", "gantry"}
all_towns = pytest.mark.parametrize("town", range(len(CASES)), ids=[str(case) for case in CASES], indirect=True)


@cache
def built(number: int) -> Town:
    """Return the town of a case, built once."""
    name, params = CASES[number]
    return towns.build(name, 3, params)


@pytest.fixture
def town(request: pytest.FixtureRequest) -> Town:
    return built(request.param)


def corners(e: Element) -> list[tuple[float, float]]:
    """Return points around and within objects on the ground, such as a tree's trunk or a lamp's pole."""
    x, y, _ = e.size
    x, y = (2 * e.shape["trunk"],) * 2 if e.kind == "tree" else (0.1, 0.1) if e.kind == "sign" else (x, y)
    shift = -x / 2 if e.kind in FRONTED else 0.0
    s, c = exact.sin_cos_deg(e.pose.yaw)
    n = max(2, int(max(x, y) / 1.5))
    local = [(x * (i / n - 0.5) + shift, y * (j / n - 0.5)) for i in range(n + 1) for j in range(n + 1)]
    return [(e.pose.x + c * u - s * v, e.pose.y + s * u + c * v) for u, v in local]


def standing(town: Town) -> list[Element]:
    return [e for e in town.plan.elements if e.kind not in LYING]


Row = tuple[float, float, list[tuple[float, float]]]
CARRIAGEWAYS: dict[str, list[Row]] = {}  # by the town's digest


def carriageways(town: Town) -> list[Row]:
    """Return the y and the half width of each row of carriageways, with the x and the half length of each."""
    if town.plan.digest not in CARRIAGEWAYS:
        rows: dict[tuple[float, float], list[tuple[float, float]]] = {}
        for e in town.plan.elements:
            if e.kind == "carriageway":
                rows.setdefault((e.pose.y, e.size[0] / 2), []).append((e.pose.x, e.size[1] / 2))
        CARRIAGEWAYS[town.plan.digest] = [(*row, spans) for row, spans in rows.items()]
    return CARRIAGEWAYS[town.plan.digest]


def in_lane(town: Town, x: float, y: float) -> bool:
    if isinstance(town.streets, StreetGrid):
        grid = town.streets
        (x0, x1), (y0, y1) = grid.bounds
        inside = x0 + 1.0 < x < x1 - 1.0 and y0 + 1.0 < y < y1 - 1.0  # a rail closes a dead end
        return inside and (min(abs(x - s) for s in grid.xs) < LANE or min(abs(y - s) for s in grid.ys) < LANE)
    return any(
        abs(y - row_y) <= half_width and any(abs(x - at) < half_length for at, half_length in spans)
        for row_y, half_width, spans in carriageways(town)
    )


class Obstacles:
    """Points of the objects of a town, found by position."""

    def __init__(self, town: Town) -> None:
        self._cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
        for e in standing(town):
            for x, y in corners(e):
                self._cells.setdefault((math.floor(x / 4), math.floor(y / 4)), []).append((x, y))

    def near(self, x: float, y: float) -> list[tuple[float, float]]:
        """Return those within 4 m, and a few more."""
        i, j = math.floor(x / 4), math.floor(y / 4)
        return [q for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for q in self._cells.get((a, b), ())]


@pytest.mark.slow
@all_towns
def test_no_object_is_in_a_lane(town: Town) -> None:
    for e in standing(town):
        assert not any(in_lane(town, x, y) for x, y in corners(e)), e.name


@all_towns
def test_objects_on_a_block_stand_on_its_ground(town: Town) -> None:
    for e in standing(town):
        if e.pose.z > 0.0:
            assert e.pose.z == KERB
            assert all(town.ground(x, y) == KERB for x, y in corners(e)), e.name


@all_towns
def test_spawn_points_are_on_the_right_ground(town: Town) -> None:
    assert len(town.spots["vehicle"]) >= 16 and len(town.spots["pedestrian"]) >= 16
    for point in town.spawn_points:
        assert point.pose.z == town.ground(point.pose.x, point.pose.y)
        assert in_lane(town, point.pose.x, point.pose.y) == (point.category == "vehicle")
    solid = Obstacles(town)
    for p in town.spots["pedestrian"]:
        assert all(math.dist(q, (p.x, p.y)) > 0.4 for q in solid.near(p.x, p.y)), p


@pytest.mark.slow
@all_towns
def test_the_direction_of_a_lane_is_that_of_its_traffic(town: Town) -> None:
    """Spawn points are on all lanes, in the direction of the traffic."""
    spots = town.spots["vehicle"]
    assert all(town.streets.lane_yaw(pose.x, pose.y) == pose.yaw for pose in spots)
    assert len({pose.yaw for pose in spots}) >= 2


@all_towns
def test_routes_meet_no_object(town: Town) -> None:
    """Routes of vehicles keep a distance of 1 m from objects, those of pedestrians a shoulder's width."""
    solid = Obstacles(town)
    for n in range(40):
        category, room = (("vehicle", 1.0), ("pedestrian", 0.3))[n % 2]
        spots = town.spots[category]  # type: ignore[index]  # a str of the parameters
        start = spots[Stream(n, "start").integer(0, len(spots) - 1)]
        at, length, raised = (start.x, start.y), 0.0, []
        route, again = (town.route(category, start, 120.0, Stream(n, "route")) for _ in range(2))  # type: ignore[arg-type]
        assert route == again
        for p in route:
            steps = max(1, int(2 * math.dist(at, (p.x, p.y))))
            for k in range(steps):
                x, y = at[0] + (p.x - at[0]) * k / steps, at[1] + (p.y - at[1]) * k / steps
                assert all(math.dist(q, (x, y)) > room for q in solid.near(x, y)), (category, x, y)
                assert category == "pedestrian" or in_lane(town, x, y) or town.ground(x, y) == 0.0
                raised.append(town.ground(x, y) > 0.0)
            length += math.dist(at, (p.x, p.y))
            at = (p.x, p.y)
        if isinstance(town.streets, StreetGrid) and category == "pedestrian":
            assert sum(raised) > 0.5 * len(raised)  # on sidewalks, except at crossings
        assert length >= 119.0 or (category == "vehicle" and town.streets.entry(start))  # the end of a through road


@all_towns
def test_parked_cars_are_outside_lanes_and_do_not_touch(town: Town) -> None:
    places, obstacles = town.parking, Obstacles(town)
    for n, p in enumerate(places):
        s, c = exact.sin_cos_deg(p.yaw)
        for u in (-2.7, 0.0, 2.7):
            for v in (-1.0, 1.0):
                assert not in_lane(town, p.x + c * u - s * v, p.y + s * u + c * v)
        assert all(math.dist((p.x, p.y), (q.x, q.y)) > 4.0 for q in places[:n])
        for x, y in obstacles.near(p.x, p.y):
            dx, dy = x - p.x, y - p.y
            assert abs(c * dx + s * dy) > 2.75 or abs(c * dy - s * dx) > 1.0, (x, y)


@all_towns
def test_names_are_unique_and_every_slot_has_a_colour(town: Town) -> None:
    names = [e.name for e in town.plan.elements]
    assert len(set(names)) == len(names)
    assert set(names) == set(town.looks)


@pytest.mark.parametrize("case", range(len(CASES)), ids=[str(case) for case in CASES])
def test_the_number_of_elements_is_estimated(case: int) -> None:
    there = len(built(case).plan.elements)
    assert 0.7 * there < towns.elements(*CASES[case]) < 1.6 * there


@pytest.mark.slow
@pytest.mark.parametrize("name", towns.NAMES)
def test_a_seed_determines_the_town(name: str) -> None:
    one, again, other = (towns.build(name, seed, {}) for seed in (1, 1, 2))
    assert (one.plan, one.looks) == (again.plan, again.looks)
    assert one.plan.digest == again.plan.digest != other.plan.digest


@pytest.mark.parametrize(("name", "key"), [(name, key) for name in towns.NAMES for key in towns.TOWNS[name].PARAMETERS])
def test_wrong_parameters_are_refused(name: str, key: str) -> None:
    p = towns.TOWNS[name].PARAMETERS[key]
    wrong: list[object] = [p.low - 1, p.high + 1, p.low + 0.5, True, None]
    if p.length is None:
        wrong.append([p.low])
    else:
        wrong = [*([value] * p.length for value in wrong), p.low, [p.low]]
    if p.rising:
        wrong.append([p.high, p.low])
    for value in wrong:
        with pytest.raises(ValueError, match=re.escape(f"{key} is {value!r}; it must be {p.wanted}")):
            towns.build(name, 0, {key: value})


def test_a_town_has_the_name_of_its_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(towns.TOWNS, "uptown", towns.TOWNS["plaza"])
    with pytest.raises(AssertionError, match="the module of town uptown names it plaza"):
        towns.build("uptown", 0, {})


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match=f"unknown town 'uptown'; the towns are: {', '.join(towns.NAMES)}"):
        towns.build("uptown", 0, {})
    with pytest.raises(ValueError, match="town downtown has no parameter 'block'; it has: blocks, storeys"):
        towns.build("downtown", 0, {"block": [1, 1]})


@pytest.mark.parametrize(
    ("name", "prefixes"),
    [
        ("downtown", ("building.0.0.", "tree.0.0.", "building.-1.0.0", "building.1.0.")),
        ("suburb", ("house.0.0.", "house.-1.0.", "tree.0.0.")),
    ],
)
def test_additional_blocks_do_not_change_the_others(name: str, prefixes: tuple[str, ...]) -> None:
    """After adding a row of blocks, elements with the same name have the same random draws."""
    small, large = (towns.build(name, 7, {"blocks": [2, n]}) for n in (1, 2))
    before, after = ({e.name: e for e in town.plan.elements} for town in (small, large))
    inner = [n for n in before if n.startswith(prefixes)]
    assert len(inner) > 12
    assert all(before[n].shape == after[n].shape and small.looks[n] == large.looks[n] for n in inner)


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
