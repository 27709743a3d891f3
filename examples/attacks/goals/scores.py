"""What a detector sees of an object in the test frames of several seeds, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_runtime.torch import Place

from examples.attacks.goals.bootstrap import mean, rate, resampled, stacked
from examples.attacks.goals.coco_scores import Evaluation
from examples.attacks.goals.parts import Part

DRAWS = 200  # of the bootstrap of average precision

_Indices = NDArray[np.int64]


def threshold(plain: Sequence[Part], detector: str) -> float:
    """Return the score that 95 % of the test frames with a plain texture reach: from there on, an object is found."""
    return float(np.quantile([part.values[detector]["scores"] for part in plain], 0.05))


def scores(
    found: Sequence[Part], detector: str, least: float, moment_of: Callable[[Place], Hashable]
) -> dict[str, str]:
    """Return the cells of a table: COCO's mAP, AP50 and AR, the rate at which the object is found, and its mean score.

    Args:
        found: One part a seed.
        detector: Which sees the object.
        least: Score of an object that is found.
        moment_of: Gives the places that are resampled together one value.
    """
    places = [(variant, frame) for variant, frame in found[0].values["places"]]
    groups: dict[Hashable, list[int]] = {}
    for number, place in enumerate(places):
        groups.setdefault(moment_of(place), []).append(number)
    moments = list(groups.values())
    evaluations = [Evaluation(part.values["boxes"], part.values[detector]["detections"]) for part in found]

    def averaged(name: str) -> str:
        def of(seeds: _Indices, chosen: _Indices) -> float:
            numbers = [number for moment in chosen for number in moments[moment]]
            return float(np.mean([getattr(evaluations[seed].scores(numbers), name) for seed in seeds]))

        return resampled(of, len(found), len(moments), DRAWS).text(2)

    seen = stacked([part.values[detector]["scores"] for part in found])
    by_moment = np.stack([seen[:, numbers] for numbers in moments], axis=1)
    return {
        "mAP": averaged("precision"),
        "AP50": averaged("precision_50"),
        "AR": averaged("recall"),
        "found": rate(by_moment >= least),
        "score": mean(by_moment.mean(axis=2)).text(2),
    }


def chosen_scores(found: Sequence[Part], detector: str, chosen: Callable[[Place], bool]) -> NDArray[np.float64]:
    """Return the object's scores in some of the places, [seeds, places]."""
    kept = [chosen((variant, frame)) for variant, frame in found[0].values["places"]]
    return stacked([part.values[detector]["scores"] for part in found])[:, kept]
