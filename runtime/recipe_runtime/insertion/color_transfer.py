"""Colour transforms of a texture that is inserted into a picture, by published methods.

- dapricot: Armory's implementation of D-APRICOT. A matrix [3, 4] from known to observed colours of a chart, both
  decoded with a gamma of 2.2, is applied to the texture; after insertion each pixel is multiplied by its brightness
  ratio.
- matrix: likewise, but the ratio is relative to the placeholder's brightness as the matrix predicts it, so that light
  is not applied twice.
- armory: as in Armory's CARLA attacks: only the brightness ratio.
- reap: REAP's polynomial of degree 1: a linear fit per channel from known to observed values of the chart, without the
  1 % of pixels that differ most.

The brightness ratio of a pixel is the largest channel of the placeholder in the picture, divided by the largest channel
of the placeholder's own colour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.patches import GREEN, TransferMethod

from recipe_runtime.core.transforms import Array
from recipe_runtime.insertion.color_chart import COLORS, ChartPixels
from recipe_runtime.insertion.least_squares import least_squares

Linearised = tuple[Array, Callable[[Array], Array]]  # values, and the transpose of their derivative

_GAMMA = 2.2
_PLACEHOLDER = tuple(float(int(GREEN[k : k + 2], 16)) for k in (1, 3, 5))
_KEPT = 99, 100  # share of the pixels that the fit keeps, as a fraction: REAP's default


@dataclass(frozen=True)
class Transfer:
    """A colour transform.

    `texture` transforms the texture, float64 [h, w, 3], 0 to 255. `linearised` does so without rounding, and also
    returns the transpose of the derivative. `reference` is the denominator of the brightness ratio; None if the method
    has no brightness ratio.
    """

    texture: Callable[[Array], Array]
    linearised: Callable[[Array], Linearised]
    reference: float | None

    def ratios(self, placeholder: NDArray[np.uint8]) -> Array:
        """Return the brightness ratios [N, 1] of pixels that show the placeholder, uint8 [N, 3]."""
        if self.reference is None:
            return np.ones((len(placeholder), 1))
        ratios: Array = placeholder.max(axis=1, keepdims=True).astype(np.float64) / self.reference
        return ratios


def transfer(method: TransferMethod, chart: ChartPixels | None) -> Transfer:
    """Return the transform of a method.

    Args:
        method: The method.
        chart: The chart in the picture, for a method that uses it. If too few of its cells are visible for a fit, the
            transform is that of `armory`.
    """
    if method in ("dapricot", "matrix") and chart is not None:
        matrix = _matrix(chart)
        if matrix is not None:
            seen = float(_through_matrix(np.array([[_PLACEHOLDER]]), matrix).max())
            reference = max(_PLACEHOLDER) if method == "dapricot" else max(seen, 1.0)
            return Transfer(partial(_through_matrix, matrix=matrix), partial(_smooth_matrix, matrix=matrix), reference)
    if method == "reap" and chart is not None:
        lines = _lines(chart)
        if lines is not None:
            return Transfer(partial(_through_lines, lines=lines), partial(_smooth_lines, lines=lines), None)
    return Transfer(lambda texture: texture, lambda texture: (texture, lambda gradient: gradient), max(_PLACEHOLDER))


def _matrix(chart: ChartPixels) -> list[list[float]] | None:
    """Return the matrix from known colours (r, g, b, 1) to observed ones, both decoded; None if undetermined."""
    cells = chart.cells
    known = [[*(_decoded()[value] for value in COLORS[cell]), 1.0] for cell in cells]
    rows = []
    for channel in range(3):
        seen = [exact.power(chart.mean(cell, channel) / 255.0, _GAMMA) for cell in cells]
        row = least_squares(known, seen)
        if row is None:
            return None
        rows.append(row)
    return rows


def _through_matrix(texture: Array, matrix: list[list[float]]) -> Array:
    """Apply a matrix to a texture; levels are rounded before and truncated after, as D-APRICOT does."""
    levels = np.floor(texture + 0.5).astype(np.int64)
    r, g, b = (np.array(_decoded())[levels[..., channel]] for channel in range(3))
    out = np.empty_like(texture)
    for channel, (x, y, z, one) in enumerate(matrix):
        linear = ((x * r + y * g) + z * b) + one
        out[..., channel] = np.searchsorted(np.array(_decoded()[1:]), linear, side="right")
    out[levels == 255] = 255.0  # D-APRICOT does not change saturated values
    return out


def _smooth_matrix(texture: Array, matrix: list[list[float]]) -> Linearised:
    """Apply a matrix to a texture without rounding, and return the transpose of the derivative as well."""
    nodes = np.array(_decoded())
    light, light_slope = _light(texture)
    linear = np.stack([((x * light[..., 0] + y * light[..., 1]) + z * light[..., 2]) + w for x, y, z, w in matrix], -1)
    i = np.clip(np.searchsorted(nodes, linear, side="right") - 1, 0, 254)
    step = nodes[i + 1] - nodes[i]
    values = np.clip(i + (linear - nodes[i]) / step, 0.0, 255.0)
    fixed = (texture >= 254.5) | (linear < 0.0) | (linear > 1.0)  # saturated values do not change

    def transposed(gradient: Array) -> Array:
        back = np.where(fixed, 0.0, gradient / step)
        r, g, b = (back[..., channel] for channel in range(3))
        columns = [(r * matrix[0][k] + g * matrix[1][k]) + b * matrix[2][k] for k in range(3)]
        return np.stack(columns, axis=-1) * light_slope

    return np.where(texture >= 254.5, 255.0, values), transposed


def _light(levels: Array) -> tuple[Array, Array]:
    """Return the decoded value of levels 0 to 255, and its derivative, by cubic Hermite interpolation."""
    light, slope = (np.array(column) for column in (_decoded(), _decoded_slope()))
    i = np.clip(levels, 0.0, 254.0).astype(np.int64)
    t = levels - i
    a, b, p, q = light[i], light[i + 1], slope[i], slope[i + 1]
    c, d = 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q
    return a + t * (p + t * (c + t * d)), p + t * (2.0 * c + t * 3.0 * d)


def _lines(chart: ChartPixels) -> list[tuple[float, float]] | None:
    """Return slope and offset of each channel; None if undetermined."""
    found = []
    for channel in range(3):
        cells, seen = np.nonzero(chart.counts[:, channel])
        counts = chart.counts[cells, channel, seen]
        known = np.array([COLORS[cell][channel] for cell in cells], np.int64)
        order = np.lexsort((seen, known, np.abs(known - seen)))
        known, seen, counts = known[order], seen[order], counts[order]
        limit = int(counts.sum()) * _KEPT[0] // _KEPT[1]
        before = np.cumsum(counts) - counts
        counts = np.clip(limit - before, 0, counts)
        rows = [[int(value), 1] for value in known]
        line = least_squares(rows, [int(value) for value in seen], [int(n) for n in counts])
        if line is None:
            return None
        found.append((line[0], line[1]))
    return found


def _through_lines(texture: Array, lines: list[tuple[float, float]]) -> Array:
    slope, offset = np.array([a for a, _ in lines]), np.array([b for _, b in lines])
    changed: Array = np.clip(texture * slope + offset, 0.0, 255.0)
    return changed


def _smooth_lines(texture: Array, lines: list[tuple[float, float]]) -> Linearised:
    slope = np.array([a for a, _ in lines])
    values = texture * slope + np.array([b for _, b in lines])
    inside = np.where((values < 0.0) | (values > 255.0), 0.0, slope)
    return np.clip(values, 0.0, 255.0), lambda gradient: gradient * inside


@cache
def _decoded() -> tuple[float, ...]:
    """Return the decoded value, 0 to 1, of each level."""
    return tuple(exact.power(level / 255.0, _GAMMA) for level in range(256))


@cache
def _decoded_slope() -> tuple[float, ...]:
    """Return the derivative of the decoded value at each level."""
    return tuple(_GAMMA / 255.0 * exact.power(level / 255.0, _GAMMA - 1.0) for level in range(256))
