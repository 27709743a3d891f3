"""Tables and the sheet of the study."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.paper import sheets
from benchmarks.paper.__main__ import markdown
from examples.attacks.experiment import HELD_OUT, MANY, ONE, Experiment, Outcome
from examples.attacks.intervals import Interval, over_seeds, paired

FOUND = 0.5  # score from which a person counts as found
GROUPS = {"sun": ONE, "five other weathers of the attack": MANY[1:], "six held-out weathers": HELD_OUT}

_SHOWN_WEATHERS = ("sun", "shade", "fog", "hard_rain", "dust", "night")
_SHOWN = ("logo", "digital", "one weather", "many weathers")
_DIFFERENCES = (
    ("many weathers", "one weather"),
    ("many weathers", "digital"),
    ("many weathers", "many weathers, false gradient"),
)
_SHOWN_MOMENT = 1  # of the moments that are tested
_BOX_COLOUR = (255, 230, 40)

Table = list[dict[str, str]]


@dataclass(frozen=True)
class Results:
    """What the study measured.

    Attributes:
        weathers: Of each test frame.
        outcomes: By attack or texture, one a seed.
        cosines: Between exact and false gradient, by weather, one a seed.
    """

    weathers: list[str]
    outcomes: dict[str, list[Outcome]]
    cosines: list[dict[str, float]]

    def found(self, name: str, weathers: Sequence[str]) -> list[float]:
        """Return, for each seed, the percentage of the test frames of some weathers in which a person is found."""
        return [100 * float(np.mean(scores >= FOUND)) for scores in self.scores(name, weathers)]

    def scores(self, name: str, weathers: Sequence[str], inserted: bool = False) -> list[NDArray[np.float64]]:
        """Return the scores of each seed in the test frames of some weathers."""
        chosen = np.isin(self.weathers, weathers)
        return [np.array(o.inserted if inserted else o.rendered)[chosen] for o in self.outcomes[name]]


def tables(results: Results) -> list[str]:
    """Return the study's tables as Markdown."""
    return [markdown(table(results)) for table in (_by_group, _by_weather, _differences, _gradients)]


def draw(results: Results, experiment: Experiment, path: Path) -> None:
    """Write a sheet of textures in weathers, with the detector's score and its box where it finds a person."""
    cells = []
    for name in _SHOWN:
        outcome = results.outcomes[name][0]
        cells.append((name, _pixels(outcome.texture[0])))
        for weather in _SHOWN_WEATHERS:
            number = results.weathers.index(weather) + _SHOWN_MOMENT * len(set(results.weathers))
            picture, box = experiment.seen(outcome.texture, number)
            score = outcome.rendered[number]
            pixels = _pixels(picture)
            if score >= FOUND:
                _outline(pixels, box)
            cells.append((f"{weather.replace('_', ' ')}: {score:.2f}", pixels))
    sheets.save(cells, len(_SHOWN_WEATHERS) + 1, path, (200, 200))


def _by_group(results: Results) -> Table:
    rows = []
    for name in results.outcomes:
        row = {"texture": name}
        for group, weathers in GROUPS.items():
            row[group] = f"{_text(over_seeds(results.found(name, weathers)))} %"
        row["score, held-out weathers"] = f"{np.mean(results.scores(name, HELD_OUT)):.2f}"
        rows.append(row)
    inserted = [100 * float(np.mean(scores >= FOUND)) for scores in results.scores("digital", HELD_OUT, True)]
    score = np.mean(results.scores("digital", HELD_OUT, True))
    last = {"texture": "digital, as the attack sees it", "six held-out weathers": f"{_text(over_seeds(inserted))} %"}
    for group in (*GROUPS, "score, held-out weathers"):
        last.setdefault(group, "")
    last["score, held-out weathers"] = f"{score:.2f}"
    return [*rows, last]


def _by_weather(results: Results) -> Table:
    return [
        {"weather": weather.replace("_", " ")}
        | {name: f"{np.mean(results.scores(name, [weather])):.2f}" for name in results.outcomes}
        for weather in (*MANY, *HELD_OUT)
    ]


def _differences(results: Results) -> Table:
    rows = []
    for name, other in _DIFFERENCES:
        row = {"attack": name, "less": other}
        for group, weathers in GROUPS.items():
            apart = paired(results.found(name, weathers), results.found(other, weathers))
            row[group] = f"{_text(apart, sign=True)}{' *' if apart.excludes_zero else ''}"
        rows.append(row)
    return rows


def _gradients(results: Results) -> Table:
    return [
        {
            "weather": weather.replace("_", " "),
            "cosine": _text(over_seeds([row[weather] for row in results.cosines]), 3),
        }
        for weather in (*MANY, *HELD_OUT)
    ]


def _text(interval: Interval, digits: int = 0, sign: bool = False) -> str:
    mean = f"{interval.mean:{'+' if sign else ''}.{digits}f}"
    return mean if math.isnan(interval.half) else f"{mean} ± {interval.half:.{digits}f}"


def _pixels(picture: torch.Tensor) -> NDArray[np.uint8]:
    pixels: NDArray[np.uint8] = (picture.permute(1, 2, 0) * 255).round().to(torch.uint8).numpy().copy()
    return pixels


def _outline(pixels: NDArray[np.uint8], box: torch.Tensor) -> None:
    """Draw a box, x0, y0, x1, y1, three pixels wide."""
    height, width = pixels.shape[:2]
    x0, y0, x1, y1 = (int(v) for v in box.round().tolist())
    rows, columns = slice(max(y0, 0), min(y1, height)), slice(max(x0, 0), min(x1, width))
    inner = slice(rows.start + 3, rows.stop - 3), slice(columns.start + 3, columns.stop - 3)
    kept = pixels[inner].copy()
    pixels[rows, columns] = _BOX_COLOUR
    pixels[inner] = kept
