"""MOTS: one mask a pixel, and the same identity in every frame, as text and as 16-bit PNG.

Layout and meaning of TrackEval's MOTSChallenge: `MOTS-train/<sequence>/gt/gt.txt` with a line `frame id class height
width rle`, frames from 1; ids are class * 1000 + number. Pedestrians are class 2 and cars class 1, with the number
that they have everywhere else. MOTS knows no other class: trucks, buses and the like are one region to ignore,
class 10, so that a tracker is neither praised nor blamed for finding them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pycocotools.mask
from numpy.typing import NDArray

from recipe_runtime.annotate.categories import MOTS_CLASSES, MOTS_IGNORE
from recipe_runtime.annotate.objects import Record


def mots_id(instance: int) -> int:
    """MOTS's id of an instance value; 10000 for what is to be ignored, 0 for the background."""
    if instance == 0:
        return 0
    tag, number = divmod(instance, 1000)
    return MOTS_CLASSES[tag] * 1000 + number if tag in MOTS_CLASSES else MOTS_IGNORE * 1000


def mots_picture(instance: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """An instance picture [H, W] with MOTS's ids."""
    out = np.zeros_like(instance)
    for value in np.unique(instance[instance > 0]):
        out[instance == value] = mots_id(int(value))
    return out


def mots_lines(frames: Sequence[Sequence[Record]], width: int, height: int) -> str:
    """The text form of one sequence: the records of every frame, in order."""
    lines = []
    for number, records in enumerate(frames, start=1):
        codes: dict[int, list[str]] = {}
        for record in records:
            codes.setdefault(mots_id(record["instance"]), []).append(record["counts"])
        for name, counts in sorted(codes.items()):
            rle = counts[0] if len(counts) == 1 else _union(counts, width, height)
            lines.append(f"{number} {name} {name // 1000} {height} {width} {rle}\n")
    return "".join(lines)


def seqinfo(name: str, directory: str, rate: int, length: int, width: int, height: int) -> str:
    """A sequence's `seqinfo.ini`."""
    rows = {
        "name": name,
        "imDir": directory,
        "frameRate": rate,
        "seqLength": length,
        "imWidth": width,
        "imHeight": height,
        "imExt": ".png",
    }
    return "[Sequence]\n" + "".join(f"{key}={value}\n" for key, value in rows.items())


def seqmap(names: Sequence[str]) -> str:
    """The list of sequences."""
    return "".join(f"{name}\n" for name in ("name", *names))


def _union(counts: Sequence[str], width: int, height: int) -> str:
    codes = [{"size": [height, width], "counts": c.encode()} for c in counts]
    packed: bytes = pycocotools.mask.merge(codes)["counts"]
    return packed.decode("ascii")


def runs_fill(counts: str, pixels: int) -> bool:
    """Whether a run-length code in COCO's text form is one of so many pixels: pycocotools trusts that it is.

    Six bits a character from 48 on, five of them the number's, least first; each run but the first three is told by
    its difference from the one before last (maskApi.c, rleToString).
    """
    runs: list[int] = []
    value = shift = 0
    for code in counts.encode():
        bits = code - 48
        if not 0 <= bits < 64 or shift > 30:
            return False
        value |= (bits & 31) << shift
        shift += 5
        if bits & 32:
            continue
        value -= 1 << shift if bits & 16 else 0
        runs.append(value + (runs[-2] if len(runs) > 2 else 0))
        value = shift = 0
    return shift == 0 and sum(runs) == pixels and all(run >= min(place, 1) for place, run in enumerate(runs))
