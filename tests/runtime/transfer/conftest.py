"""Datasets that several formats export: `tiny` of the fakes, and `attacked`, rendered, with patches."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.frames.engines import Engines
from recipe_runtime.loading import opened

from tests.runtime.fakes import ENGINES, dataset_plan

RECIPE = """
recipe: attacked
seed: 3
base:
  clock: {fps: 10, frames: 3}
  town: {name: downtown, blocks: [1, 1]}
  actors:
    car: {blueprint: vehicle.van.a, speed: 5, start: {x: -1.6, y: 1}, goal: {x: -1.6, y: -30}}
    hero: {blueprint: walker.pedestrian.0001, speed: 1, start: {x: -4.5, y: -0.5}, goal: {x: -4.5, y: -9}}
  patches:
    poster: {on: {town: wall.1, size: {width: 4, height: 2}}, mode: green}
  sensors:
    street:
      mount: {x: 1.5, y: -6, z: 1.6, yaw: 140}
      camera: {width: 96, height: 72, fov: 70}
      capture: [rgb, depth]
    away: {mount: {x: 1.5, y: -6, z: 1.6, yaw: -40}, camera: {width: 96, height: 72, fov: 70}, capture: [rgb]}
deltas:
  weather:
    clear: {}
    foggy:
      weather: {fog_density: 50}
      patches: {banner: {on: {actor: car, surface: left, size: {width: 1.5, height: 0.5}}, texture: {color: "#102030"}}}
"""


def made(plan: DatasetPlan, out: Path, engines: Engines = ENGINES) -> Dataset:
    """Build a dataset in this process, with a cache beside it."""
    return read(build(plan, out, BuildOptions(workers=0, cache=out.parent / "cache", engines=engines)).path)


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return made(dataset_plan(), tmp_path_factory.mktemp("tiny") / "tiny")


@pytest.fixture(scope="session")
def built(tiny: Dataset) -> Path:
    """Return the folder of `tiny`."""
    return tiny.root


@pytest.fixture(scope="session")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("attacked") / "recipe.yaml"
    path.write_text(RECIPE)
    return path


@pytest.fixture(scope="session")
def attacked(recipe: Path) -> Dataset:
    plan, engines = opened(recipe)
    return made(plan, recipe.parent / "out", engines)
