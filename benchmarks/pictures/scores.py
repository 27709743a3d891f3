"""Average precision and recall of the detections, by class, height and weather; false alarms on empty streets."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass

from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from benchmarks.pictures.crowd import CLASSES, Row, Truth

HEIGHTS = {"40": (40.0, 90.0), "90": (90.0, 1e4)}  # pixels
ALARM = 0.5  # score from which a detection on an empty street is a false alarm


@dataclass(frozen=True)
class Seen:
    """What a detector saw in a picture."""

    place: str
    weather: str
    empty: bool
    truths: tuple[Truth, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Score:
    """AP50 and recall over the objects of a class and height, and their number; recall counts all scores from 0.05."""

    precision: float
    recall: float
    objects: int


def score(seen: Sequence[Seen], label: str, heights: tuple[float, float], heavy: bool | None = None) -> Score:
    """Return the score over pictures; objects of other heights, hidden ones and two-wheelers count neither way.

    `heavy` restricts the vehicles to buses and trucks if it is True, and to all others if it is False.
    """
    truths, found, objects = [], [], 0
    for image, picture in enumerate(seen):
        for truth in picture.truths:
            if truth.label not in (label, ""):
                continue
            chosen = truth.wanted and heavy in (None, truth.heavy)
            wanted = chosen and heights[0] <= truth.box[3] - truth.box[1] < heights[1]
            objects += wanted
            truths.append(_row(image, truth.box) | {"ignore": int(not wanted), "iscrowd": int(not chosen)})
        found += [_row(image, row[1:5]) | {"score": row[5], "iscrowd": 0} for row in picture.rows if row[0] == label]
    if not objects:
        return Score(-1.0, -1.0, 0)
    with contextlib.redirect_stdout(io.StringIO()):  # pycocotools prints
        matches = COCOeval(_coco(len(seen), truths), _coco(len(seen), found), "bbox")
        matches.params.areaRng, matches.params.areaRngLbl = [[heights[0] ** 2, heights[1] ** 2]], ["all"]
        matches.params.maxDets, matches.params.iouThrs = [100], matches.params.iouThrs[:1]
        matches.evaluate()
        matches.accumulate()
    return Score(float(matches.eval["precision"].mean()), float(matches.eval["recall"].mean()), objects)


def false_alarms(seen: Sequence[Seen]) -> float:
    """Return the false alarms in a picture of an empty street, of all classes."""
    streets = [picture for picture in seen if picture.empty]
    return sum(row[5] >= ALARM for picture in streets for row in picture.rows) / max(len(streets), 1)


def summary(seen: Sequence[Seen]) -> dict[str, Score]:
    """Return the scores by class and height, over all weathers and in each."""
    crowds = [picture for picture in seen if not picture.empty]
    weathers = list(dict.fromkeys(picture.weather for picture in crowds))
    scores = {}
    for label in CLASSES:
        for name, heights in HEIGHTS.items():
            scores[f"{label} {name} all"] = score(crowds, label, heights)
            for weather in weathers:
                chosen = [picture for picture in crowds if picture.weather == weather]
                scores[f"{label} {name} {weather}"] = score(chosen, label, heights)
    for name, heights in HEIGHTS.items():
        scores[f"car or van {name} all"] = score(crowds, "vehicle", heights, heavy=False)
        scores[f"bus or truck {name} all"] = score(crowds, "vehicle", heights, heavy=True)
    return scores


def _row(image: int, box: Sequence[float]) -> dict[str, object]:
    """Return an annotation whose area is the square of the box's height, by which COCO's tools choose objects."""
    x0, y0, x1, y1 = box
    size = [x1 - x0, y1 - y0]
    return {"image_id": image, "category_id": 1, "area": size[1] ** 2, "bbox": [x0, y0, *size]}


def _coco(images: int, rows: list[dict[str, object]]) -> COCO:
    coco = COCO()
    numbered = [{**row, "id": number} for number, row in enumerate(rows, 1)]
    coco.dataset = {"images": [{"id": k} for k in range(images)], "annotations": numbered, "categories": [{"id": 1}]}
    coco.createIndex()
    return coco
