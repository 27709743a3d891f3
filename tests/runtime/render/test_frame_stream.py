"""A frame stream renders many frames from recorded launches; its bytes equal the renderer's, here on the CPU."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.ir.modalities import LABEL_MODALITIES
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan, SensorPlan
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import part_transforms, sensor_transform
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.loading import compiled
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.modalities import label_array, label_passes
from recipe_runtime.render.device.reuse import NO_REUSE
from recipe_runtime.render.gpu import frame_buffers, frame_stream
from recipe_runtime.render.gpu.frame_stream import FrameBatch
from recipe_runtime.render.renderer import Renderer

from tests.sources import ROOT


@pytest.fixture(scope="module")
def plan() -> DatasetPlan:
    return compiled(ROOT / "tests" / "golden" / "tiny.yaml")


def batch_of(variant: ScenarioPlan, sensor: SensorPlan, trace: Trace) -> FrameBatch:
    """Return all frames and the first two again, so that recorded frames run with used buffers."""
    numbers = [*range(variant.scene.clock.frames), 0, 1]
    poses = np.stack([sensor_transform(sensor, trace, n) for n in numbers])
    return FrameBatch(
        numbers, [n / variant.scene.clock.fps for n in numbers], poses, part_transforms(trace, np.array(numbers))
    )


def assert_equals_renderer(plan: DatasetPlan, sensor_at: int, device: str) -> None:
    """Assert that all weathers of a stream equal the renderer's single frames on the CPU, labels and pictures."""
    variant, appearances = plan.variants[0], [v.appearance for v in plan.variants]
    trace = Store().trace(variant.scene, lambda: real_engines().simulate(variant.scene))
    bodies = [*town_bodies(variant.scene.town), *[actor_body(actor) for actor in variant.scene.actors]]
    slow, fast, sensor = Renderer(bodies, reuse=NO_REUSE), Renderer(bodies, device), variant.rig.sensors[sensor_at]
    batch = batch_of(variant, sensor, trace)
    further = label_passes(LABEL_MODALITIES)
    stream = fast.frame_stream(sensor.camera, sensor.name, appearances, in_flight=2, label_passes=further)
    for at, made in enumerate(stream.frames(batch)):
        seen = slow.observe(sensor.camera, batch.poses[at], batch.parts[at])
        assert made.number == batch.numbers[at]
        for modality in LABEL_MODALITIES:
            np.testing.assert_array_equal(label_array(made.observation, modality), label_array(seen, modality))
        assert made.observation.objects == seen.objects
        for appearance, picture in zip(appearances, made.pictures, strict=True):
            expected = slow.shade(seen, appearance, sensor.name, made.number, batch.times[at])
            np.testing.assert_array_equal(picture, expected)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", [0, 1])
def test_a_frame_stream_has_the_renderers_bytes(
    plan: DatasetPlan, sensor: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The buffers are too small at first (small pictures have many edges), so that they must grow."""
    monkeypatch.setattr(frame_stream, "_EDGE_SAMPLES", 0.1)
    assert_equals_renderer(plan, sensor, "cpu")


@pytest.mark.slow
def test_a_full_raster_bin_loses_no_triangle(plan: DatasetPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_buffers, "_BIN_CAPACITY", 40)
    assert_equals_renderer(plan, 0, "cpu")


@pytest.mark.gpu
@pytest.mark.parametrize("sensor", [0, 1])
def test_a_frame_stream_on_a_gpu_has_the_bytes_of_the_cpu(plan: DatasetPlan, sensor: int) -> None:
    assert_equals_renderer(plan, sensor, "cuda:0")
