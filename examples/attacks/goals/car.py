"""Hiding a car: a texture of its whole body because of which a detector misses it, by distance, azimuth and weather."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from recipe_runtime.torch import Place

from benchmarks.pages import Table
from examples.attacks.goals import sheet
from examples.attacks.goals.detection import CAR, DETECTORS, RECIPES, Detection, noise, start
from examples.attacks.goals.parts import Part, Parts, Study
from examples.attacks.goals.scores import chosen_scores, scores, threshold

SEEN, HELD_OUT = ("sun", "cloudy", "sunset"), ("hard_rain", "fog", "night")
DISTANCES, AZIMUTHS = ("6m", "9m", "12m"), ("22", "67", "112", "157", "202", "247", "292", "337")  # of tests
SIZE = (96, 128)  # texels: height, width
OWN = (0x8B / 255, 0x90 / 255, 0x95 / 255)  # the car's own paint in the recipe

_PATCH = "paint"
_SEEN_DISTANCES, _SEEN_AZIMUTHS = ("6m", "12m"), ("0", "45", "90", "135", "180", "225", "270", "315")
_WEATHERS = {"rendered": SEEN, "one weather": SEEN[:1], "CenterNet": SEEN}
_OWN = "own paint"
_SHOWN_KINDS = (_OWN, "logo", "random", "rendered", "CenterNet")
_SHOWN = (
    ("sun", "6m", "22"),
    ("sunset", "9m", "67"),
    ("hard_rain", "9m", "157"),
    ("fog", "9m", "337"),
    ("night", "9m", "292"),
)


def run(kind: str, seed: int, steps: int) -> Part:
    """Attack with a kind of texture, or make one, and test it at a place that no attack has seen."""
    if kind == _OWN:
        texture = torch.tensor(OWN).reshape(1, 3, 1, 1).expand(-1, -1, *SIZE)
    elif kind == "logo":
        texture = _logo()
    elif kind == "random":
        texture = noise(SIZE, seed)
    else:
        detector = "CenterNet" if kind == "CenterNet" else "SSD"
        places = _places("square", _WEATHERS[kind], _SEEN_DISTANCES, _SEEN_AZIMUTHS)
        texture = _scene().attack(_PATCH, places, start(SIZE, seed), steps=steps, seed=seed, detector=detector)
    places = _places("motorway", (*SEEN, *HELD_OUT), DISTANCES, AZIMUTHS)
    return Part(_scene().test(_PATCH, places, texture), texture)


def tables(parts: Parts) -> dict[str, Table]:
    """Return the scores of each texture; and by distance, azimuth and weather."""
    found: dict[str, Table] = {}
    for detector in DETECTORS:
        least = threshold(parts[_OWN], detector)
        found[f"car, {detector}"] = [
            {"paint": kind, **scores(rows, detector, least, lambda place: _values(place)[2:])}
            for kind, rows in parts.items()
        ]
    return {**found, "car by view": _by_view(parts), "car grid": _grid(parts)}


def draw(parts: Parts, path: Path) -> None:
    """Write a sheet of some kinds: the first texture of each, in test frames."""
    places = [(_variant("motorway", *values), 0) for values in _SHOWN]
    least = threshold(parts[_OWN], DETECTORS[0])
    rows = []
    for kind in (kind for kind in _SHOWN_KINDS if kind in parts):
        pictures = _scene().pictures(_PATCH, places, parts[kind][0].textures)
        rows.append(sheet.row(kind, parts[kind][0], least, places, pictures))
    sheet.save(rows, path)


def _by_view(parts: Parts) -> Table:
    groups = [(2, value, f"{value[:-1]} m", value in _SEEN_DISTANCES) for value in DISTANCES]
    groups += [(3, value, f"{value} degrees", False) for value in AZIMUTHS]
    groups += [(1, value, value.replace("_", " "), value in SEEN) for value in (*SEEN, *HELD_OUT)]
    return [
        {"view": title + ("" if seen else " (held out)")}
        | {
            kind: f"{chosen_scores(found, DETECTORS[0], partial(_matches, {axis: value})).mean():.2f}"
            for kind, found in parts.items()
        }
        for axis, value, title, seen in groups
    ]


def _grid(parts: Parts) -> Table:
    """Return the mean score of the car in its own paint and in the optimised texture, in each cell."""
    compared = [kind for kind in (_OWN, "rendered") if kind in parts]
    rows = []
    for distance in DISTANCES:
        for weather in (*SEEN, *HELD_OUT):
            row = {"distance": f"{distance[:-1]} m", "weather": weather.replace("_", " ")}
            for azimuth in AZIMUTHS:
                cell = partial(_matches, {1: weather, 2: distance, 3: azimuth})
                means = [chosen_scores(parts[kind], DETECTORS[0], cell).mean() for kind in compared]
                row[f"{azimuth}°"] = " → ".join(f"{value:.2f}" for value in means)
            rows.append(row)
    return rows


def _matches(wanted: dict[int, str], place: Place) -> bool:
    """Return whether a place has the wanted values, by their index in `_values`."""
    return all(_values(place)[index] == value for index, value in wanted.items())


def _places(
    place: str, weathers: tuple[str, ...], distances: tuple[str, ...], azimuths: tuple[str, ...]
) -> list[Place]:
    return [(_variant(place, w, d, a), 0) for d in distances for a in azimuths for w in weathers]


def _variant(place: str, weather: str, distance: str, azimuth: str) -> str:
    return f"place={place},weather={weather},distance={distance},azimuth={azimuth}"


def _values(place: Place) -> tuple[str, ...]:
    """Return place, weather, distance and azimuth."""
    return tuple(pair.partition("=")[2] for pair in place[0].split(","))


def _logo() -> torch.Tensor:
    """Return the picture of rings and stripes of recipes/attacks/poster.yaml as a texture."""
    with Image.open(RECIPES / "poster.png") as image:
        pixels = np.asarray(image.convert("RGB").resize(SIZE[::-1], Image.Resampling.BOX))
    return torch.tensor(pixels.transpose(2, 0, 1)[None] / 255, dtype=torch.float32)


@cache
def _scene() -> Detection:
    return Detection("car_views", "car", CAR)


STUDY = Study(
    name="car",
    plain=(_OWN, "logo"),
    seeded=("CenterNet", "rendered", "one weather", "random"),
    steps=240,
    cost=34,
    run=run,
    tables=tables,
    draw=draw,
)
