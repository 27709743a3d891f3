"""Tables and the sheet of the study."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.pages import Table
from benchmarks.paper import sheets
from examples.attacks.experiment import BATCH, HELD_OUT, MANY, ONE, REACH, SIZE, Experiment, weather_of
from examples.attacks.intervals import Interval, over_seeds, paired
from examples.attacks.results import FOUND, Results

GROUPS = {"sun": ONE, "five other weathers": MANY[1:], "six held-out weathers": HELD_OUT}

_DIFFERENCES = (
    ("many weathers", "one weather"),
    ("many weathers", "digital"),
    ("many weathers", "many weathers, false gradient"),
)
_SHOWN = ("logo", "digital", "one weather", "many weathers")
_SHOWN_WEATHERS = ("sun", "shade", "fog", "hard_rain", "dust", "night")
_SHOWN_FRAME = 18
_CELL, _BOX_COLOUR, _BOX_WIDTH = 160, (255, 230, 40), 4  # pixels


def tables(results: Results) -> dict[str, Table]:
    """Return the study's tables by name."""
    return {
        "success": _success(results),
        "scores by weather": _by_weather(results),
        "differences": _differences(results),
        "gradients": _gradients(results),
        "settings": _settings(results),
    }


def draw(results: Results, experiment: Experiment, path: Path) -> None:
    """Write a sheet of textures in weathers, with the score, and the box where a person is found."""
    cells, numbers = [], [_frame_of(results, weather) for weather in _SHOWN_WEATHERS]
    for name in _SHOWN:
        outcome = results.outcomes[name][0]
        cells.append((name, _pixels(torch.nn.functional.pad(outcome.texture[0], (9, 9, 0, 0), value=1.0))))
        shown = experiment.seen(outcome.texture, [results.frames[number] for number in numbers])
        for weather, number, picture, box in zip(_SHOWN_WEATHERS, numbers, *shown, strict=True):
            pixels, score = _pixels(picture), outcome.rendered[number]
            if score >= FOUND:
                _outline(pixels, box)
            cells.append((f"{_words(weather)}: {score:.2f}", pixels))
    sheets.save(sheets.Sheet(tuple(cells), len(_SHOWN_WEATHERS) + 1, (_CELL, _CELL)), path)


def _success(results: Results) -> Table:
    rows = [_success_row(results, name, name) for name in results.outcomes]
    return [*rows, _success_row(results, "digital", "digital, inserted digitally", inserted=True)]


def _success_row(results: Results, name: str, title: str, inserted: bool = False) -> dict[str, str]:
    rates = {
        group: f"{_text(over_seeds(results.found(name, weathers, inserted)))} %" for group, weathers in GROUPS.items()
    }
    return {"texture": title, **rates, "mean score": f"{np.mean(results.scores(name, HELD_OUT, inserted)):.2f}"}


def _by_weather(results: Results) -> Table:
    return [
        {"weather": _words(weather)}
        | {name: f"{np.mean(results.scores(name, [weather])):.2f}" for name in results.outcomes}
        for weather in (*MANY, *HELD_OUT)
    ]


def _differences(results: Results) -> Table:
    rows = []
    for name, other in _DIFFERENCES:
        row = {"attack": name, "less": other}
        for group, weathers in GROUPS.items():
            apart = paired(results.found(name, weathers), results.found(other, weathers))
            row[group] = f"{_text(apart, sign='+')}{' *' if apart.excludes_zero else ''}"
        score = paired(*([float(np.mean(s)) for s in results.scores(n, HELD_OUT)] for n in (name, other)))
        row["mean score"] = f"{_text(score, 2, '+')}{' *' if score.excludes_zero else ''}"
        rows.append(row)
    return rows


def _gradients(results: Results) -> Table:
    return [
        {"weather": _words(weather), "cosine": _text(over_seeds([row[weather] for row in results.cosines]), 3)}
        for weather in (*MANY, *HELD_OUT)
    ]


def _settings(results: Results) -> Table:
    attacks = results.outcomes["many weathers"]
    settings = {
        "seeds of each attack": len(attacks),
        "steps": len(attacks[0].losses),
        "frames in a step": BATCH,
        "test frames": len(results.frames),
        "texels": f"{SIZE[1]} x {SIZE[0]}",
        "largest change of a texel": REACH,
    }
    return [{name: str(value) for name, value in settings.items()}]


def _frame_of(results: Results, weather: str) -> int:
    """Return the index of the test frame that the sheet shows of a weather."""
    return next(
        number
        for number, (variant, frame) in enumerate(results.frames)
        if weather_of(variant) == weather and frame == _SHOWN_FRAME
    )


def _words(weather: str) -> str:
    return weather.replace("_", " ")


def _text(interval: Interval, digits: int = 0, sign: str = "") -> str:
    mean = f"{interval.mean:{sign}.{digits}f}"
    return mean if math.isnan(interval.half) else f"{mean} ± {interval.half:.{digits}f}"


def _pixels(picture: torch.Tensor) -> NDArray[np.uint8]:
    pixels: NDArray[np.uint8] = (picture.permute(1, 2, 0) * 255).round().to(torch.uint8).numpy().copy()
    return pixels


def _outline(pixels: NDArray[np.uint8], box: torch.Tensor) -> None:
    """Draw a box, x0, y0, x1, y1."""
    height, width = pixels.shape[:2]
    x0, y0, x1, y1 = (int(v) for v in box.round().tolist())
    left, top, right, bottom = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    inner = slice(top + _BOX_WIDTH, bottom - _BOX_WIDTH), slice(left + _BOX_WIDTH, right - _BOX_WIDTH)
    kept = pixels[inner].copy()
    pixels[top:bottom, left:right] = _BOX_COLOUR
    pixels[inner] = kept
