"""A frame is a pure function of its plan and number: golden digests, and equality with and without caches."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from recipe_compiler.ir.plan import CameraPlan, CameraResponse, Pose
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.render.device.reuse import ALL_REUSE, NO_REUSE, TemporalReuse
from recipe_runtime.render.renderer import Renderer

from tests.golden.renew_render import GOLDEN
from tests.runtime.render.street import (
    CAMERA,
    CLOTH,
    EYE,
    WEATHERS,
    appearance,
    box,
    golden_digests,
    ground,
    parts_at,
    street,
)

ROOT = Path(__file__).parents[3]
STANDING_WATER = {
    "still": appearance(50.0, precipitation_deposits=80, wetness=60),
    "breeze": appearance(20.0, precipitation_deposits=80, wetness=60, wind_intensity=40, cloudiness=50),
    "rings": appearance(45.0, precipitation=15, precipitation_deposits=70),
    "night": appearance(-30.0, precipitation_deposits=90, wetness=80, fog_density=20),
}


def picture(renderer: Renderer, frame: int, weather: str = "rainy") -> bytes:
    seen = renderer.observe(CAMERA, EYE, parts_at(frame))
    return renderer.shade(seen, WEATHERS[weather], "street", frame, frame / 30).tobytes()


def test_golden_digests() -> None:
    """Renew the digests with `python -m tests.golden.renew_render` after an intended change of pixels."""
    assert golden_digests() == json.loads(GOLDEN.read_text())


@pytest.mark.slow
def test_the_order_of_appearances_and_caches_change_no_byte() -> None:
    forward, backward = Renderer(street()), Renderer(street(), reuse=NO_REUSE)
    a, b = (r.observe(CAMERA, EYE, parts_at()) for r in (forward, backward))
    names = list(WEATHERS)
    first = {n: forward.shade(a, WEATHERS[n], "street", 0, 0.0).tobytes() for n in names}
    second = {n: backward.shade(b, WEATHERS[n], "street", 0, 0.0).tobytes() for n in reversed(names)}
    assert first == second
    assert len(set(first.values())) == len(names)


@pytest.mark.slow
def test_reuse_at_a_static_camera_changes_no_byte() -> None:
    """With a walker and a car that move through lamp light, shadows and puddles."""
    keeping, forgetting = Renderer(street()), Renderer(street(), reuse=NO_REUSE)
    for frame in (0, 1, 2, 9, 30):
        for weather in WEATHERS:
            assert picture(keeping, frame, weather) == picture(forgetting, frame, weather)


@pytest.mark.slow
@pytest.mark.parametrize("level", [field.name for field in fields(TemporalReuse)])
def test_each_level_of_reuse_can_be_off_without_changing_a_byte(level: str) -> None:
    """The benchmark of the levels depends on it: it compares equal pictures."""
    without, alone = Renderer(street(), reuse=replace(ALL_REUSE, **{level: False})), Renderer(street(), reuse=NO_REUSE)
    for frame in (0, 1, 2, 9):
        for weather in WEATHERS:
            assert picture(without, frame, weather) == picture(alone, frame, weather)


@pytest.mark.slow
@pytest.mark.parametrize("order", [range(0, 60, 4), (0, 1, 30, 1, 2, 2, 31, 0, 9, 45, 9)], ids=["on", "to and fro"])
@pytest.mark.parametrize("weather", STANDING_WATER)
def test_reuse_of_reflections_in_still_water_changes_no_byte(weather: str, order: Sequence[int]) -> None:
    """Rays, their hits and developed pixels are reused while a walker and a car enter and leave several times."""
    keeping, plan = Renderer(street()), STANDING_WATER[weather]
    for frame in order:
        seen, now = keeping.observe(CAMERA, EYE, parts_at(frame)), frame / 30
        alone = Renderer(street(), reuse=NO_REUSE)
        expected = alone.shade(alone.observe(CAMERA, EYE, parts_at(frame)), plan, "street", frame, now)
        np.testing.assert_array_equal(keeping.shade(seen, plan, "street", frame, now), expected)


@pytest.mark.slow
def test_a_shadow_that_reaches_grass_in_the_wind_is_rendered() -> None:
    """Wind turns the blades, so a penumbra can darken them where it would leave still grass lit."""
    looks, blades = {"lawn": {"blades": "#4c6b2c"}, "hero": {"shirt": "#b03030"}}, Surface("blades", Pattern.GRASS, 9)
    walker = Body("hero", 12001, (("body", box([-0.2, -0.25, 0.0], [0.2, 0.25, 1.7], CLOTH)),))
    bodies = [Body("lawn", 0, (("base", ground(60, blades)),)), walker]
    plan = appearance(35.0, 200.0, looks, wind_intensity=60)
    plan = plan.model_copy(update={"responses": {"street": CameraResponse(noise=0.0)}})
    camera, eye = CameraPlan(width=200, height=200, fov=24), from_pose(Pose(x=2.0, y=-1.0, z=1.7, yaw=4, pitch=30))
    keeping, forgetting = Renderer(bodies), Renderer(bodies, reuse=NO_REUSE)
    for frame in range(40):
        parts = np.stack([from_pose(Pose(x=5.0 + 0.003 * frame, y=-1.0 + 0.004 * frame, yaw=20))])
        kept, alone = (
            r.shade(r.observe(camera, eye, parts), plan, "street", frame, frame / 30) for r in (keeping, forgetting)
        )
        np.testing.assert_array_equal(kept, alone)


@pytest.mark.slow
def test_two_cameras_with_one_pose_have_caches_of_their_own() -> None:
    """Cached pixels belong to a sensor: one with another exposure must not get them."""
    bright = STANDING_WATER["still"].model_copy(
        update={"responses": {"bright": CameraResponse(exposure_compensation=1)}}
    )
    both = Renderer(street())
    for frame in (0, 1, 2, 3):
        seen = both.observe(CAMERA, EYE, parts_at(frame))
        for sensor in ("street", "bright"):
            alone = Renderer(street(), reuse=NO_REUSE)
            expected = alone.shade(alone.observe(CAMERA, EYE, parts_at(frame)), bright, sensor, frame, 0.0)
            np.testing.assert_array_equal(both.shade(seen, bright, sensor, frame, 0.0), expected)


def test_shading_does_not_change_the_details_of_samples() -> None:
    """All wet weathers share the puddle depths, which have an array of their own."""
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    samples = renderer._camera._sampler.points(seen, antialias=True).data
    before = samples.details.numpy().tobytes()
    renderer.shade(seen, STANDING_WATER["still"], "street", 0, 0.0)
    assert samples.details.numpy().tobytes() == before
    known = samples.puddle_depths.numpy()[samples.surfaces.numpy() >= 0]
    assert (known < 0.0).any() and (known == 0.0).any()


@pytest.mark.slow
def test_an_older_frame_can_be_shaded_after_a_newer_one() -> None:
    """Both share the arrays of static samples, which hold the state of one frame at a time."""
    renderer, weather = Renderer(street()), WEATHERS["rainy"]
    seen = {frame: renderer.observe(CAMERA, EYE, parts_at(frame)) for frame in (0, 1, 9, 30)}
    for frame in (9, 30, 1, 30, 0, 9):
        shot = renderer.shade(seen[frame], weather, "street", frame, frame / 30).tobytes()
        assert shot == picture(Renderer(street()), frame)


def test_labels_do_not_depend_on_weather() -> None:
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    before = seen.depth.tobytes(), seen.instance.tobytes(), seen.semantic.tobytes(), seen.objects
    for weather in WEATHERS.values():
        renderer.shade(seen, weather, "street", 0, 0.0)
    again = renderer.observe(CAMERA, EYE, parts_at())
    for o in (seen, again):
        assert (o.depth.tobytes(), o.instance.tobytes(), o.semantic.tobytes(), o.objects) == before


def test_noise_differs_by_sensor_and_frame() -> None:
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    plan = WEATHERS["noon"]
    shots = [renderer.shade(seen, plan, s, f, 0.0) for s, f in (("street", 0), ("side", 0), ("street", 1))]
    assert len({shot.tobytes() for shot in shots}) == 3
    quiet = plan.model_copy(update={"responses": {s: CameraResponse(noise=0.0) for s in ("street", "side")}})
    still = [renderer.shade(seen, quiet, s, f, 0.0) for s, f in (("street", 0), ("side", 0), ("street", 1))]
    assert len({shot.tobytes() for shot in still}) == 1
    assert np.abs(still[0].astype(int) - shots[0]).max() < 40


def test_antialiasing_changes_only_edges() -> None:
    renderer = Renderer(street())
    seen = renderer.observe(CAMERA, EYE, parts_at())
    plan = WEATHERS["noon"]
    smooth, plain = (
        renderer.shade(
            seen,
            plan.model_copy(update={"responses": {"street": CameraResponse(noise=0.0, antialias=on)}}),
            "street",
            0,
            0.0,
        )
        for on in (True, False)
    )
    changed = (smooth != plain).any(axis=2)
    assert 0.01 < changed.mean() < 0.4
