"""Arrays and records on a device."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from recipe_runtime.render.device.setup import wp


def zeros(count: int, kind: Any, device: str) -> Any:
    """An array of zeros. On a CPU its memory is taken as it is written to: most of a shadow map never is."""
    if device != "cpu":
        return wp.zeros(count, dtype=kind, device=device)
    return wp.array(np.zeros(count, wp.dtype_to_numpy(kind)), dtype=kind, device=device, copy=False)


def record(value: Any, device: str) -> Any:
    """A struct as an array of one. Warp passes structs by value into every function; this way only an address goes."""
    return records([value], device)


def records(values: list[Any], device: str) -> Any:
    """Structs as an array, which holds on to them: it carries but the addresses of their own arrays."""
    if device == "cpu":  # as they lie in memory: to build them anew by way of NumPy takes several times as long
        told = wp.empty(len(values), dtype=values[0]._cls, device=device)
        for place, value in enumerate(values):
            body = value.__ctype__()
            ctypes.memmove(told.ptr + place * told.strides[0], ctypes.addressof(body), ctypes.sizeof(body))
    else:
        told = wp.array(values, dtype=values[0]._cls, device=device)
    told.told_of = values
    return told
