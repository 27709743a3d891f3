"""Arrays and records on a device."""

from __future__ import annotations

import ctypes
from typing import Any, TypeAlias, TypeVar

import numpy as np

from recipe_runtime.render.device.setup import wp

Struct = TypeVar("Struct")
DeviceArray: TypeAlias = "wp.array[Any, Any]"  # of any element type and shape; comments beside its uses say which


def zeros(count: int, kind: Any, device: str) -> DeviceArray:
    """An array of zeros. On a CPU pages are allocated when they are written to: most of a shadow map never is."""
    if device != "cpu":
        return wp.zeros(count, dtype=kind, device=device)
    return wp.array(np.zeros(count, wp.dtype_to_numpy(kind)), dtype=kind, device=device, copy=False)


def filled(struct: Struct, /, **fields: Any) -> Struct:
    """Set fields of a struct by name; numbers and arrays are converted to the fields' types.

    Raises:
        RuntimeError: The struct has no field of a name.
    """
    for name, value in fields.items():
        setattr(struct, name, value)
    return struct


def copied(struct: Any) -> Any:
    """A struct with the values of another, and the same arrays."""
    copy = struct._cls()
    copy.assign(struct)
    return copy


def record(struct: Any, device: str) -> DeviceArray:
    """A struct as an array of one: Warp passes structs by value into every function, and arrays by address."""
    return records([struct], device)


def records(structs: list[Any], device: str) -> DeviceArray:
    """Structs as an array, which keeps them: it holds only the addresses of their own arrays."""
    if device == "cpu":  # copied as they lie in memory: through NumPy it takes several times as long
        array: DeviceArray = wp.empty(len(structs), dtype=structs[0]._cls, device=device)
        for place, struct in enumerate(structs):
            body = struct.__ctype__()
            ctypes.memmove(array.ptr + place * array.strides[0], ctypes.addressof(body), ctypes.sizeof(body))
    else:
        array = wp.array(structs, dtype=structs[0]._cls, device=device)
    vars(array)["structs"] = structs
    return array
