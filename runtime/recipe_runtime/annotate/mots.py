"""MOTS: non-overlapping masks with persistent track identities, as text and as 16-bit PNG.

The layout is that of TrackEval's MOTSChallenge: `MOTS-train/<sequence>/gt/gt.txt` with one line `frame id class height
width rle` per object, frames from 1. Ids are class * 1000 + number. Pedestrians are class 2 and cars class 1; the
number is that of the instance. MOTS has no other class: all other actors form one ignore region, class 10, whose
detections count neither as true nor as false positives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
import pycocotools.mask
from numpy.typing import NDArray

from recipe_runtime.annotate.categories import MOTS_CLASSES, MOTS_IGNORE
from recipe_runtime.annotate.records import LabelledFrame

_PIECE = 1 << 20  # characters of a run-length code that are decoded at once
_MAX_CHARACTERS = 7  # of one number


def mots_id(instance: int, classes: Mapping[int, int] = MOTS_CLASSES) -> int:
    """Return the MOTS id of an instance value; 10000 for the ignore region, 0 for the background.

    Args:
        instance: The instance value.
        classes: The class of each CARLA tag; all others are in the ignore region.
    """
    if instance == 0:
        return 0
    tag, number = divmod(instance, 1000)
    return classes[tag] * 1000 + number if tag in classes else MOTS_IGNORE * 1000


def mots_picture(instance: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Convert an instance image [H, W] to MOTS ids."""
    out = np.zeros_like(instance)
    for value in np.unique(instance[instance > 0]):
        out[instance == value] = mots_id(int(value))
    return out


def mots_lines(
    frames: Iterable[LabelledFrame],
    width: int,
    height: int,
    *,
    first: int = 1,
    classes: Mapping[int, int] = MOTS_CLASSES,
) -> Iterator[str]:
    """Yield the lines of the text file of one sequence.

    Args:
        frames: The labelled frames, in order.
        width: Width of the image in pixels.
        height: Height of the image in pixels.
        first: Number of frame 0 in the file: 1 in MOTSChallenge, 0 in KITTI.
        classes: The class of each CARLA tag.
    """
    for frame in frames:
        codes: dict[int, list[str]] = {}
        for record in frame["objects"]:
            codes.setdefault(mots_id(record["instance"], classes), []).append(record["counts"])
        for name, counts in sorted(codes.items()):
            rle = counts[0] if len(counts) == 1 else _union(counts, width, height)
            yield f"{frame['frame'] + first} {name} {name // 1000} {height} {width} {rle}\n"


def seqinfo(name: str, directory: str, rate: int, length: int, width: int, height: int) -> str:
    """Return the text of a sequence's `seqinfo.ini`.

    Args:
        name: Name of the sequence.
        directory: Folder of the pictures.
        rate: Frames per second.
        length: Number of frames.
        width: Of the pictures, pixels.
        height: Of the pictures, pixels.
    """
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
    """Return the text of the list of sequences with the given names."""
    return "".join(f"{name}\n" for name in ("name", *names))


def _union(counts: Sequence[str], width: int, height: int) -> str:
    codes = [{"size": [height, width], "counts": c.encode()} for c in counts]
    packed: bytes = pycocotools.mask.merge(codes)["counts"]
    return packed.decode("ascii")


def runs_fill(counts: str, pixels: int) -> bool:
    """Return whether a run-length code in COCO's text form describes a mask of exactly `pixels` pixels.

    pycocotools does not check this. A character encodes six bits, starting at code 48: five bits of the number, the
    lowest first, and a continuation bit. Each run after the third is stored as its difference from the run two before
    it (maskApi.c, rleToString).
    """
    codes = np.frombuffer(counts.encode(), np.uint8) - np.uint8(48)
    values: list[NDArray[np.int32]] = [np.zeros(0, np.int32)]
    if codes.size and (codes.max() > 63 or codes[-1] & 32):
        return False
    while codes.size:
        ends = np.flatnonzero(codes[:_PIECE] < 32)
        if not ends.size:
            return False  # a number is longer than the piece
        numbers = _numbers(codes, ends)
        if numbers is None or np.abs(numbers).max() > pixels:
            return False
        values.append(numbers.astype(np.int32))
        codes = codes[ends[-1] + 1 :]
    runs = np.concatenate(values).astype(np.int64)
    for first in (1, 2):
        runs[first::2] = np.cumsum(runs[first::2])
    return bool((runs[:1] >= 0).all() and (runs[1:] >= 1).all() and (runs <= pixels).all() and runs.sum() == pixels)


def _numbers(codes: NDArray[np.uint8], ends: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Return the numbers whose last characters are at `ends`; None if one has too many characters."""
    starts = np.concatenate([np.zeros(1, np.int64), ends[:-1] + 1])
    lengths = ends - starts + 1
    longest = int(lengths.max())
    if longest > _MAX_CHARACTERS:
        return None
    numbers = np.zeros(len(ends), np.int64)
    for position in range(longest):
        present = lengths > position
        numbers[present] |= (codes[starts[present] + position] & 31).astype(np.int64) << (5 * position)
    negative = codes[ends] & 16 > 0
    numbers[negative] -= np.int64(1) << (5 * lengths[negative])
    return numbers
