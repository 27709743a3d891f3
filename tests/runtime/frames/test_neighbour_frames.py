"""The frame that motion blur takes the motion from, where traffic leaves the scene or enters it between two frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse, ScenePlan
from recipe_runtime.core.trace import METRE
from recipe_runtime.core.transforms import part_transforms
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.render.camera.motion_blur import NeighbourFrame

from tests.runtime import fakes


class _Noting(fakes.Renderer):
    """Note the frame that motion blur takes the motion from."""

    def __init__(self, scene: ScenePlan) -> None:
        super().__init__(scene)
        self.noted: list[object] = []

    def shade(
        self,
        obs: fakes.Seen,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: object = None,
    ) -> NDArray[np.uint8]:
        self.noted.append(neighbour)
        return super().shade(obs, appearance, sensor_name, frame, time, neighbour=neighbour)


@pytest.mark.parametrize(("frame", "other"), [(3, 2), (0, 1)])
@pytest.mark.parametrize("where", [(0, 380, 0), (20, 0, -1000)])
def test_traffic_that_enters_is_not_smeared_from_where_it_was(
    frame: int, other: int, where: tuple[int, int, int]
) -> None:
    """Regression: the pose far away, or below the ground, was taken for its motion: a blur of 0.35 picture widths."""
    scene = fakes.scene_plan(4)
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[other, 1] = np.array(where) * METRE
    trace = dataclasses.replace(trace, positions=positions)
    renderer, sensor = _Noting(scene), fakes.sensor_plan()
    source = SceneSource(scene, trace, engines=fakes.ENGINES, renderer=renderer)
    response = CameraResponse(motion_blur_intensity=1.0)
    appearance = fakes.appearance_plan().model_copy(update={"responses": {"street": response}})
    source.shade(source.observe(sensor, frame), appearance, sensor, frame)

    (neighbour,) = renderer.noted
    assert isinstance(neighbour, NeighbourFrame)
    expected = part_transforms(trace, other)
    expected[1] = part_transforms(trace, frame)[1]
    expected[1, 1, 3] -= 1.0 / scene.clock.fps  # its velocity is 1 m/s along y
    np.testing.assert_allclose(neighbour.parts, expected, atol=1e-12)
