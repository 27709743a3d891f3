"""The pictures of the crowds, with the boxes of their objects: four towns, three cameras each, five kinds of light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ActorPlan
from recipe_compiler.ir.semantic_tags import BODIES
from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.loading import compiled
from recipe_runtime.scenario import Scenario, Scenes

HERE = Path(__file__).parent
TOWNS = ("downtown", "plaza", "suburb", "highway")
WEATHERS = ("noon", "dusk", "night", "rain", "fog")
SWEEP = "weather_sweep"
CLASSES = ("person", "vehicle")
FRAMES = range(0, 25, 6)  # of a clip, three seconds apart

Row = tuple[str, float, float, float, float, float]
"""A detection: its class, x0, y0, x1, y1 in pixels, and its score."""

_MIN_VISIBLE = 0.5  # visible share of an object that a detector must find
_IN_PICTURE = 0.75


@dataclass(frozen=True)
class Truth:
    """An object in a picture.

    Attributes:
        label: One of `CLASSES`; empty for a two-wheeler with its rider, which may be detected as either.
        box: x0, y0, x1, y1 in pixels.
        wanted: Whether a detector must find it; others are neither right nor wrong.
        heavy: Whether it is a bus or a truck.
    """

    label: str
    box: tuple[float, float, float, float]
    wanted: bool
    heavy: bool = False


@dataclass(frozen=True)
class Picture:
    """A picture of a crowd or of an empty street."""

    town: str
    weather: str
    pixels: NDArray[np.uint8]  # [H, W, 3]
    truths: tuple[Truth, ...]
    empty: bool  # whether the street has no actors


def pictures(town: str, weather: str) -> Iterator[Picture]:
    """Render the pictures of a town in one kind of light: those of the crowd, then those of the empty streets."""
    plan, scenes = compiled(HERE / f"crowd_{town}.yaml"), Scenes()
    for variant in plan.variants:
        if not variant.variant.endswith(f"weather={weather}"):
            continue
        frames = FRAMES if variant.scene.actors else FRAMES[:1]
        yield from _shown(town, weather, Scenario(variant, scenes), frames)


def sweep() -> Iterator[Picture]:
    """Render frames of the still camera of recipes/weather_sweep.yaml, in all of its weathers and hours."""
    plan, scenes = compiled(HERE.parents[1] / "recipes" / "weather_sweep.yaml"), Scenes()
    for variant in plan.variants:
        if "jitter=still" in variant.variant:
            yield from _shown(SWEEP, variant.variant, Scenario(variant, scenes), range(0, 31, 6))


def _shown(place: str, weather: str, scenario: Scenario, frames: range) -> Iterator[Picture]:
    actors = {actor.name: actor for actor in scenario.plan.scene.actors}
    for sensor in scenario.sensors:
        for frame in frames:
            pixels = scenario.render(frame, sensor).astype(np.uint8)
            truths = tuple(_truth(row, actors[row["actor"]]) for row in scenario.labels(frame, sensor))
            yield Picture(place, weather, pixels, truths, not actors)


def _truth(row: LabelRecord, actor: ActorPlan) -> Truth:
    x, y, width, height = (float(value) for value in row["bbox"])
    two_wheels = actor.category == "vehicle" and "rider" in actor.shape
    label = "" if two_wheels else "person" if actor.category == "pedestrian" else "vehicle"
    clear = row["visible_fraction"] >= _MIN_VISIBLE and row["truncation"] <= 1.0 - _IN_PICTURE
    heavy = label == "vehicle" and "body" in actor.shape and BODIES[int(actor.shape["body"])] in ("bus", "truck")
    return Truth(label, (x, y, x + width, y + height), clear and not two_wheels, heavy)
