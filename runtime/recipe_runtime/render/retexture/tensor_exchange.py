"""Textures, pictures and gradients in tensors of other libraries, shared by DLPack: nothing is copied to the host.

Tensors are contiguous, on the device of the arrays, and have the channels first, [3, h, w].
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import cast

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.linear.texture_kernels import put_bytes, put_planes, put_shares, take_planes


def places_of(indices: NDArray[np.integer], device: str) -> DeviceArray:
    """Return indices of pixels or texels, for `take` and `put`."""
    array: DeviceArray = wp.array(np.ascontiguousarray(indices, np.int32), dtype=wp.int32, device=device)
    return array


def bytes_of(picture: NDArray[np.uint8], device: str) -> DeviceArray:
    """Return a picture, uint8 [H, W, 3], as uint8 [H * W * 3] on a device."""
    array: DeviceArray = wp.array(picture.reshape(-1), dtype=wp.uint8, device=device)
    return array


def take(tensor: object, places: DeviceArray) -> DeviceArray:
    """Return the colours of a tensor, float64 [3, h, w], at some places, vec3d."""
    colours: DeviceArray = wp.empty(places.size, dtype=wp.vec3d, device=places.device)
    planes = _planes(tensor, wp.float64)
    launch(take_planes, places.size, str(places.device), planes=planes, places=places, out_vectors=colours)
    return colours


def put(colours: DeviceArray, places: DeviceArray, out: object) -> None:
    """Write colours, vec3d, at some places of a tensor, float64 [3, h, w]."""
    planes = _planes(out, wp.float64)
    launch(put_planes, places.size, str(places.device), vectors=colours, places=places, out_planes=planes)


def put_picture(rgb: DeviceArray, out: object, quantised: bool) -> None:
    """Write the bytes of a picture, uint8 [H * W * 3], divided by 255, into a tensor [3, H, W].

    Args:
        rgb: The bytes.
        out: float32 if the picture is `quantised`, else float64.
        quantised: Whether this is the quotient of float32 numbers.
    """
    pixels, device = rgb.size // 3, str(rgb.device)
    if quantised:
        launch(put_bytes, pixels, device, rgb=rgb, out_planes=_planes(out, wp.float32))
    else:
        launch(put_shares, pixels, device, rgb=rgb, out_planes=_planes(out, wp.float64))


def on_stream(device: str, stream: int) -> AbstractContextManager[object]:
    """Return a context in which kernels run on a CUDA stream of another library, so that its tensors stay in order.

    Args:
        device: The Warp device; on a CPU the context does nothing.
        stream: The handle of the stream.
    """
    if device == "cpu":
        return nullcontext()
    scope: AbstractContextManager[object] = wp.ScopedStream(
        wp.Stream(device, cuda_stream=stream), sync_enter=True, sync_exit=True
    )
    return scope


def _planes(tensor: object, kind: type) -> DeviceArray:
    """Return the memory of a tensor as a flat array."""
    flat: DeviceArray = cast("DeviceArray", wp.from_dlpack(tensor, dtype=kind)).flatten()
    return flat
