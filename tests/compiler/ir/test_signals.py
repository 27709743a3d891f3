"""Traffic lights: one light at any time, in the order and with the durations of the plan's cycle."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from recipe_compiler.ir import signals

SHAPE = {"cycle": 44.0, "green_from": 7.0, "green": 18.0, "amber": 3.0}


@given(st.integers(-10_000, 10_000))
def test_one_light_shows_and_it_repeats_with_the_cycle(tenths: int) -> None:
    seconds = tenths / 10
    red, amber, green, dont_walk, walk = signals.lit(SHAPE, seconds)
    assert red + amber + green == 1
    assert walk != dont_walk
    assert not (walk and not red)
    assert signals.light(SHAPE, seconds) == signals.light(SHAPE, seconds + 44.0)


def test_the_lights_have_their_order_and_lengths() -> None:
    shown = [signals.light(SHAPE, 7.0 + tenth / 10) for tenth in range(440)]
    assert shown == ["green"] * 180 + ["amber"] * 30 + ["red"] * 230
    assert signals.light(SHAPE, -37.0) == "green"  # during a warm-up


def test_pedestrians_may_walk_during_the_red_of_vehicles_except_at_its_end() -> None:
    walk = [tenth / 10 for tenth in range(440) if signals.may_walk(SHAPE, 7.0 + tenth / 10)]
    assert (walk[0], walk[-1]) == (18 + 3 + signals.WALK_DELAY, 43.9 - signals.WALK_CLEARANCE)
