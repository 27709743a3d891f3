"""Memory layouts: named arrays in one block of memory, which one copy transfers."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.setup import wp

_ALIGNMENT = 256  # bytes


@dataclass(frozen=True)
class _Field:
    """Offset, type and shape of an array."""

    offset: int  # bytes
    kind: Any  # Warp's type of an element
    shape: tuple[int, ...]
    stride: int  # bytes of an element

    @property
    def size(self) -> int:
        """Bytes."""
        return self.stride * int(np.prod(self.shape, dtype=np.int64))


def span_of(kind: Any, name: str) -> tuple[int, int]:
    """Return offset and size in bytes of a field of a struct."""
    field = getattr(kind.ctype, name)
    return field.offset, field.size


class MemoryLayout:
    """The layout of a block of memory."""

    def __init__(self) -> None:
        self._fields: dict[str, _Field] = {}
        self.size = 0  # bytes

    def add(self, name: str, kind: Any, shape: tuple[int, ...]) -> None:
        """Add an array."""
        field = _Field(self.size, kind, shape, int(wp.types.type_size_in_bytes(kind)))
        self._fields[name] = field
        self.size += -(-max(field.size, 1) // _ALIGNMENT) * _ALIGNMENT

    def arrays(self, memory: Any) -> dict[str, Any]:
        """Return the arrays of a block in device memory, uint8 [size]; they are valid as long as the block."""
        return {
            name: wp.array(ptr=memory.ptr + f.offset, dtype=f.kind, shape=f.shape, device=memory.device)
            for name, f in self._fields.items()
        }

    def views(self, memory: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
        """Return the arrays of a block in host memory, for plain numbers only."""
        found = {}
        for name, f in self._fields.items():
            kind = wp.dtype_to_numpy(f.kind)
            found[name] = memory[f.offset : f.offset + f.size].view(kind).reshape(f.shape)
        return found

    def rows(self, count: int) -> NDArray[np.uint8]:
        """Allocate blocks of zeros, [count, size]."""
        return np.zeros((count, self.size), np.uint8)

    def put(self, rows: NDArray[np.uint8], name: str, values: NDArray[np.generic], offset: int = 0) -> None:
        """Write values [count, ...] as float32 into an array of all rows, at a byte offset in it."""
        start = self._fields[name].offset + offset
        flat = values.reshape(len(rows), -1).astype(np.float32)
        rows[:, start : start + flat.shape[1] * 4] = np.ascontiguousarray(flat).view(np.uint8)

    def put_records(self, row: NDArray[np.uint8], name: str, values: Sequence[Any], at: int = 0) -> None:
        """Write structs into an array of one row, at an element offset."""
        field = self._fields[name]
        for n, value in enumerate(values, start=at):
            start = field.offset + n * field.stride
            row[start : start + field.stride] = np.frombuffer(
                ctypes.string_at(ctypes.addressof(value._ctype), field.stride), np.uint8
            )

    def mark(self, mask: NDArray[np.bool_], name: str, offset: int, size: int, at: int = 0) -> None:
        """Mark some bytes of an array's element in a mask."""
        field = self._fields[name]
        start = field.offset + at * field.stride + offset
        mask[start : start + size] = True
