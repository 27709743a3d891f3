"""Frames are computed in batches."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.plan import Clock, Pose, ScenePlan, TownPlan
from recipe_runtime.simulation import loop, recording

from tests.runtime.simulation.test_collisions import actor


def made(scene: ScenePlan) -> list[tuple[int, bytes]]:
    """Return the frames of a scene, with their numbers."""
    frames: list[tuple[int, bytes]] = []
    loop.run(scene, lambda number, data: frames.append((number, data)), lambda _step, _steps: None)
    return frames


@pytest.mark.parametrize("frames", [1, 7, 12])
def test_frames_do_not_depend_on_the_batch_size(monkeypatch: pytest.MonkeyPatch, frames: int) -> None:
    """With cars, people and two-wheelers, in batches of every size."""
    globs = ["vehicle.sedan.a", "walker.pedestrian.0001", "vehicle.bicycle.a", "vehicle.motorcycle.a"]
    globs += ["vehicle.bus.*", "walker.pedestrian.0009"]
    actors = tuple(
        actor(f"a{k}", glob, Pose(y=6.0 * k), (60.0, 6.0 * k), speed=1.4 if "walker" in glob else 6.0)
        for k, glob in enumerate(globs)
    )
    scene = ScenePlan(
        clock=Clock(fps=30, frames=frames, physics=240), town=TownPlan(name="flat", elements=()), actors=actors
    )
    found = []
    for rows in (1, 18, 1024):
        monkeypatch.setattr(recording, "_ROWS", rows)
        found.append(made(scene))
    assert [number for number, _ in found[0]] == list(range(frames))
    assert found[0] == found[1] == found[2]


def test_a_scene_without_actors_has_frames() -> None:
    scene = ScenePlan(clock=Clock(fps=30, frames=3, physics=240), town=TownPlan(name="flat", elements=()), actors=())
    assert len(made(scene)) == 3
