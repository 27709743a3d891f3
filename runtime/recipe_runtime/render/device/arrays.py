"""Arrays and Warp structs on a device."""

from __future__ import annotations

import ctypes
from typing import Any, TypeAlias, TypeVar

import numpy as np

from recipe_runtime.render.device.setup import wp

Struct = TypeVar("Struct")
DeviceArray: TypeAlias = "wp.array[Any, Any]"  # of any element type and shape; comments at its uses say which


def zeros(count: int, kind: Any, device: str) -> DeviceArray:
    """Return a 1-D array of zeros.

    On a CPU, memory is taken only when a page is first written to: most of a shadow map never is.
    """
    if device != "cpu":
        return wp.zeros(count, dtype=kind, device=device)
    return wp.array(np.zeros(count, wp.dtype_to_numpy(kind)), dtype=kind, device=device, copy=False)


def set_fields(struct: Struct, /, **fields: object) -> Struct:
    """Set fields of a struct by name, in place; numbers and arrays are converted to the fields' types.

    Returns:
        The same struct.

    Raises:
        RuntimeError: The struct has no field of a name.
    """
    for name, value in fields.items():
        setattr(struct, name, value)
    return struct


def copy_struct(struct: Any) -> Any:
    """Return a copy of a struct. Both refer to the same arrays."""
    copy = struct._cls()
    copy.assign(struct)
    return copy


def struct_of(array: DeviceArray) -> Any:
    """Return the first struct of an array that `struct_array` made."""
    return vars(array)["structs"][0]


def struct_array(structs: list[Any], device: str) -> DeviceArray:
    """Upload structs as an array.

    Kernels take even a single struct this way: Warp passes structs to functions by value, and arrays by address.

    Args:
        structs: One or more structs of the same type.
        device: The device that the array is created on.

    Returns:
        The array. It holds a reference to the structs, since its elements contain only the addresses of their arrays.
    """
    if device == "cpu":  # copy the bytes: the conversion through NumPy takes several times as long
        array: DeviceArray = wp.empty(len(structs), dtype=structs[0]._cls, device=device)
        for place, struct in enumerate(structs):
            body = struct.__ctype__()
            ctypes.memmove(array.ptr + place * array.strides[0], ctypes.addressof(body), ctypes.sizeof(body))
    else:
        array = wp.array(structs, dtype=structs[0]._cls, device=device)
    vars(array)["structs"] = structs
    return array
