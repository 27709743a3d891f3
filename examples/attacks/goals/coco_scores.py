"""Average precision and recall of one class by pycocotools, with one object in each picture."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

Box = Sequence[float]  # x0, y0, x1, y1 in pixels


@dataclass(frozen=True)
class CocoScores:
    """Scores from 0 to 1, over 100 detections in a picture.

    Attributes:
        precision: Mean over intersections over union of 0.5 to 0.95: COCO's AP.
        precision_50: At 0.5: AP50.
        recall: Mean over 0.5 to 0.95: COCO's AR.
    """

    precision: float
    precision_50: float
    recall: float


class Evaluation:
    """Detections, matched with the objects once, so that subsets of the pictures can be scored.

    Args:
        truths: The object in each picture.
        detections: Those in each picture: x0, y0, x1, y1 and the score.
    """

    def __init__(self, truths: Sequence[Box], detections: Sequence[Sequence[Sequence[float]]]) -> None:
        objects = [_annotation(k, box) for k, box in enumerate(truths)]
        found = [{**_annotation(k, row), "score": row[4]} for k, rows in enumerate(detections) for row in rows]
        images = [{"id": k} for k in range(len(truths))]
        self._count = len(truths)
        with contextlib.redirect_stdout(io.StringIO()):  # pycocotools prints
            truth, seen = _coco(images, objects), _coco(images, found)
            self._matches = COCOeval(truth, seen, "bbox")
            self._matches.params.areaRng, self._matches.params.areaRngLbl = [[0, 1e10]], ["all"]
            self._matches.params.maxDets = [100]
            self._matches.evaluate()
        self._rows = list(self._matches.evalImgs)
        self._known: dict[tuple[int, ...], CocoScores] = {}

    def scores(self, pictures: Sequence[int] | None = None) -> CocoScores:
        """Return the scores in some of the pictures, which may repeat; in all by default."""
        chosen = tuple(range(self._count)) if pictures is None else tuple(pictures)
        if chosen not in self._known:
            self._known[chosen] = self._scores(chosen)
        return self._known[chosen]

    def _scores(self, chosen: tuple[int, ...]) -> CocoScores:
        self._matches.evalImgs = [self._rows[k] for k in chosen]
        self._matches.params.imgIds = self._matches._paramsEval.imgIds = list(range(len(chosen)))
        with contextlib.redirect_stdout(io.StringIO()):
            self._matches.accumulate()
        precision, recall = self._matches.eval["precision"], self._matches.eval["recall"]
        return CocoScores(float(precision.mean()), float(precision[0].mean()), float(recall.mean()))


def _coco(images: list[dict[str, int]], annotations: list[dict[str, object]]) -> COCO:
    coco = COCO()
    numbered = [{**row, "id": number} for number, row in enumerate(annotations, 1)]
    coco.dataset = {"images": images, "annotations": numbered, "categories": [{"id": 1}]}
    coco.createIndex()
    return coco


def _annotation(picture: int, box: Sequence[float]) -> dict[str, object]:
    x0, y0, x1, y1 = (float(np.float64(v)) for v in box[:4])
    size = [x1 - x0, y1 - y0]
    return {"image_id": picture, "category_id": 1, "iscrowd": 0, "area": size[0] * size[1], "bbox": [x0, y0, *size]}
