"""Masks and depth agree with those of PyBullet's TinyRenderer, an independent renderer.

This checks more than the rasteriser: TinyRenderer gets the meshes, the poses of the Trace and the camera of the plan,
so a flipped axis, a Trace that is one frame late or an offset of half a pixel would fail.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.modalities.instance import picture as instance_picture
from recipe_runtime.render.raster.observation import FrameLabels

from tests.runtime.oracle_tiny import TinyView, tiny_render
from tests.runtime.simulation.in_process import simulate
from tests.sources import ROOT

LARGE = 1000  # pixels; smaller masks are not compared
IOU = 0.995  # an offset of half a pixel would reduce the IoU of a pedestrian of 5000 pixels by 0.06
NEARNESS = 2e-5  # of 1 / depth, in 1/m: from the corners' grid of 1/256 pixel and TinyRenderer's single precision
SHARE = 0.999  # of the pixels away from edges

# A sedan behind a van behind a bus, and people before, between and behind them; all move.
STREET = """
recipe: oracle_street
seed: 5
base:
  clock: {fps: 10, frames: 13}
  town: {name: downtown, blocks: [1, 1], seed: 3}
  weather: ClearNoon
  actors:
    bus: {blueprint: vehicle.bus.city, start: {x: 1.5, y: -2, yaw: 90}, route: [{x: 1.5, y: 20}], speed: 3}
    van: {blueprint: vehicle.van.a, start: {x: -1.6, y: 7, yaw: -90}, route: [{x: -1.6, y: -20}], speed: 2}
    sedan: {blueprint: vehicle.sedan.a, start: {x: -1.6, y: 14, yaw: -90}, route: [{x: -1.6, y: -20}], speed: 3}
    near: {blueprint: walker.pedestrian.0004, start: {x: -4.6, y: 2}, goal: {x: -4.6, y: -8}, speed: 1.2}
    far: {blueprint: walker.pedestrian.0009, start: {x: 4.4, y: 3}, goal: {x: 4.4, y: 12}, speed: 1.2}
  sensors:
    across:                            # the van before the bus, and a person before both
      mount: {x: -7.6, y: 1, z: 1.7, yaw: 12}
      camera: {width: 800, height: 600, fov: 90}
      capture: [depth, instance]
    kerb:                              # a bin and a tree before the sedan
      mount: {x: -6.8, y: 13.6, z: 1.4, yaw: 5}
      camera: {width: 800, height: 600, fov: 80}
      capture: [depth, instance]
    flying:                            # it moves and turns about all axes
      mount: {x: -6, y: -6, z: 4, yaw: 55, pitch: 20, roll: 25}
      camera: {width: 640, height: 640, fov: 75}
      capture: [depth, instance]
      motion:
        linear: {to: {x: 3, y: 1, z: 1}, speed: 4}
        rotation: {yaw: [-10, 10], pitch: [-8, 8], period: 1}
        jitter: {x: 0.05, y: 0.05, z: 0.05, roll: 3, yaw: 2}
    dash:                              # on the sedan: it looks at the van's back
      mount: {on: sedan, x: 0.5, z: 1.3, pitch: 4}
      camera: {width: 640, height: 480, fov: 70}
      capture: [depth, instance]
"""


LISTING_FRAMES = {97: {"hero2"}, 150: {"hero1", "hero2"}, 203: {"hero1", "hero2"}}

# Sensor, frame, the large objects, and the partly hidden objects in view.
STREET_VIEWS: list[tuple[str, int, set[str], set[str]]] = [
    ("across", 0, {"bus", "van", "near"}, set()),
    ("across", 12, {"bus", "van", "near"}, {"bus"}),
    ("kerb", 1, {"sedan", "van"}, set()),
    ("flying", 3, {"bus", "van", "near"}, {"sedan"}),
    ("flying", 11, {"bus", "van"}, {"sedan"}),
    ("dash", 8, {"bus", "van", "sedan", "far"}, {"bus"}),
]


class ComparedScene:
    """A scene, and TinyRenderer's views of it, rendered by one process."""

    def __init__(self, scenario: ScenarioPlan, wanted: list[tuple[str, int]]) -> None:
        scene = scenario.scene
        self.source = SceneSource(scene, simulate(scene))
        self.sensors = {sensor.name: sensor for sensor in scenario.rig.sensors}
        self.names = {actor.tag * 1000 + actor.instance: actor.name for actor in scene.actors}
        trace = self.source.trace
        views = [
            TinyView(frame, self.sensors[name].camera, sensor_transform(self.sensors[name], trace, frame))
            for name, frame in wanted
        ]
        self.theirs = dict(zip(wanted, tiny_render(scene, trace, views, within=2000.0), strict=True))


@pytest.fixture(scope="module")
def listing() -> ComparedScene:
    """Return the paper's listing without changes."""
    plan = compile_recipe(ROOT / "recipes" / "paper" / "two_pedestrians.yaml").plan.variants[0]
    return ComparedScene(plan, [("street", frame) for frame in LISTING_FRAMES])


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> ComparedScene:
    path = tmp_path_factory.mktemp("oracle") / "recipe.yaml"
    path.write_text(STREET)
    views = [(sensor, frame) for sensor, frame, _, _ in STREET_VIEWS]
    return ComparedScene(compile_recipe(path).plan.variants[0], views)


@pytest.mark.slow
@pytest.mark.parametrize("frame", LISTING_FRAMES)
def test_the_papers_listing(listing: ComparedScene, frame: int, tmp_path: Path) -> None:
    large, _ = compare(listing, "street", frame, tmp_path)
    assert large == LISTING_FRAMES[frame]


@pytest.mark.slow
@pytest.mark.parametrize(("sensor", "frame", "large", "hidden"), STREET_VIEWS)
def test_vehicles_and_what_hides_them(
    street: ComparedScene, sensor: str, frame: int, large: set[str], hidden: set[str], tmp_path: Path
) -> None:
    """`hidden` are the objects in view that partly occlude each other."""
    assert compare(street, sensor, frame, tmp_path) == (large, hidden)


def compare(scene: ComparedScene, sensor: str, frame: int, folder: Path) -> tuple[set[str], set[str]]:
    """Compare masks and depth of a frame with TinyRenderer's; return the large and the partly hidden objects."""
    seen = scene.source.observe(scene.sensors[sensor], frame)
    theirs, names = scene.theirs[sensor, frame], scene.names
    masks = {names[int(i)]: (seen.instance == i, theirs["instance"] == i) for i in np.unique(seen.instance) if i}
    overlaps = {name: overlap(a, b) for name, (a, b) in masks.items() if max(a.sum(), b.sum()) > LARGE}
    gaps = np.abs(1.0 / seen.depth.astype(float) - 1.0 / theirs["depth"])[inner(seen.instance, seen.depth)]
    agree = float((gaps <= NEARNESS).mean())
    if min(overlaps.values()) < IOU or agree < SHARE:
        picture = np.concatenate([instance_picture(m.astype(np.uint16)) for m in (seen.instance, theirs["instance"])])
        Image.fromarray(picture).save(folder / "ours_above_theirs.png")
        pytest.fail(f"masks {overlaps}, depth {agree:.5f}; see {folder / 'ours_above_theirs.png'}")
    assert isinstance(seen, FrameLabels)
    return set(overlaps), {view.name for view in seen.objects if 0 < view.visible < 0.95 * view.amodal}


def overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Return the intersection over union."""
    return float((a & b).sum() / (a | b).sum())


def inner(instance: NDArray[np.uint16], depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the mask of pixels inside a smooth surface: 1 / depth is linear in both directions."""
    near = 1.0 / depth.astype(float)
    flat = np.zeros(depth.shape, bool)
    bend_x = np.abs(near[1:-1, 2:] + near[1:-1, :-2] - 2 * near[1:-1, 1:-1])
    bend_y = np.abs(near[2:, 1:-1] + near[:-2, 1:-1] - 2 * near[1:-1, 1:-1])
    flat[1:-1, 1:-1] = np.maximum(bend_x, bend_y) < NEARNESS
    return flat
