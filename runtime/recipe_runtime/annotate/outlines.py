"""Outlines of masks as polygons whose corners are corners of pixels, so that a polygon covers exactly the mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Corners = list[tuple[int, int]]


def rings(mask: NDArray[np.uint8]) -> list[Corners]:
    """Return the closed outlines of a mask [H, W] of 0 and 1: of its pieces, and of holes in them.

    Args:
        mask: The mask.

    Returns:
        The corners x, y of each outline in pixels, (0, 0) at the outer corner of the first pixel. A point is in the
        mask if an odd number of outlines surrounds it. The first corner is the upper left one; outlines are in the
        order of their first corners, from top to bottom.
    """
    padded = np.pad(mask.astype(np.int8), 1)
    up, down = padded[:-1], padded[1:]
    changes = np.abs(up[:, 1:] - down[:, 1:]) != np.abs(up[:, :-1] - down[:, :-1])  # of horizontal edges, at a corner
    saddles = (up[:, :-1] == down[:, 1:]) & (up[:, 1:] == down[:, :-1]) & (up[:, 1:] != up[:, :-1])
    rows, columns = np.nonzero(changes | saddles)
    double = np.where(saddles[rows, columns], 2, 1)  # two outlines meet there, each with a corner of its own
    y, x = np.repeat(rows, double), np.repeat(columns, double)
    across, along = _pairs(np.lexsort((x, y))), _pairs(np.lexsort((y, x)))
    found, left = list[Corners](), np.ones(len(x), np.bool_)
    for start in range(len(x)):
        ring, corner = Corners(), start
        while left[corner]:
            for partner in (across, along):
                ring.append((int(x[corner]), int(y[corner])))
                left[corner] = False
                corner = int(partner[corner])
        found += [ring] if ring else []
    return found


def joined(outlines: list[Corners]) -> Corners:
    """Return one polygon of several outlines: lines without width lead from the first corner to each, and back."""
    polygon = Corners()
    for ring in outlines:
        polygon += [*ring, *([ring[0], outlines[0][0]] if len(outlines) > 1 else [])]
    return polygon


def _pairs(order: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the partner of each corner: the first of an order is that of the second, and so on."""
    partner = np.empty_like(order)
    partner[order[0::2]], partner[order[1::2]] = order[1::2], order[0::2]
    return partner
