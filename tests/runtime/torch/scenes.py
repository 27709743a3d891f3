"""Two small recipes with several patches and sensors, for tests of views."""

from __future__ import annotations

from pathlib import Path

from tests.compiler.modelling import png
from tests.runtime.insertion.images import smooth

STREET = """
recipe: street
seed: 3
base:
  clock: {{fps: 10, frames: 3}}
  town: {{name: downtown, blocks: [1, 1]}}
  actors:
    car: {{blueprint: vehicle.van.a, speed: 5, start: {{x: -1.6, y: 1}}, goal: {{x: -1.6, y: -30}}}}
  patches:
    poster: {{on: {{town: wall.1, size: {{width: 4, height: 2}}}}, texture: {{image: {poster}.png}}}}
    sticker:
      on: {{town: wall.1, at: {{x: 1, z: 1.4}}, size: {{width: 3, height: 1}}}}
      texture: {{image: {sticker}.png}}
    paint: {{on: {{actor: car}}, texture: {{image: {paint}.png}}}}
  sensors:
    left: {{mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}, camera: {{width: 96, height: 64, fov: 70}}, capture: [rgb]}}
    right: {{mount: {{x: 1.5, y: -5, z: 2.6, yaw: 150}}, camera: {{width: 96, height: 64, fov: 80}}, capture: [rgb]}}
    small: {{mount: {{x: 1.5, y: -6, z: 1.6, yaw: 140}}, camera: {{width: 48, height: 32, fov: 70}}, capture: [rgb]}}
deltas:
  weather: {{clear: {{}}, rainy: {{weather: HardRainNoon}}}}
"""
SQUARE = """
recipe: square
seed: 4
base:
  clock: {{fps: 10, frames: 1}}
  town: {{name: plaza}}
  patches:
    road: {{on: {{town: road.y.0.0, size: {{width: 4, height: 6}}}}, texture: {{image: {road}.png}}}}
  sensors:
    roof:
      mount: {{x: -37, y: -8, z: 4, yaw: 90, pitch: 20}}
      camera: {{width: 96, height: 64, fov: 70}}
      capture: [rgb]
"""
IMAGES = {"a": smooth(12, 20, 0, 1), "b": smooth(9, 14, 1, 2), "c": smooth(15, 11, 2, 2)}


def street(folder: Path, poster: str, sticker: str, paint: str) -> Path:
    """Write a recipe of a street whose patches show these images of `IMAGES`; `sticker` covers a part of `poster`."""
    return _written(folder, STREET.format(poster=poster, sticker=sticker, paint=paint))


def square(folder: Path, road: str) -> Path:
    """Write a recipe of another town, whose patch shows this image of `IMAGES`."""
    return _written(folder, SQUARE.format(road=road))


def _written(folder: Path, text: str) -> Path:
    for name, image in IMAGES.items():
        (folder / f"{name}.png").write_bytes(png(image))
    path = folder / f"{text.split()[1]}{len(list(folder.glob('*.yaml')))}.yaml"
    path.write_text(text)
    return path
