"""Exact least squares of small systems in rational numbers, so that results do not depend on the host."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

Number = int | float | Fraction


def least_squares(
    rows: Sequence[Sequence[Number]], targets: Sequence[Number], weights: Sequence[int] | None = None
) -> list[float] | None:
    """Return the coefficients that minimise the weighted sum of (row . coefficients - target)^2.

    The exact solution is rounded to float64.

    Args:
        rows: One row of terms per equation.
        targets: One target per equation.
        weights: One weight per equation; 1 each by default.

    Returns:
        One coefficient per term; None if the rows do not determine them.
    """
    size = len(rows[0]) if rows else 0
    system = [[Fraction(0)] * (size + 1) for _ in range(size)]
    for row, target, weight in zip(rows, targets, weights or [1] * len(rows), strict=True):
        terms = [Fraction(value) for value in (*row, target)]
        for i in range(size):
            for j in range(size + 1):
                system[i][j] += weight * terms[i] * terms[j]
    return _solved(system) if size else None


def _solved(system: list[list[Fraction]]) -> list[float] | None:
    """Solve a system [n, n + 1] in place by Gauss-Jordan elimination; None if it is singular."""
    for column in range(len(system)):
        pivot = next((k for k in range(column, len(system)) if system[k][column] != 0), None)
        if pivot is None:
            return None
        system[column], system[pivot] = system[pivot], system[column]
        scale = system[column][column]
        system[column] = [value / scale for value in system[column]]
        for k, row in enumerate(system):
            factor = row[column]
            if k != column and factor != 0:
                system[k] = [a - factor * b for a, b in zip(row, system[column], strict=True)]
    return [float(row[-1]) for row in system]
