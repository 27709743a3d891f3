"""Moving sensors in a simulated scene: the pictures fit the compiler's arms and routes."""

from __future__ import annotations

import numpy as np
import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_compiler.ir.rig.arm import PIVOT
from recipe_runtime.core.trace import METRE
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.frames.source import SceneSource

from tests.runtime.simulation.in_process import simulate

# A walk along buildings and walls.
WALK = """
recipe: walk
seed: 3
base:
  clock: {fps: 10, frames: 31}
  town: {name: downtown, seed: 1, blocks: [1, 1]}
  weather: ClearNoon
  actors:
    hero: {blueprint: walker.pedestrian.0002, speed: 1.5, start: {x: -6, y: 0}, goal: {x: -6, y: -12}}
  sensors:
    arm:
      mount: {on: hero, x: -4, z: 2, attachment: spring_arm}
      camera: {width: 64, height: 48, fov: 60}
      capture: [instance]
    side:                              # 12 m to the right: behind the walls
      mount: {}
      camera: {width: 64, height: 48, fov: 60}
      capture: [instance]
      motion: {follow: {actor: hero, distance: 12, height: 3, bearing: -90}}
    through:
      mount: {}
      camera: {width: 64, height: 48, fov: 60}
      capture: [instance]
      motion: {follow: {actor: hero, distance: 12, height: 3, bearing: -90, collision: false}}
    shaken:
      mount: {}
      camera: {width: 64, height: 48, fov: 60}
      capture: [rgb, depth, instance, semantic]
      motion: {follow: {actor: hero, distance: 4, height: 2}, jitter: {yaw: 8, pitch: 8}}
"""


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> ScenarioPlan:
    path = tmp_path_factory.mktemp("walk") / "recipe.yaml"
    path.write_text(WALK)
    return compile_recipe(path).plan.variants[0]


@pytest.fixture(scope="module")
def source(walk: ScenarioPlan) -> SceneSource:
    return SceneSource(walk.scene, simulate(walk.scene))


def test_an_actors_origin_is_near_the_ground(source: SceneSource) -> None:
    """So the arm's start, at a height above it, is at the centre of the person; walking moves it slightly."""
    heights = source.trace.positions[:, source.trace.base_part("hero"), 2] / METRE
    assert np.abs(heights - 0.15).max() < 0.07  # on a sidewalk


@pytest.mark.slow
@pytest.mark.parametrize("name", ["arm", "side"])
def test_the_actor_is_at_the_centre_of_the_picture(walk: ScenarioPlan, source: SceneSource, name: str) -> None:
    (sensor,) = (s for s in walk.rig.sensors if s.name == name)
    (hero,) = walk.scene.actors
    for frame in (0, 15, 30):
        seen = source.observe(sensor, frame)
        assert seen.instance[23:26, 31:33].max() == hero.tag * 1000 + hero.instance


def test_a_follower_comes_nearer_only_in_front_of_a_building(walk: ScenarioPlan, source: SceneSource) -> None:
    rig = {sensor.name: sensor for sensor in walk.rig.sensors}
    origin = source.trace.positions[10, source.trace.base_part("hero")] / METRE
    far, near = (sensor_transform(rig[name], source.trace, 10)[:, 3] - origin for name in ("through", "side"))
    assert np.hypot(*far[:2]) == pytest.approx(12.0, abs=1e-5) and far[2] == pytest.approx(3.0, abs=1e-5)
    assert 1.0 < np.hypot(*near[:2]) < 8.0
    assert np.cross(near - [0, 0, PIVOT], far - [0, 0, PIVOT]) == pytest.approx([0, 0, 0], abs=1e-5)


def test_all_modalities_of_a_shaken_sensor_have_one_pose(walk: ScenarioPlan, source: SceneSource) -> None:
    """The actor's pixels are the same in every label, and the centre of the picture moves."""
    sensor, places = walk.rig.sensors[3], set()
    (hero,) = walk.scene.actors
    for frame in range(4):
        seen = source.observe(sensor, frame)
        person = seen.instance == hero.tag * 1000 + hero.instance
        assert person.any() and np.array_equal(person, seen.semantic == hero.tag)
        assert seen.depth[person].max() < 6.0
        (record,) = source.labels(seen, sensor, frame)["objects"]
        assert record["area"] == person.sum()
        places.add(tuple(record["bbox"]))
    assert len(places) == 4
