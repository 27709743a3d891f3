"""Drivers of vehicles: the distributions of speeds and time gaps, and what the keys of `driver` change in the plan."""

from __future__ import annotations

import statistics
from typing import Any

import pytest
from recipe_compiler.ir.plan import ActorPlan, DriverPlan
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints
from recipe_compiler.lowering import drivers

from tests.compiler.kitchen import only, small

MPH = 1.609344 / 3.6
STREET, MOTORWAY = 30 * MPH, 70 * MPH


def _drawn(blueprint: str, limit: float, count: int = 4000) -> list[tuple[float, DriverPlan]]:
    (found,) = blueprints.match(blueprint)
    return [drivers.drawn(found, limit, lambda purpose, n=n: Stream(n, purpose)) for n in range(count)]  # type: ignore[misc]


def _share_over(blueprint: str, limit: float, speed: float) -> float:
    return statistics.fmean(drawn > speed for drawn, _ in _drawn(blueprint, limit))


@pytest.mark.parametrize(
    ("blueprint", "limit", "over", "published"),
    [
        ("vehicle.sedan.a", STREET, STREET, 0.50),
        ("vehicle.sedan.a", STREET, 40 * MPH, 0.05),
        ("vehicle.motorcycle.a", STREET, STREET, 0.56),
        ("vehicle.truck.box", STREET, STREET, 0.42),
        ("vehicle.bus.city", STREET, STREET, 0.305),
        ("vehicle.van.a", MOTORWAY, MOTORWAY, 0.45),
        ("vehicle.sedan.a", MOTORWAY, 80 * MPH, 0.08),
        ("vehicle.motorcycle.a", MOTORWAY, MOTORWAY, 0.55),
        ("vehicle.truck.box", MOTORWAY, 53 * MPH, 0.50),
        ("vehicle.truck.box", MOTORWAY, 60 * MPH, 0.02),
    ],
)
def test_shares_over_the_limit_are_those_published(blueprint: str, limit: float, over: float, published: float) -> None:
    """Vehicle speed compliance statistics for Great Britain, 2022; the tails beyond 2 % are cut off."""
    assert _share_over(blueprint, limit, over) == pytest.approx(published, abs=0.025)


def test_time_gaps_have_the_published_mean_and_deviation() -> None:
    """Al-Obaedi 2019: 1.1 s and 0.42 s; without its tails, the deviation is less."""
    gaps = [driver.headway or 0.0 for _, driver in _drawn("vehicle.sedan.a", STREET)]
    assert statistics.fmean(gaps) == pytest.approx(1.1, abs=0.04)
    assert 0.34 < statistics.stdev(gaps) < 0.43
    assert 0.4 < min(gaps) < 0.6 and 2.0 < max(gaps) < 2.4
    heavy = [driver.headway or 0.0 for _, driver in _drawn("vehicle.bus.city", STREET)]
    assert statistics.median(heavy) == pytest.approx(1.5 * statistics.median(gaps))


def test_speeds_and_time_gaps_are_independent() -> None:
    speeds, gaps = zip(*((s, d.headway or 0.0) for s, d in _drawn("vehicle.sedan.a", STREET)), strict=True)
    assert abs(statistics.correlation(speeds, gaps)) < 0.05


def test_bicycles_keep_their_own_speed() -> None:
    for speed, driver in _drawn("vehicle.bicycle.a", STREET, 100):
        assert 0.85 * 4.6 <= speed <= 1.15 * 4.6 and driver.limit_factor == 1.0


def _traffic(driver: dict[str, Any] | None, count: int = 30, **more: Any) -> tuple[ActorPlan, ...]:
    keys = {} if driver is None else {"driver": driver}
    plan = only(small(town="suburb", actors={}, traffic={"vehicles": count, "pedestrians": 2, **keys, **more}))
    return tuple(actor for actor in plan.scene.actors if actor.name.startswith("traffic.vehicle"))


def _named(car: dict[str, Any]) -> ActorPlan:
    plan = only(small(actors={"car": {"blueprint": "vehicle.sedan.a", **car}}, traffic={}))
    return plan.scene.actors[0]


def test_an_additional_vehicle_changes_no_other_driver() -> None:
    assert [a.driver for a in _traffic(None, 12)] == [a.driver for a in _traffic(None, 13)][:12]


def test_keys_replace_the_draws_of_all_vehicles() -> None:
    keys = {"percentage_speed_difference": -20, "headway": 0.7, "distance_to_leading_vehicle": 3.5}
    for actor in _traffic(keys):
        assert actor.driver is not None
        assert (actor.driver.limit_factor, actor.driver.headway, actor.driver.gap) == (1.2, 0.7, 3.5)
        assert actor.speed == 10.0 or "bicycle" in actor.blueprint  # 120 % of 30 km/h


@pytest.mark.parametrize(
    ("key", "field", "value"),
    [
        ("ignore_signs_percentage", "obeys_signs", False),
        ("ignore_vehicles_percentage", "sees_vehicles", False),
        ("ignore_walkers_percentage", "sees_walkers", False),
        ("keep_right_rule_percentage", "keeps_right", True),
    ],
)
def test_percentages_are_shares_of_the_vehicles(key: str, field: str, value: bool) -> None:
    def share(percentage: float) -> float:
        return statistics.fmean(getattr(a.driver, field) is value for a in _traffic({key: percentage}))

    assert share(0) == 0.0 and share(100) == 1.0 and 0.2 < share(50) < 0.8
    assert all(getattr(a.driver, field) is not value for a in _traffic(None))


def test_lights_of_the_traffic_are_a_default_of_its_drivers() -> None:
    assert not any(a.obeys for a in _traffic(None, ignore_lights_percentage=100))
    assert all(a.obeys for a in _traffic({"ignore_lights_percentage": 0}, ignore_lights_percentage=100))
    assert not any(a.obeys for a in _traffic({"ignore_lights_percentage": 100}))


def test_a_named_vehicle_has_a_driver_only_if_the_recipe_describes_one() -> None:
    assert _named({}).driver is None
    assert "driver" not in _named({}).document()
    driven = _named({"speed": 6, "driver": {"headway": 2, "auto_lane_change": False, "ignore_lights_percentage": 100}})
    assert driven.speed == 6.0 and not driven.obeys
    assert driven.driver == DriverPlan(headway=2.0, changes_lanes=False)
    assert _named({"driver": {"percentage_speed_difference": 40}}).speed == 5.0  # of 30 km/h
