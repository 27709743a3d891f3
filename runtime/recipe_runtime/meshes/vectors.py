"""Vector arithmetic along the last axis, component by component, so that no result depends on BLAS."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def unit(v: Array) -> Array:
    """Normalize vectors along the last axis; a zero vector becomes +z."""
    length = np.sqrt(v[..., 0] * v[..., 0] + v[..., 1] * v[..., 1] + v[..., 2] * v[..., 2])
    safe = np.where(length > 0.0, length, 1.0)
    out: Array = v / safe[..., None]
    out[length == 0.0] = (0.0, 0.0, 1.0)
    return out


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the last axis."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
