"""A linear map and its transpose on a Warp device; sums have a fixed order, so that products have equal bytes."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.vector_kernels import add_vectors, multiply_vectors, subtract_vectors

Values = NDArray[np.float64]


class LinearMap(ABC):
    """A map A from C to R elements, each of three channels."""

    def __init__(self, device: str) -> None:
        self.device = device

    @abstractmethod
    def product(self, x: DeviceArray) -> DeviceArray:
        """Return A x: vec3d [R] of [C], both on the device."""

    @abstractmethod
    def transposed_product(self, y: DeviceArray) -> DeviceArray:
        """Return A^T y: vec3d [C] of [R], both on the device."""

    def forward(self, x: Values) -> Values:
        """Return A x: float64 [R, 3] of [C, 3]."""
        return numbers(self.product(vectors(x, self.device)))

    def backward(self, y: Values) -> Values:
        """Return A^T y: float64 [C, 3] of [R, 3]."""
        return numbers(self.transposed_product(vectors(y, self.device)))


def added(a: DeviceArray, b: DeviceArray) -> DeviceArray:
    """Return a + b, vec3d."""
    out: DeviceArray = wp.empty_like(a)
    launch(add_vectors, a.size, str(a.device), a=a, b=b, out_sum=out)
    return out


def subtracted(a: DeviceArray, b: DeviceArray) -> DeviceArray:
    """Return a - b, vec3d."""
    out: DeviceArray = wp.empty_like(a)
    launch(subtract_vectors, a.size, str(a.device), a=a, b=b, out_difference=out)
    return out


def multiplied(a: DeviceArray, b: DeviceArray) -> DeviceArray:
    """Return the products of the components of a and b, vec3d."""
    out: DeviceArray = wp.empty_like(a)
    launch(multiply_vectors, a.size, str(a.device), a=a, b=b, out_product=out)
    return out


def vectors(values: NDArray[np.floating] | Values, device: str) -> DeviceArray:
    """Return numbers [..., 3] as vec3d on a device; on a CPU the array may share their memory."""
    flat = np.ascontiguousarray(values, np.float64).reshape(-1, 3)
    array: DeviceArray = wp.array(flat, dtype=wp.vec3d, device=device, copy=device != "cpu")
    return array


def numbers(vectors: DeviceArray) -> Values:
    """Return vectors, vec3d, as float64 [*, 3]."""
    found: Values = vectors.numpy().reshape(-1, 3)
    return found
