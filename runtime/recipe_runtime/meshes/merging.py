"""Equal vertices of a mesh, found in one pass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.meshes.mesh import Skin
from recipe_runtime.meshes.vectors import Index


def distinct(rows: NDArray[np.float32], skin: Skin | None) -> tuple[Index, Index]:
    """Return the indices of the first of each set of equal vertices, ascending, and each vertex's number among them.

    Args:
        rows: Position, normal and uv, [N, 8].
        skin: Of the same vertices, if they have one: equal vertices follow the same parts.
    """
    if skin is not None:  # as bytes, which are compared only
        packed = np.concatenate([skin.parts.astype(np.uint8), skin.weights], axis=1)
        rows = np.concatenate([rows, np.ascontiguousarray(packed).view(np.float32)], axis=1)
    keys = np.ascontiguousarray(rows).view(np.uint64)  # two numbers each
    order = np.lexsort(keys.T)
    new = np.concatenate([[True], (keys[order][1:] != keys[order][:-1]).any(axis=1)])
    first = np.minimum.reduceat(order, np.flatnonzero(new))
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    kind = np.empty(len(rows), np.int64)
    kind[order] = rank[np.cumsum(new) - 1]
    return np.sort(first), kind
