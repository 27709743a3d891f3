"""People who sit, talk or telephone: feet on the ground, hips on the seat, a fitting box; they stay in place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ActorPlan, ScenePlan
from recipe_runtime.annotate.actor_boxes import body_box
from recipe_runtime.body import walk_cycle
from recipe_runtime.body.skeleton import Figure
from recipe_runtime.core.trace import METRE
from recipe_runtime.core.transforms import rigid_transform

from tests.runtime.simulation.in_process import simulate

RECIPE = """
recipe: poses
seed: 3
base:
  clock: {{fps: 10, frames: 40}}
  town: {{name: plaza}}
  weather: ClearNoon
  traffic: {{pedestrians: {traffic}}}
  actors:
    who: {{blueprint: {blueprint}, start: {start}{more}}}
  sensors:
    s: {{mount: {{z: 4}}, camera: {{width: 64, height: 48}}, capture: [rgb]}}
"""
START = "{x: 12, y: 4, yaw: 180}"
BENCH = "{x: 12.85, y: 8, yaw: 180}"  # on bench.cell.6.4.0


def scene(
    folder: Path, more: str, start: str = START, blueprint: str = "walker.pedestrian.0001", traffic: int = 0
) -> ScenePlan:
    path = folder / "poses.yaml"
    path.write_text(RECIPE.format(start=start, blueprint=blueprint, more=more, traffic=traffic))
    return compile_recipe(path).plan.variants[0].scene


def who(found: ScenePlan) -> ActorPlan:
    return next(actor for actor in found.actors if actor.name == "who")


def places(actor: ActorPlan) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    """Return the origins of the parts of an actor who stands or sits at the origin."""
    figure = Figure.of(actor.shape)
    poses = walk_cycle.steady_pose(figure, 0.0, 0.0)
    names = ["pelvis", *(joint.part for joint in figure.joints)]
    return {name: rigid_transform(*pose)[:, 3] for name, pose in zip(names, poses, strict=True)}


@pytest.mark.parametrize("blueprint", ["walker.pedestrian.0001", "walker.pedestrian.0009", "walker.pedestrian.0012"])
def test_a_seated_person_has_hips_on_the_seat_and_feet_on_the_ground(tmp_path: Path, blueprint: str) -> None:
    actor = who(scene(tmp_path, ", pose: sit", blueprint=blueprint))
    figure, at = Figure.of(actor.shape), places(actor)
    for side in ("left", "right"):
        assert at[f"thigh_{side}"][2] == pytest.approx(0.45 + 0.062 * figure.height, abs=1e-3)
        assert at[f"foot_{side}"][2] == pytest.approx(figure.ankle, abs=0.01)
        assert at[f"shin_{side}"][2] > 0.35 and at[f"foot_{side}"][0] > 0.7 * figure.thigh
    box = body_box(actor)
    assert 0.3 + 0.5 * figure.height < box.high[2] < 0.5 + 0.6 * figure.height
    assert box.high[0] - box.low[0] > figure.thigh


def test_talking_moves_the_arms_and_not_the_feet(tmp_path: Path) -> None:
    talking, standing = (places(who(scene(tmp_path, more))) for more in (", pose: talk", ", speed: 0"))
    for part in standing:
        moved = float(np.abs(talking[part] - standing[part]).max())
        assert (moved > 0.02) == part.startswith(("forearm", "hand")), part


def test_telephoning_is_that_of_blueprints(tmp_path: Path) -> None:
    assert who(scene(tmp_path, ", pose: telephone, speed: 0")).shape["phone"] == 1.0
    assert who(scene(tmp_path, ", pose: telephone, goal: {x: 12, y: 6}")).route


def test_a_recipe_without_a_pose_has_the_plan_of_before(tmp_path: Path) -> None:
    assert "pose" not in who(scene(tmp_path, "")).shape


@pytest.mark.slow
@pytest.mark.parametrize("start", [START, BENCH])
def test_a_seated_person_stays_while_others_walk_around(tmp_path: Path, start: str) -> None:
    found = scene(tmp_path, ", pose: sit", start=start, traffic=30)
    trace = simulate(found)
    places = trace.positions[:, trace.base_part("who")] / METRE
    assert np.abs(places[:, :2] - (who(found).start.x, who(found).start.y)).max() < 1e-3
    others = [trace.base_part(actor.name) for actor in found.actors if actor.name != "who"]
    apart = trace.positions[:, others, :2] / METRE - places[:, None, :2]
    assert np.sqrt((apart**2).sum(axis=-1)).min() > 0.3


@pytest.mark.parametrize(
    ("blueprint", "more", "words"),
    [
        ("vehicle.sedan.a", ", pose: sit", "only pedestrians have a pose"),
        ("walker.pedestrian.0001", ", pose: sit, goal: {x: 12, y: 6}", "stays at the start"),
        ("walker.pedestrian.0001", ", pose: talk, speed: 1", "stays at the start"),
        ("walker.pedestrian.0001", ", pose: dance", "talk"),
    ],
)
def test_mistakes(tmp_path: Path, blueprint: str, more: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        scene(tmp_path, more, blueprint=blueprint)
    assert "poses.yaml:9" in str(caught.value) or caught.value.problems[0].place is not None
