"""Bloom: the light that bright places shed about them in the lens, as a share of a coarse, softened plate."""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler import exact
from recipe_compiler.plan import CameraPlan

from recipe_runtime.render.device import OPTIONS, launch, wp

wp.set_module_options(OPTIONS)

_ACROSS = 160  # coarse samples in a picture's width
_RADIUS = 12  # of them that light reaches
SHARE = 0.06  # of the light that is shed at intensity 1


@wp.kernel
def shrink(
    plate: wp.array[wp.vec3f], wide: wp.int32, high: wp.int32, side: wp.int32, columns: wp.int32,
    out: wp.array[wp.vec3f],
):  # fmt: skip
    """The mean of a square of samples."""
    i = wp.tid()
    x0 = i % columns * side
    y0 = i / columns * side
    total = wp.vec3f(0.0, 0.0, 0.0)
    count = wp.float32(0.0)
    for y in range(y0, wp.min(y0 + side, high)):
        for x in range(x0, wp.min(x0 + side, wide)):
            total = total + plate[y * wide + x]
            count = count + 1.0
    out[i] = total / count


@wp.kernel
def soften(
    light: wp.array[wp.vec3f], weights: wp.array[wp.float32], wide: wp.int32, high: wp.int32, across: wp.int32,
    out: wp.array[wp.vec3f],
):  # fmt: skip
    """Weighted by distance along rows (across = 1) or columns (0); the rim's light stands for what lies beyond."""
    i = wp.tid()
    x = i % wide
    y = i / wide
    reach = (weights.shape[0] - 1) / 2
    total = wp.vec3f(0.0, 0.0, 0.0)
    for n in range(-reach, reach + 1):
        u = wp.min(wp.max(x + n * across, 0), wide - 1)
        v = wp.min(wp.max(y + n * (1 - across), 0), high - 1)
        total = total + light[v * wide + u] * weights[n + reach]
    out[i] = total


def side_of(camera: CameraPlan) -> int:
    """Plate samples along the side of a coarse one."""
    return max(1, camera.width // _ACROSS)


def spread(plate: Any, camera: CameraPlan, device: str) -> Any:
    """The coarse, softened plate; its size is the plate's over `side_of`, rounded up."""
    side = side_of(camera)
    wide, high = -(-camera.width // side), -(-camera.height // side)
    first, second = (wp.empty(wide * high, dtype=wp.vec3f, device=device) for _ in range(2))
    weights = wp.array(_bell(), dtype=wp.float32, device=device)
    launch(shrink, wide * high, [plate, camera.width, camera.height, side, wide, first], device)
    launch(soften, wide * high, [first, weights, wide, high, 1, second], device)
    launch(soften, wide * high, [second, weights, wide, high, 0, first], device)
    return first


@cache
def _bell() -> NDArray[np.float32]:
    """A narrow and a broad bell curve added, their sum 1."""
    places = range(-_RADIUS, _RADIUS + 1)
    values = [exact.exp(-n * n / 4.5) + 0.25 * exact.exp(-n * n / 50.0) for n in places]
    whole = sum(values)
    return np.array([v / whole for v in values], np.float32)
