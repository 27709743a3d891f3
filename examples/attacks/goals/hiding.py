"""Hiding a person: a printed shirt, or a print on the chest, because of which a detector misses who wears it."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import torch
from recipe_runtime.torch import Place

from benchmarks.pages import Table
from examples.attacks.augmentation import THYS, WIDE
from examples.attacks.goals import sheet
from examples.attacks.goals.detection import DETECTORS, PERSON, Detection, noise, start
from examples.attacks.goals.parts import Part, Parts, Study
from examples.attacks.goals.scores import chosen_scores, scores, threshold

SEEN, HELD_OUT = ("sun", "cloudy", "sunset"), ("hard_rain", "fog", "night")
SIZES = {"shirt": (64, 64), "chest": (24, 20)}  # texels: height, width
PLAIN = (0x8C / 255, 0x3B / 255, 0x3B / 255)  # the shirt's own colour in the recipe

_TRAINING = [(run, frame) for run in ("", *(f"#{k}" for k in range(2, 9))) for frame in (0, 2, 4, 6)]
_TEST = [(run, frame) for run in ("#9", "#10", "#11", "#12") for frame in (1, 4, 7)]
_AUGMENTATIONS = {"digital": THYS, "digital, wide": WIDE}
_PLAIN = "shirt, plain"
_SHOWN_KINDS = (_PLAIN, "shirt, random", "shirt, rendered", "shirt, CenterNet", "chest, rendered", "chest, digital")
_SHOWN = (("sun", 4), ("sunset", 1), ("hard_rain", 7), ("fog", 4), ("night", 4))


def run(kind: str, seed: int, steps: int) -> Part:
    """Attack with a kind of texture, or make one, and test it in runs, frames and weathers that no attack has seen."""
    patch, _, how = kind.partition(", ")
    if how == "plain":
        texture = torch.tensor(PLAIN).reshape(1, 3, 1, 1).expand(-1, -1, *SIZES[patch])
    elif how == "random":
        texture = noise(SIZES[patch], seed)
    else:
        places, first = _places(patch, SEEN, _TRAINING), start(SIZES[patch], seed)
        augment = _AUGMENTATIONS.get(how)
        texture = _scene().attack(
            patch,
            places,
            first,
            steps=steps,
            seed=seed,
            detector="CenterNet" if how == "CenterNet" else "SSD",
            digital=augment is not None,
            augment=augment,
        )
    return Part(_scene().test(patch, _places(patch, (*SEEN, *HELD_OUT), _TEST), texture), texture)


def tables(parts: Parts) -> dict[str, Table]:
    """Return the scores of each kind, and the person's score by weather."""
    found: dict[str, Table] = {}
    for detector in DETECTORS:
        least = threshold(parts[_PLAIN], detector)
        found[f"hiding, {detector}"] = [
            {"print": kind, **scores(rows, detector, least, _moment)} for kind, rows in parts.items()
        ]
    return {**found, "hiding by weather": _by_weather(parts)}


def draw(parts: Parts, path: Path) -> None:
    """Write a sheet of some kinds: the first texture of each, in test frames."""
    rows, least = [], threshold(parts[_PLAIN], DETECTORS[0])
    for kind in (kind for kind in _SHOWN_KINDS if kind in parts):
        patch, found = kind.partition(", ")[0], parts[kind]
        places = [(_variant(weather, patch, "#10"), frame) for weather, frame in _SHOWN]
        rows.append(sheet.row(kind, found[0], least, places, _scene().pictures(patch, places, found[0].textures)))
    sheet.save(rows, path)


def _by_weather(parts: Parts) -> Table:
    rows = []
    for weather in (*SEEN, *HELD_OUT):
        row = {"weather": weather.replace("_", " ") + ("" if weather in SEEN else " (held out)")}
        for kind, found in parts.items():
            row[kind] = f"{chosen_scores(found, DETECTORS[0], partial(_has_weather, weather)).mean():.2f}"
        rows.append(row)
    return rows


def _places(patch: str, weathers: tuple[str, ...], moments: list[tuple[str, int]]) -> list[Place]:
    return [(_variant(weather, patch, run), frame) for run, frame in moments for weather in weathers]


def _variant(weather: str, patch: str, run: str) -> str:
    return f"weather={weather},print={patch}{run}"


def _has_weather(weather: str, place: Place) -> bool:
    return place[0].startswith(f"weather={weather},")


def _moment(place: Place) -> tuple[str, int]:
    return "".join(place[0].partition("#")[1:]), place[1]


@cache
def _scene() -> Detection:
    return Detection("hiding", "target", PERSON)


STUDY = Study(
    name="hiding",
    plain=(_PLAIN, "chest, plain"),
    seeded=(
        "shirt, CenterNet",
        "shirt, rendered",
        "chest, rendered",
        "chest, digital",
        "chest, digital, wide",
        "shirt, random",
        "chest, random",
    ),
    steps=240,
    cost=42,
    run=run,
    tables=tables,
    draw=draw,
)
