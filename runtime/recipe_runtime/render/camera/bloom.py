"""Bloom, host side: the light that the lens spreads around bright points, a blurred image of low resolution."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.camera.bloom_kernels import blur_rows, downsample
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp

_ACROSS = 160  # samples of the bloom image along the width
_RADIUS = 12  # of the blur, in these samples
SHARE = 0.06  # of the light that is spread at intensity 1


def side_of(camera: CameraPlan) -> int:
    """Return the samples of the HDR image along the side of a sample of the bloom image."""
    return max(1, camera.width // _ACROSS)


def spread(hdr_image: DeviceArray, camera: CameraPlan, device: str) -> DeviceArray:
    """Return the bloom image, vec3f, row by row; its size is the HDR image's divided by `side_of`, rounded up."""
    side = side_of(camera)
    wide, high = -(-camera.width // side), -(-camera.height // side)
    first, second = (wp.empty(wide * high, dtype=wp.vec3f, device=device) for _ in range(2))
    weights: wp.array[wp.float32] = wp.array(bell(), dtype=wp.float32, device=device)
    launch(
        downsample,
        wide * high,
        device,
        hdr_image=hdr_image,
        wide=camera.width,
        high=camera.height,
        side=side,
        columns=wide,
        out_light=first,
    )
    for across, source, target in ((1, first, second), (0, second, first)):
        shared = {"light": source, "weights": weights, "wide": wide, "high": high}
        launch(blur_rows, wide * high, device, across=across, out_light=target, **shared)
    return first


@cache
def bell() -> NDArray[np.float32]:
    """Return the weights of the blur: the sum of a narrow and a wide Gaussian, normalised."""
    places = range(-_RADIUS, _RADIUS + 1)
    values = [exact.exp(-n * n / 4.5) + 0.25 * exact.exp(-n * n / 50.0) for n in places]
    whole = sum(values)
    return np.array([v / whole for v in values], np.float32)
