"""Affine 3 x 4 matrices, by products and sums in a fixed order."""

from __future__ import annotations

import numpy as np

from recipe_compiler.ir.assets.geometry import Floats, cross

Matrix = tuple[tuple[float, ...], ...]  # 3 x 4

IDENTITY: Matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


def composed(a: Matrix, b: Matrix) -> Matrix:
    """Return the matrix that applies b, then a."""
    return tuple(
        tuple(r[0] * b[0][c] + r[1] * b[1][c] + r[2] * b[2][c] + (r[3] if c == 3 else 0.0) for c in range(4)) for r in a
    )


def moved(points: Floats, m: Matrix) -> Floats:
    """Transform points [N, 3]."""
    return np.stack([points[:, 0] * r[0] + points[:, 1] * r[1] + points[:, 2] * r[2] + r[3] for r in m], axis=-1)


def turned(normals: Floats, m: Matrix) -> Floats:
    """Transform normals [N, 3] by the cofactor matrix, so that they stay perpendicular under scaling and mirroring."""
    rows = np.array([r[:3] for r in m])
    c = cross(rows[[1, 2, 0]], rows[[2, 0, 1]]) * (-1.0 if mirrors(m) else 1.0)
    return np.stack([normals[:, 0] * r[0] + normals[:, 1] * r[1] + normals[:, 2] * r[2] for r in c], axis=-1)


def mirrors(m: Matrix) -> bool:
    """Return whether a matrix turns a right hand into a left one."""
    a, b, c = m
    first = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    return a[0] * first[0] + a[1] * first[1] + a[2] * first[2] < 0.0
