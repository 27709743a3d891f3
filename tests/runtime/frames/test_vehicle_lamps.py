"""Brake lamps, indicators and reversing lamps follow from the motion of a vehicle, and blink at their rate."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_runtime.core.interfaces import LampState
from recipe_runtime.core.trace import METRE, UNIT, Trace
from recipe_runtime.frames.vehicle_lamps import VehicleLamps

FPS = 12
TURNS = LampState.LEFT | LampState.RIGHT


def lamps_on(speeds: list[float], yaws: list[float], *, parked: bool = False) -> NDArray[np.int32]:
    """Return the masks of a vehicle with a speed (negative: backwards) and a direction in degrees in each frame."""
    places: list[list[float]] = []
    turned: list[list[float]] = []
    rates: list[list[float]] = []
    place: NDArray[np.float64] = np.zeros(2)
    for speed, yaw in zip(speeds, yaws, strict=True):
        way = np.array(exact.sin_cos_deg(yaw)[::-1])
        places.append([*place, 0.0])
        rates.append([*(speed * way), 0.0])
        s, c = exact.sin_cos_deg(yaw / 2.0)
        turned.append([0.0, 0.0, s, c])
        place = place + speed * way / FPS
    rows, velocity = (np.round(np.array(v) * METRE).astype(np.int64)[:, None] for v in (places, rates))
    rotations = np.round(np.array(turned) * UNIT).astype(np.int32)[:, None]
    trace = Trace(("car",), ("car/base",), rows, rotations, velocity, np.zeros_like(velocity))
    actor = SimpleNamespace(name="car", route=() if parked else ((1.0, 0.0),), shape={"body": 1.0}, instance=8)
    scene: Any = SimpleNamespace(actors=(actor,), clock=SimpleNamespace(fps=FPS))
    return VehicleLamps(scene, trace).many(np.arange(len(speeds)))[:, 0]


def steady(frames: int, speed: float = 10.0) -> list[float]:
    return [speed] * frames


def test_a_vehicle_that_slows_down_or_stands_brakes() -> None:
    speeds = [*steady(24), *(10.0 - 0.25 * n for n in range(40)), *steady(12, 0.0), *(0.2 * n for n in range(1, 40))]
    braking = lamps_on(speeds, [0.0] * len(speeds)) & LampState.BRAKE
    assert not braking[:22].any()
    assert braking[26:75].all()
    assert not braking[79:].any()
    assert not lamps_on(steady(12, 0.0), [0.0] * 12, parked=True).any()


def test_a_vehicle_that_coasts_does_not_brake() -> None:
    speeds = [10.0 - 0.03 * n for n in range(60)]  # 0.36 m/s^2
    assert not (lamps_on(speeds, [0.0] * 60) & LampState.BRAKE).any()


@pytest.mark.parametrize("side", [1, -1])
def test_a_turn_is_signalled_before_and_while_it_is_made(side: int) -> None:
    yaws = [*[0.0] * 60, *(side * 90.0 * n / 30 for n in range(30)), *[side * 90.0] * 60]
    masks = lamps_on(steady(len(yaws), 5.0), yaws)
    right, wrong = (LampState.LEFT, LampState.RIGHT)[::side]
    assert not (masks & wrong).any()
    lit = np.flatnonzero(masks & right)
    assert 20 <= lit[0] <= 50  # up to 15 m before it
    assert 75 <= lit[-1] <= 90  # until it is nearly made


def test_a_turn_is_signalled_while_waiting_for_it() -> None:
    speeds = [*steady(60, 0.0), *steady(90, 5.0)]
    yaws = [*[0.0] * 80, *(90.0 * n / 30 for n in range(30)), *[90.0] * 40]
    lit = (lamps_on(speeds, yaws) & LampState.LEFT) != 0
    assert 28 <= lit[:60].sum() <= 32  # half of the time: it blinks
    changes = int((lit[1:60] != lit[:59]).sum())
    assert changes in (14, 15)  # 1.5 times a second, for 5 seconds


def test_a_change_of_lane_is_signalled_and_a_bend_of_the_road_is_not() -> None:
    shift = [*[0.0] * 40, *[6.0] * 24, *[0.0] * 60]  # 2.5 m to the left at 12 m/s
    masks = lamps_on(steady(len(shift), 12.0), shift)
    assert (masks & LampState.LEFT).any()
    assert not (masks & LampState.RIGHT).any()
    bend = [0.4 * n for n in range(120)]  # 4.8 degrees a second at 15 m/s: a radius of 179 m
    assert not (lamps_on(steady(120, 15.0), bend) & TURNS).any()
    assert not (lamps_on(steady(120, 15.0), [30.0] * 120) & TURNS).any()


def test_a_vehicle_that_moves_backwards_has_its_reversing_lamps_on() -> None:
    masks = lamps_on([*steady(12, -1.0), *steady(12, 1.0)], [20.0] * 24)
    assert (masks[:12] & LampState.REVERSE).all()
    assert not (masks[12:] & LampState.REVERSE).any()


def test_a_vehicle_that_leaves_and_enters_elsewhere_signals_nothing() -> None:
    rows = np.zeros((24, 1, 3), np.int64)
    rows[:12, 0, 0] = np.arange(12) * METRE
    rows[12:, 0, 1] = (500 + np.arange(12)) * METRE
    velocity = np.zeros_like(rows)
    velocity[:12, 0, 0] = velocity[12:, 0, 1] = FPS * METRE
    turned = np.zeros((24, 1, 4), np.int32)
    turned[:12, 0, 3], turned[12:, 0, 2:] = UNIT, UNIT * 0.70710678
    trace = Trace(("car",), ("car/base",), rows, turned, velocity, np.zeros_like(velocity))
    actor = SimpleNamespace(name="car", route=((1.0, 0.0),), shape={"body": 1.0}, instance=8)
    scene: Any = SimpleNamespace(actors=(actor,), clock=SimpleNamespace(fps=FPS))
    assert not (VehicleLamps(scene, trace).many(np.arange(24)) & TURNS).any()
