"""Sparse matrices (CSR) and their transposes on a device: products are summed in fixed order, without atomics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.linear_map import LinearMap, Values
from recipe_runtime.render.linear.vector_kernels import multiply_rows

_ENTRY_BYTES = 12  # column and weight


@dataclass(frozen=True, eq=False)
class RowMatrix:
    """A sparse matrix [R, C]: row r has the entries firsts[r] .. firsts[r + 1] - 1, in ascending order of columns."""

    firsts: NDArray[np.int32]  # [R + 1]
    columns: NDArray[np.int32]
    weights: Values
    width: int  # C

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.firsts) - 1, self.width

    def transposed(self) -> RowMatrix:
        """Return the transpose."""
        order = np.argsort(self.columns, kind="stable")
        rows = np.repeat(np.arange(self.shape[0], dtype=np.int32), np.diff(self.firsts))
        firsts = np.searchsorted(self.columns[order], np.arange(self.width + 1)).astype(np.int32)
        return RowMatrix(firsts, rows[order], self.weights[order], self.shape[0])


def row_matrix(firsts: NDArray[np.int32], columns: NDArray[np.int32], weights: Values, width: int) -> RowMatrix:
    """Return a matrix of entries by row, with columns in any order.

    Entries of the same row and column are added, in their order; zeros are left out.

    Args:
        firsts: Index of each row's first entry, and the number of entries, int32 [R + 1].
        columns: Column of each entry.
        weights: Value of each entry.
        width: Number of columns.
    """
    rows = np.repeat(np.arange(len(firsts) - 1, dtype=np.int64), np.diff(firsts))
    places = rows * width + columns
    order = np.argsort(places, kind="stable")
    places, weights = places[order], weights[order]
    new = np.diff(places, prepend=-1) != 0
    starts = np.flatnonzero(new)
    sums = np.bincount(np.cumsum(new) - 1, weights, len(starts))  # in order
    kept = sums != 0.0
    found, sums = places[starts][kept], sums[kept]
    ends = np.searchsorted(found, np.arange(len(firsts), dtype=np.int64) * width).astype(np.int32)
    return RowMatrix(ends, (found % width).astype(np.int32), sums, width)


class SparseProduct(LinearMap):
    """Products with a sparse matrix A and with its transpose, on a Warp device."""

    def __init__(self, matrix: RowMatrix, device: str) -> None:
        super().__init__(device)
        self.matrix, self.transpose = matrix, matrix.transposed()
        self._arrays = [_uploaded(m, device) for m in (self.matrix, self.transpose)]

    @property
    def memory(self) -> int:
        """About how many bytes of memory it takes: matrix and transpose, on the host and on the device."""
        return _ENTRY_BYTES * 4 * len(self.matrix.columns)

    def product(self, x: DeviceArray) -> DeviceArray:
        """As `LinearMap.product`."""
        return self._multiply(0, x, self.matrix.shape[0])

    def transposed_product(self, y: DeviceArray) -> DeviceArray:
        """As `LinearMap.transposed_product`."""
        return self._multiply(1, y, self.matrix.width)

    def _multiply(self, which: int, x: DeviceArray, rows: int) -> DeviceArray:
        firsts, columns, weights = self._arrays[which]
        out: DeviceArray = wp.empty(rows, dtype=wp.vec3d, device=self.device)
        inputs = {"firsts": firsts, "columns": columns, "weights": weights, "x": x}
        launch(multiply_rows, rows, self.device, out_y=out, **inputs)
        return out


def _uploaded(matrix: RowMatrix, device: str) -> tuple[DeviceArray, DeviceArray, DeviceArray]:
    copy = device != "cpu"  # on a CPU the arrays share the matrix's memory
    firsts: DeviceArray = wp.array(matrix.firsts, dtype=wp.int32, device=device, copy=copy)
    columns: DeviceArray = wp.array(matrix.columns, dtype=wp.int32, device=device, copy=copy)
    weights: DeviceArray = wp.array(matrix.weights, dtype=wp.float64, device=device, copy=copy)
    return firsts, columns, weights
