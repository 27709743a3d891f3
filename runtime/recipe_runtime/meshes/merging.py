"""Equal vertices of a mesh, found in one pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.meshes.mesh import Skin
from recipe_runtime.meshes.vectors import Index


def distinct(rows: NDArray[np.float32], skin: Skin | None, loose: Sequence[Index]) -> tuple[Index, Index]:
    """Return the indices of the first of each set of equal vertices, ascending, and each vertex's number among them.

    Args:
        rows: Position, normal and uv, [N, 8].
        skin: Of the same vertices, if they have one: equal vertices follow the same parts.
        loose: Indices of the vertices to compare; all others are kept, as those that triangles share already.
    """
    if skin is not None:  # as bytes, which are compared only
        packed = np.concatenate([skin.parts.astype(np.uint8), skin.weights], axis=1)
        rows = np.concatenate([rows, np.ascontiguousarray(packed).view(np.float32)], axis=1)
    stand_in = np.arange(len(rows))
    if loose:
        compared = np.sort(np.concatenate(loose))
        stand_in[compared] = compared[_first_equals(rows[compared])]
    kept = stand_in == np.arange(len(rows))
    return np.flatnonzero(kept), (np.cumsum(kept) - 1)[stand_in]


def _first_equals(rows: NDArray[np.float32]) -> Index:
    """Return, for each row, the index of the first row that equals it: [N]."""
    keys = np.ascontiguousarray(rows).view(np.uint64)  # two numbers each
    order = np.lexsort(keys.T)
    new = np.concatenate([[True], (keys[order][1:] != keys[order][:-1]).any(axis=1)])
    first = np.minimum.reduceat(order, np.flatnonzero(new))
    found = np.empty(len(rows), np.int64)
    found[order] = first[np.cumsum(new) - 1]
    return found
