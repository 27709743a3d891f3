"""A frame stream draws many frames without a stop; here it does so on the CPU, and must give the renderer's bytes."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan, SensorPlan
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import part_transforms, sensor_transform
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.loading import compiled
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu import frame_buffers, frame_stream
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.renderer import Renderer

from tests.sources import ROOT


@pytest.fixture(scope="module")
def plan() -> DatasetPlan:
    return compiled(ROOT / "tests" / "golden" / "tiny.yaml")


def take_of(variant: ScenarioPlan, sensor: SensorPlan, trace: Trace) -> FrameBatch:
    """All frames, and the first ones once more, so that a recorded frame has to forget what it drew."""
    numbers = [*range(variant.scene.clock.frames), 0, 1]
    poses = np.stack([sensor_transform(sensor, trace, n) for n in numbers])
    return FrameBatch(
        numbers, [n / variant.scene.clock.fps for n in numbers], poses, part_transforms(trace, np.array(numbers))
    )


def hold_to_renderer(plan: DatasetPlan, sensor_at: int, device: str) -> None:
    """All weathers at once, against the renderer's frames one by one on the CPU, labels and pictures."""
    variant, appearances = plan.variants[0], [v.appearance for v in plan.variants]
    trace = Store().trace(variant.scene, lambda: real_engines().simulate(variant.scene))
    bodies = [*town_bodies(variant.scene.town), *[actor_body(actor) for actor in variant.scene.actors]]
    slow, fast, sensor = Renderer(bodies, reuse=NO_REUSE), Renderer(bodies, device), variant.rig.sensors[sensor_at]
    take = take_of(variant, sensor, trace)
    for at, made in enumerate(fast.frame_stream(sensor.camera, sensor.name, appearances, in_flight=2).frames(take)):
        seen = slow.observe(sensor.camera, take.poses[at], take.parts[at])
        assert made.number == take.numbers[at]
        for modality in ("depth", "instance", "semantic"):
            np.testing.assert_array_equal(getattr(made.observation, modality), getattr(seen, modality))
        assert made.observation.objects == seen.objects
        for appearance, picture in zip(appearances, made.pictures, strict=True):
            expected = slow.shade(seen, appearance, sensor.name, made.number, take.times[at])
            np.testing.assert_array_equal(picture, expected)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", [0, 1])
def test_a_reel_has_the_renderers_bytes(plan: DatasetPlan, sensor: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With too little room at first: the small pictures have more edges than a stream expects, so lanes must grow."""
    monkeypatch.setattr(frame_stream, "_EDGE_SAMPLES", 0.1)
    hold_to_renderer(plan, sensor, "cpu")


@pytest.mark.slow
def test_a_full_list_of_bands_loses_no_triangle(plan: DatasetPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_buffers, "_BIN_CAPACITY", 40)
    hold_to_renderer(plan, 0, "cpu")


@pytest.mark.gpu
@pytest.mark.parametrize("sensor", [0, 1])
def test_a_reel_on_a_gpu_has_the_processors_bytes(plan: DatasetPlan, sensor: int) -> None:
    hold_to_renderer(plan, sensor, "cuda:0")
