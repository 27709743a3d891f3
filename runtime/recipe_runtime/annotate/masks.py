"""Run-length encoded masks of all objects, from one pass over the instance image.

COCO's code counts runs of 0 and 1 in column-major order. The image is transposed once, its runs are found once, and
each object selects its own. pycocotools packs the counts into COCO's text form.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import pycocotools.mask
from numpy.typing import NDArray

from recipe_runtime.annotate.mots import runs_fill


@dataclass(frozen=True)
class Mask:
    """The visible pixels of one object: instance value, COCO code, area, and box x, y, width, height in pixels."""

    instance: int
    counts: str
    area: int
    box: tuple[int, int, int, int]


def masks(instance: NDArray[np.uint16]) -> list[Mask]:
    """Return the mask of every object in an instance image [H, W], sorted by instance value; 0 is the background."""
    height, width = instance.shape
    columns = np.ascontiguousarray(instance.T).reshape(-1)
    edges = np.flatnonzero(columns[1:] != columns[:-1]) + 1
    starts = np.concatenate([np.zeros(1, np.int64), edges])
    ends = np.concatenate([edges, np.full(1, columns.size, np.int64)])
    values = columns[starts]
    found = []
    for value in np.unique(values[values > 0]):
        own = values == value
        found.append(_mask(int(value), starts[own], ends[own], height, width))
    return found


def unpacked(counts: str, width: int, height: int) -> NDArray[np.uint8]:
    """Return a mask, uint8 [H, W], 0 or 1, from its COCO code.

    Raises:
        ValueError: The code is not that of a mask of this size.
    """
    if not runs_fill(counts, width * height):
        raise ValueError("its mask is damaged")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of numpy, caused by pycocotools
        mask: NDArray[np.uint8] = pycocotools.mask.decode({"size": [height, width], "counts": counts.encode()})
    return np.ascontiguousarray(mask)


def _mask(value: int, starts: NDArray[np.int64], ends: NDArray[np.int64], height: int, width: int) -> Mask:
    counts = np.empty(2 * len(starts) + 1, np.int64)  # zeros, ones, zeros, ones, ..., zeros
    counts[0] = starts[0]
    counts[1::2] = ends - starts
    counts[2:-1:2] = starts[1:] - ends[:-1]
    counts[-1] = height * width - ends[-1]
    plain = {"size": [height, width], "counts": counts[: -1 if counts[-1] == 0 else None].tolist()}
    packed = pycocotools.mask.frPyObjects(plain, height, width)
    left, right = int(starts[0]) // height, int(ends[-1] - 1) // height
    wraps = starts // height != (ends - 1) // height  # a run that continues in the next column touches both edges
    top = 0 if wraps.any() else int((starts % height).min())
    bottom = height - 1 if wraps.any() else int(((ends - 1) % height).max())
    box = (left, top, right - left + 1, bottom - top + 1)
    return Mask(value, packed["counts"].decode("ascii"), int((ends - starts).sum()), box)
