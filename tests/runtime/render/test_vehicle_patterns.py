"""Patterns of vehicles: cabins behind glass, shut lines, number plates; and the slots of their lamps."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.library import blueprints
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.cabin import ROWS, Cabin
from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.texture.patterns import detail_of

wp.set_module_options(OPTIONS)

CABIN = Cabin(seat=-0.1, half=0.78, head=1.2, belt=0.92, roof=1.4, rows=2, driver=True)
CARS = [b for b in blueprints.LIBRARY if b.attributes.get("number_of_wheels") == "4"]


@wp.kernel
def drawn(
    pattern: wp.int32,
    uvs: wp.array[wp.vec2f],
    places: wp.array[wp.vec3f],
    sight: wp.vec3f,
    foot: wp.float32,
    code: wp.int32,
    out_details: wp.array[wp.vec4f],
):
    i = wp.tid()
    normal = wp.vec3f(0.0, 1.0, 0.0)
    d = detail_of(pattern, uvs[i], places[i], normal, sight, wp.vec2f(foot, foot), wp.uint32(code))
    out_details[i] = wp.vec4f(d.tone, d.second, d.wear, d.parameter)


def details(
    pattern: Pattern, uv: np.ndarray, p: np.ndarray, sight: tuple[float, float, float], foot: float, code: int = 7
) -> np.ndarray:
    """Return tone, second, wear and parameter [N, 4] of points [N, 3] with uv [N, 2]."""
    found = wp.zeros(len(p), dtype=wp.vec4f, device="cpu")
    uvs = wp.array(uv.astype(np.float32), dtype=wp.vec2f, device="cpu")
    places = wp.array(p.astype(np.float32), dtype=wp.vec3f, device="cpu")
    arguments = {"pattern": int(pattern), "uvs": uvs, "places": places, "sight": wp.vec3f(*sight), "foot": foot}
    launch(drawn, len(p), "cpu", **arguments, code=code, out_details=found)
    return found.numpy().astype(np.float64)


def inside(cabin: Cabin, x: float, z: float, foot: float = 0.002) -> np.ndarray:
    """Return what one sees through the left window at a place, looking straight across."""
    return details(Pattern.CABIN, np.array([cabin.uv()]), np.array([[x, 0.9, z]]), (0.0, -1.0, 0.0), foot)[0]


def test_interpolation_keeps_the_numbers_of_a_cabin() -> None:
    rng = np.random.default_rng(1)
    weights = rng.random((4000, 3)).astype(np.float32)
    weights /= weights.sum(1, keepdims=True)
    for rows in ROWS:
        for number in Cabin(3.9, 1.2, 4.8, 4.6, 5.1, rows, driver=True).uv():
            value = np.float32(number)
            mixed = weights[:, 0] * value + weights[:, 1] * value + weights[:, 2] * value
            assert (np.floor(mixed + np.float32(0.5)) == number).all() and number < 2**19


def test_a_driver_sits_on_the_left_behind_the_wheel() -> None:
    """The face is skin, parked cars have none, and beside the seats one sees the street through the other window."""
    x, z = CABIN.seat + 0.22, CABIN.head
    assert inside(CABIN, x, z)[2] == pytest.approx(1.0)
    parked = Cabin(CABIN.seat, CABIN.half, CABIN.head, CABIN.belt, CABIN.roof, 2, driver=False)
    assert inside(parked, x, z)[2] == pytest.approx(0.0)
    assert inside(CABIN, CABIN.seat + 0.6, z)[3] == pytest.approx(1.0)
    assert inside(CABIN, CABIN.seat + 0.6, CABIN.belt - 0.1)[3] == pytest.approx(0.0)
    assert inside(CABIN, CABIN.seat, CABIN.belt)[1] == pytest.approx(1.0), "a seat"


def test_seats_of_a_bus_have_no_headrests() -> None:
    """At the height of a driver's eyes one sees across a bus; headrests there looked like passengers."""
    bus = Cabin(seat=2.2, half=1.0, head=1.7, belt=1.14, roof=2.8, rows=8, driver=True)
    for row in range(1, 8):
        x = bus.seat - 0.85 * row
        assert inside(bus, x, bus.head)[3] == pytest.approx(1.0)
        assert inside(bus, x, bus.head - 0.5)[1] == pytest.approx(1.0), "a seat"
    assert inside(CABIN, CABIN.seat - 0.02, CABIN.head + 0.03)[1] == pytest.approx(1.0), "a car has them"


def test_a_cabin_fades_to_one_value_far_away() -> None:
    far = [inside(CABIN, x, 1.1, foot=2.0) for x in (-0.8, 0.0, 0.3)]
    assert (far[0] == far[1]).all() and (far[1] == far[2]).all()


@pytest.mark.parametrize("foot", [0.002, 0.01, 0.03])
def test_a_shut_line_darkens_by_its_width(foot: float) -> None:
    """The mean over pixels that touch a line does not depend on their size, until the line fades."""
    x = np.linspace(-0.2, 0.2, 4001)
    p = np.stack([x, np.ones_like(x), np.ones_like(x)], axis=1)
    uv = np.tile([80.0, 179.0], (len(x), 1))
    tone = details(Pattern.CAR_PAINT, uv, p, (0.0, -1.0, 0.0), foot)[:, 0]
    assert (1.0 - tone).mean() * 0.4 == pytest.approx(0.92 * 0.009, rel=0.08)
    assert (details(Pattern.CAR_PAINT, uv - 79.0, p, (0.0, -1.0, 0.0), foot)[:, 0] == 1.0).all(), "no line"


def test_two_vehicles_have_different_number_plates() -> None:
    u, v = np.meshgrid(np.linspace(0.01, 6.99, 200), np.linspace(0.05, 0.95, 20))
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    p = np.zeros((len(uv), 3))
    one, again, other = (details(Pattern.NUMBER_PLATE, uv, p, (1.0, 0.0, 0.0), 0.001, code)[:, 1] for code in (5, 5, 6))
    assert (one == again).all() and np.abs(one - other).mean() > 0.1
    assert 0.1 < one.mean() < 0.7


@pytest.mark.parametrize("car", CARS, ids=lambda b: b.id)
def test_each_lamp_is_where_its_name_says(car: blueprints.Blueprint) -> None:
    """The left indicators are on the left, headlights ahead, all others behind; the paths of light need the slots."""
    mesh = actor_body(blueprints.specimen(car)[0]).mesh("chassis")
    middles = {
        s.slot: mesh.vertices[mesh.triangles[mesh.surface == k]].mean(axis=1) for k, s in enumerate(mesh.surfaces)
    }
    assert (middles["headlight"][:, 0] > 0.0).all()
    for slot in ("taillight", "brakelight", "reverselight"):
        assert (middles[slot][:, 0] < 0.0).all(), slot
    assert (middles["indicator_left"][:, 1] > 0.0).all() and (middles["indicator_right"][:, 1] < 0.0).all()
    for side in ("indicator_left", "indicator_right"):
        assert {True, False} == set((middles[side][:, 0] > 0.0).tolist()), "one ahead and one behind"
