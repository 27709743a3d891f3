"""Chooses the frames to verify, and computes the confidence of the result.

The sample is drawn from all frames without replacement; every set of k frames is equally likely. If a fraction p of all
frames differs, the probability that none of them is drawn is at most (1 - p)^k.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeVar

from recipe_compiler.ir import exact
from recipe_compiler.ir.plurals import count
from recipe_compiler.ir.streams import Stream

T = TypeVar("T")

MAX_SCENES = 64  # number of scenes up to which every scene is simulated, however few frames are drawn


@dataclass(frozen=True)
class Bound:
    """The result of checking `checked` of `total` frames without a difference.

    With the given confidence, less than a fraction `differing` of all frames differs.
    """

    checked: int
    total: int
    confidence: float

    @property
    def differing(self) -> float:
        """The largest fraction of frames that could differ undetected; 0 if every frame was checked."""
        if self.checked >= self.total:
            return 0.0
        if self.checked == 0:
            return 1.0
        return 1.0 - exact.power(1.0 - self.confidence, 1.0 / self.checked)

    def __str__(self) -> str:
        if self.checked >= self.total:
            return f"all {count(self.total, 'frame')} checked" if self.total != 1 else "the one frame checked"
        return (
            f"{self.checked:,} of {count(self.total, 'frame')} checked: with {self.confidence * 100:g} % confidence "
            f"fewer than {self.differing * 100:.1f} % differ"
        )


def sample_size(total: int, confidence: float, bound: float) -> int:
    """Return the smallest sample that shows, if no frame differs, that less than a fraction `bound` differs."""
    needed = exact.log(1.0 - confidence) / exact.log(1.0 - bound)
    return min(total, max(1, -int(-needed // 1)))


def draw(items: Sequence[T], count: int, nonce: int) -> list[T]:
    """Draw `count` of the items, in their original order."""
    stream, places = Stream(nonce, "verify"), list(range(len(items)))
    for k in range(count):  # the first steps of a Fisher-Yates shuffle
        other = stream.integer(k, len(places) - 1)
        places[k], places[other] = places[other], places[k]
    return [items[place] for place in sorted(places[:count])]


def draw_scenes(scenes: Sequence[str], drawn: Collection[str], nonce: int) -> list[str]:
    """Choose the scenes whose motion is compared.

    Args:
        scenes: all scenes.
        drawn: the scenes of the frames that are compared; these are always chosen.
        nonce: the seed of the draw.

    Returns:
        All scenes if there are at most `MAX_SCENES`; else those of the drawn frames, and random others up to that
        number; in the order of `scenes`.
    """
    rest = [scene for scene in scenes if scene not in drawn]
    others = draw(rest, max(0, min(len(rest), MAX_SCENES - len(set(drawn)))), nonce)
    chosen = {*drawn, *others}
    return [scene for scene in scenes if scene in chosen]
