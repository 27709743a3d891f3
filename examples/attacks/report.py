"""Tables and the sheet of the study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.pages import Table
from benchmarks.paper import sheets
from examples.attacks.detectors import DETECTORS
from examples.attacks.experiment import (
    ATTACKS,
    BATCH,
    HELD_OUT,
    MANY,
    MOMENTS,
    ONE,
    REACH,
    SCENES,
    SIZE,
    WEATHERS,
    seen,
)
from examples.attacks.results import FOUND, Results, Values, found
from examples.attacks.statistics import Interval, difference, success

GROUPS = {"morning": ONE, "five other weathers": MANY[1:], "six held-out weathers": HELD_OUT}
THRESHOLDS = (0.3, 0.5, 0.7)

_DIFFERENCES = (
    ("many weathers", "one weather"),
    ("many weathers", "digital"),
    ("many weathers", "digital, augmented"),
    ("many weathers", "digital, widely augmented"),
    ("many weathers, augmented", "digital, augmented"),
    ("many weathers, widely augmented", "digital, widely augmented"),
    ("digital, widely augmented", "digital, augmented"),
    ("many weathers, widely augmented", "many weathers"),
    ("many weathers, false gradient", "many weathers"),
)
_LONG = tuple(name for name, attack in ATTACKS.items() if attack.transferred)
_SHOWN = ("logo", "digital", "digital, widely augmented", "many weathers")
_SHOWN_WEATHERS = ("morning", "afternoon", "fog", "hard_rain", "dust", "night")
_CELL, _BOX_COLOUR, _BOX_WIDTH = 160, (255, 230, 40), 4  # pixels


def tables(results: Results) -> dict[str, Table]:
    """Return the study's tables by name."""
    return {
        "success": _success(results),
        "differences": _differences(results),
        "scenes": _by_scene(results),
        "steps": _by_steps(results),
        "transfer between detectors": _between_detectors(results),
        "transfer between scenes": _between_scenes(results),
        "scores by weather": _by_weather(results),
        "thresholds": _by_threshold(results),
        "gradients": _gradients(results),
        "settings": _settings(results),
    }


def draw(results: Results, path: Path) -> None:
    """Write a sheet of textures in weathers, with the score, and the box where a person is found."""
    scene, attacked = next(iter(SCENES)), next(iter(DETECTORS))
    cells, numbers = [], [WEATHERS.index(weather) for weather in _SHOWN_WEATHERS]
    for name in _SHOWN:
        texture = results.texture(name, scene, attacked, results.seeds[0])
        poster = _pixels(torch.nn.functional.pad(texture[0], (9, 9, 0, 0), value=1.0))
        cells.append((name.replace("widely augmented", "wide range"), poster))
        scores = results.scores(name, _SHOWN_WEATHERS, attacked=[attacked], scenes=[scene])[0, 0, 0]
        pictures, boxes = seen(scene, attacked, texture, numbers)
        for weather, score, picture, box in zip(_SHOWN_WEATHERS, scores, pictures, boxes, strict=True):
            pixels = _pixels(picture)
            if score >= FOUND:
                _outline(pixels, box)
            cells.append((f"{_words(weather)}: {score:.2f}", pixels))
    sheets.save(sheets.Sheet(tuple(cells), len(_SHOWN_WEATHERS) + 1, (_CELL, _CELL)), path)


def _success(results: Results) -> Table:
    named = [("logo", "logo", False), ("noise on the logo", "noise on the logo", False)]
    named += [(name, name, False) for name in ATTACKS]
    named += [(name, f"{name}, inserted digitally", True) for name in ATTACKS if ATTACKS[name].insertion == "digital"]
    return [
        {"texture": title}
        | {group: _rate(results.scores(name, which, inserted=inserted)) for group, which in GROUPS.items()}
        | {"mean score": f"{results.scores(name, HELD_OUT, inserted=inserted).mean():.2f}"}
        for name, title, inserted in named
    ]


def _differences(results: Results) -> Table:
    rows = []
    for name, other in _DIFFERENCES:
        row = {"attack": name, "minus": other}
        for group, weathers in GROUPS.items():
            row[group] = _apart(*(found(results.scores(which, weathers)) for which in (name, other)))
        for attacked in DETECTORS:
            pair = (found(results.scores(which, HELD_OUT, attacked=[attacked])) for which in (name, other))
            row[f"held-out, {attacked}"] = _apart(*pair)
        rows.append(row)
    return rows


def _by_scene(results: Results) -> Table:
    return [
        {"attack": name}
        | {
            f"{attacked}, {scene}": _rate(results.scores(name, HELD_OUT, attacked=[attacked], scenes=[scene]))
            for attacked in DETECTORS
            for scene in SCENES
        }
        for name in ATTACKS
    ]


def _by_steps(results: Results) -> Table:
    return [
        {"attack": name}
        | {
            f"{attacked}, {steps} steps": _rate(results.scores(name, HELD_OUT, attacked=[attacked], steps=steps))
            for attacked in DETECTORS
            for steps in results.steps
        }
        for name in ATTACKS
    ]


def _between_detectors(results: Results) -> Table:
    return [
        {"attack": name, "attacked": attacked}
        | {
            f"tested on {tested}": _rate(results.scores(name, HELD_OUT, attacked=[attacked], tested=tested))
            for tested in DETECTORS
        }
        for name in _LONG
        for attacked in DETECTORS
    ]


def _between_scenes(results: Results) -> Table:
    return [
        {"attack": name, "attacked in": scene}
        | {f"tested in {where}": _rate(results.scores(name, HELD_OUT, scenes=[scene], where=where)) for where in SCENES}
        for name in _LONG
        for scene in SCENES
    ]


def _by_weather(results: Results) -> Table:
    return [
        {"weather": _words(weather)}
        | {name: _percent(results.scores(name, [weather]) >= FOUND) for name in ("logo", *ATTACKS)}
        for weather in WEATHERS
    ]


def _by_threshold(results: Results) -> Table:
    return [
        {"attack": name}
        | {
            f"{attacked}, {least}": _percent(results.scores(name, HELD_OUT, attacked=[attacked]) >= least)
            for attacked in DETECTORS
            for least in THRESHOLDS
        }
        for name in ("logo", "noise on the logo", *ATTACKS)
    ]


def _gradients(results: Results) -> Table:
    columns = {attacked: results.cosines(attacked) for attacked in DETECTORS}
    return [
        {"weather": _words(weather)} | {attacked: _spread(rows[weather]) for attacked, rows in columns.items()}
        for weather in WEATHERS
    ]


def _settings(results: Results) -> Table:
    settings = {
        "scenes": len(SCENES),
        "seeds of each attack": len(results.seeds),
        "steps": results.steps[-1],
        "frames in a step": BATCH,
        "moments, attacked and tested": f"{MOMENTS} and {MOMENTS}",
        "texels": f"{SIZE[1]} x {SIZE[0]}",
        "largest change of a texel": REACH,
    }
    return [{name: str(value) for name, value in settings.items()}]


def _rate(scores: Values) -> str:
    """Return a success rate and its interval, such as "71 (52 to 84) %"."""
    return f"{_text(success(found(scores)), '.0f')} %"


def _apart(one: Values, other: Values) -> str:
    apart = difference(one, other)
    return f"{_text(apart, '+.0f')}{' *' if apart.excludes_zero else ''}"


def _percent(which: NDArray[np.bool_]) -> str:
    return f"{100 * which.mean():.0f} %"


def _text(interval: Interval, form: str) -> str:
    value, low, high = (format(100 * part, form) for part in (interval.value, interval.low, interval.high))
    return f"{value} ({low} to {high})"


def _spread(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _words(weather: str) -> str:
    return weather.replace("_", " ")


def _pixels(picture: torch.Tensor) -> NDArray[np.uint8]:
    pixels: NDArray[np.uint8] = (picture.permute(1, 2, 0) * 255).round().to(torch.uint8).numpy().copy()
    return pixels


def _outline(pixels: NDArray[np.uint8], box: Any) -> None:
    """Draw a box, x0, y0, x1, y1."""
    height, width = pixels.shape[:2]
    x0, y0, x1, y1 = (int(v) for v in box.round().tolist())
    left, top, right, bottom = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    inner = slice(top + _BOX_WIDTH, bottom - _BOX_WIDTH), slice(left + _BOX_WIDTH, right - _BOX_WIDTH)
    kept = pixels[inner].copy()
    pixels[top:bottom, left:right] = _BOX_COLOUR
    pixels[inner] = kept
