"""The Trace: the pose of every rigid part of every actor at every frame, on an integer grid.

Positions are whole multiples of 2^-20 m, quaternions (x, y, z, w) of 2^-24, velocities of 2^-20 m/s. Snapping
removes differences of single ulps, and integers have one byte form, so a Trace has a digest, and all later stages are
equal on every host.
"""

from __future__ import annotations

import hashlib
import io
import math
import mmap
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import IO, Annotated, Any, Final, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import array_hasher, canonical_bytes, digest_bytes

from recipe_runtime.core.documents import Meta, decode

METRE = 1 << 20
UNIT = 1 << 24
_FORMAT: Final = "recipe/trace/1"
_CHUNK = 1 << 20  # bytes of an array that are handled at once
_POSITION, _ROTATION = 3 * 8, 4 * 4  # bytes a part
_VELOCITY = 3 * 8  # bytes an actor
_UNIT_ERROR = 1e-3  # of the square of a quaternion's length; snapping causes 1e-7
_LONGEST_HEADER = 8 << 20  # bytes, of names alone


class _Head(TypedDict):
    """The first line of the byte form."""

    format: Literal["recipe/trace/1"]
    frames: Annotated[int, Meta(ge=0)]
    actors: list[str]
    parts: list[str]


@dataclass(frozen=True)
class ContactEvent:
    """Two bodies touched."""

    first: str  # name of an actor, element or prop
    second: str
    start: int  # physics step since frame 0; negative during the warm-up
    end: int  # the last step with contact
    impulse: float  # N s, all together


@dataclass(frozen=True)
class Trace:
    """Motion of F frames, P rigid parts and A actors, in the world frame.

    `parts` names them `actor/part`, actors in plan order, each actor's base part first. `linear` and `angular` are
    the velocities of each actor's base. The arrays are read-only views of a file, or in memory. Contacts are neither
    part of the byte form nor of a digest.
    """

    actors: tuple[str, ...]
    parts: tuple[str, ...]
    positions: NDArray[np.int64]  # [F, P, 3], 2^-20 m
    rotations: NDArray[np.int32]  # [F, P, 4], x y z w, 2^-24
    linear: NDArray[np.int64]  # [F, A, 3], 2^-20 m/s
    angular: NDArray[np.int64]  # [F, A, 3], 2^-20 rad/s
    mapping: mmap.mmap | None = None  # the file that the arrays are views of
    contacts: tuple[ContactEvent, ...] | None = None  # in the order of their start; None if they are not known

    def __reduce__(self) -> tuple[object, ...]:
        return _restored, (self.to_bytes(), self.contacts)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @cached_property
    def digest(self) -> str:
        """Identity of the motion: over the digest of every actor's."""
        digests = self.prefix_digests([self.frames])
        return digest_bytes("trace/1", canonical_bytes([[a, digests[a][0]] for a in self.actors]))

    def actor_parts(self, actor: str) -> list[int]:
        """Indices of an actor's parts, its base first."""
        return self._rows.get(actor, [])

    def base_part(self, actor: str) -> int:
        """Index of an actor's base part."""
        return self._rows[actor][0]

    @cached_property
    def _rows(self) -> dict[str, list[int]]:
        rows: dict[str, list[int]] = {actor: [] for actor in self.actors}
        for index, part in enumerate(self.parts):
            rows.setdefault(part.rpartition("/")[0], []).append(index)
        return rows

    def prefix_digests(self, ends: Sequence[int]) -> dict[str, list[str]]:
        """Return digests of each actor's motion over its first frames, in one pass over each array.

        Args:
            ends: Numbers of frames, each from 0 to `frames`.

        Returns:
            For each actor a digest for each of `ends`.
        """
        parts = [np.array(self.actor_parts(actor), np.intp) for actor in self.actors]
        bases = range(len(self.actors))
        arrays: tuple[tuple[NDArray[np.generic], Sequence[Any]], ...] = (
            (self.positions, parts),
            (self.rotations, parts),
            (self.linear, bases),
            (self.angular, bases),
        )
        digests = [self._column_digests(array, columns, ends) for array, columns in arrays]
        return {
            actor: [digest_bytes("trace-actor/1", *(d[n][k].encode() for d in digests)) for k in range(len(ends))]
            for n, actor in enumerate(self.actors)
        }

    def _column_digests(
        self, array: NDArray[np.generic], columns: Sequence[Any], ends: Sequence[int]
    ) -> list[list[str]]:
        """`digest_array("trace-array/1", array[:end, column])` for every column and end."""
        kind = array.dtype.newbyteorder("<")
        shapes = [array[:0, column].shape[1:] for column in columns]
        hashers = [[array_hasher("trace-array/1", kind, (end, *shape)) for end in ends] for shape in shapes]
        for start, chunk in self._chunks(array, max(ends, default=0)):
            for column, shape, row in zip(columns, shapes, hashers, strict=True):
                data = memoryview(np.ascontiguousarray(chunk[:, column], dtype=kind).tobytes())
                frame = math.prod(shape) * kind.itemsize
                for end, hasher in zip(ends, row, strict=True):
                    if end > start:
                        hasher.update(data[: (end - start) * frame])
        return [[hasher.hexdigest() for hasher in row] for row in hashers]

    def _chunks(self, array: NDArray[np.generic], frames: int) -> Iterator[tuple[int, NDArray[np.generic]]]:
        """An array's first frames in pieces, each with the number of its first frame."""
        step = max(1, _CHUNK // max(1, array[:1].nbytes))
        for start in range(0, frames, step):
            yield start, array[start : min(start + step, frames)]
            self.release()

    def has_unit_rotations(self) -> bool:
        """Return whether every quaternion has a length of 1, but for rounding."""
        for _, chunk in self._chunks(self.rotations, self.frames):
            squares = np.square(chunk.astype(np.float64) / UNIT).sum(axis=-1)
            if np.abs(squares - 1).max(initial=0) > _UNIT_ERROR:
                return False
        return True

    def release(self) -> None:
        """Release the resident pages of a mapped file, so that they do not accumulate."""
        if self.mapping is not None:
            self.mapping.madvise(mmap.MADV_DONTNEED)

    def to_bytes(self) -> bytes:
        """Return the serialised form: a header line, four arrays, a checksum."""
        return b"".join(self.pieces())

    def pieces(self) -> Iterator[bytes]:
        """The byte form, piece by piece."""
        head = canonical_bytes(
            {"format": _FORMAT, "actors": list(self.actors), "parts": list(self.parts), "frames": self.frames}
        )
        hasher = hashlib.sha256(head + b"\n")
        yield head + b"\n"
        arrays: tuple[NDArray[np.generic], ...] = (self.positions, self.rotations, self.linear, self.angular)
        for array, kind in zip(arrays, _TYPES, strict=True):
            for _, chunk in self._chunks(array, self.frames):
                piece = chunk.astype(kind).tobytes()
                hasher.update(piece)
                yield piece
        yield hasher.digest()

    @classmethod
    def from_bytes(cls, data: bytes) -> Trace:
        """The inverse of `to_bytes`; ValueError if the bytes are damaged."""
        if hashlib.sha256(memoryview(data)[:-32]).digest() != data[-32:]:
            raise ValueError(_DAMAGED)
        actors, parts, frames, offset = _read_head(io.BytesIO(data), len(data))
        return _views(actors, parts, frames, data, offset)

    @classmethod
    def from_file(cls, file: IO[bytes], *, checked: bool = False) -> Trace:
        """A Trace whose byte form is the rest of a file, mapped and not read into memory.

        Args:
            file: a file on disk, at the first byte of the byte form; it may be closed afterwards, and must not be
                changed while the Trace is in use.
            checked: whether the bytes are known to be whole; else they are compared with their checksum.

        Raises:
            ValueError: the bytes are damaged.
        """
        start = file.tell()
        size = file.seek(0, io.SEEK_END) - start
        file.seek(start)
        if not checked and not _holds(file, size):
            raise ValueError(_DAMAGED)
        file.seek(start)
        actors, parts, frames, offset = _read_head(file, size)
        mapping = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return _views(actors, parts, frames, mapping, start + offset)


class TraceWriter:
    """Writes a Trace frame by frame to an anonymous temporary file."""

    def __init__(self, actors: Sequence[str], parts: Sequence[str], frames: int) -> None:
        self._actors, self._parts, self._frames = tuple(actors), tuple(parts), frames
        p, a = len(parts), len(actors)
        self._sizes = (p * _POSITION, p * _ROTATION, a * _VELOCITY, a * _VELOCITY)
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115  closed by `close`

    @property
    def frame_size(self) -> int:
        """Bytes of a frame."""
        return sum(self._sizes)

    def write(self, frame: int, data: bytes) -> None:
        """Write one frame.

        Args:
            frame: its number.
            data: positions [P, 3], rotations [P, 4], linear [A, 3], angular [A, 3], as `frame_bytes` joins them.
        """
        at = base = 0
        for size in self._sizes:
            rest, place = memoryview(data)[at : at + size], base + frame * size
            while rest:
                written = os.pwrite(self._file.fileno(), rest, place)
                rest, place = rest[written:], place + written
            at, base = at + size, base + self._frames * size

    def trace(self) -> Trace:
        """Return the Trace after all frames were written; it stays valid after the writer is closed."""
        empty = self._frames * self.frame_size == 0
        mapping = b"" if empty else mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
        return _views(self._actors, self._parts, self._frames, mapping, 0)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def frame_bytes(
    positions: NDArray[np.int64], rotations: NDArray[np.int32], linear: NDArray[np.int64], angular: NDArray[np.int64]
) -> bytes:
    """One frame as `TraceWriter.write` takes it."""
    arrays: tuple[NDArray[np.generic], ...] = (positions, rotations, linear, angular)
    return b"".join(array.astype(kind).tobytes() for array, kind in zip(arrays, _TYPES, strict=True))


def _restored(data: bytes, contacts: tuple[ContactEvent, ...] | None) -> Trace:
    return replace(Trace.from_bytes(data), contacts=contacts)


_TYPES = ("<i8", "<i4", "<i8", "<i8")
_DAMAGED = "the Trace is damaged: its checksum does not hold"


def _holds(file: IO[bytes], size: int) -> bool:
    """Whether the next `size` bytes end in the SHA-256 of those before."""
    hasher, left = hashlib.sha256(), size - 32
    while left > 0 and (piece := file.read(min(left, _CHUNK))):
        hasher.update(piece)
        left -= len(piece)
    return left == 0 and file.read(32) == hasher.digest()


def _read_head(file: IO[bytes], size: int) -> tuple[tuple[str, ...], tuple[str, ...], int, int]:
    """Return actors, parts, number of frames and length of the header of a byte form; ValueError if it is invalid."""
    line = file.readline(_LONGEST_HEADER + 1)
    if len(line) > _LONGEST_HEADER:
        raise ValueError(f"the Trace's header is over {_LONGEST_HEADER:,} bytes")
    try:
        head = decode(line, _Head)
    except ValueError as error:
        raise ValueError(f"not a Trace of format {_FORMAT}: {error}") from None
    f, p, a = head["frames"], len(head["parts"]), len(head["actors"])
    if f > size or size - 32 - len(line) != f * (p * (_POSITION + _ROTATION) + a * 2 * _VELOCITY):
        raise ValueError("the Trace's arrays are not as long as its header says")
    return tuple(head["actors"]), tuple(head["parts"]), f, len(line)


def _views(
    actors: tuple[str, ...], parts: tuple[str, ...], frames: int, buffer: bytes | mmap.mmap, offset: int
) -> Trace:
    """A Trace whose arrays are views of a buffer, from an offset on."""
    p, a = len(parts), len(actors)
    arrays: list[NDArray[Any]] = []
    for kind, shape in zip(_TYPES, ((p, 3), (p, 4), (a, 3), (a, 3)), strict=True):
        whole = (frames, *shape)
        count = math.prod(whole)
        arrays.append(np.frombuffer(buffer, kind, count, offset).reshape(whole) if count else np.zeros(whole, kind))
        offset += count * np.dtype(kind).itemsize
    positions, rotations, linear, angular = arrays
    mapping = buffer if isinstance(buffer, mmap.mmap) else None
    return Trace(actors, parts, positions, rotations, linear, angular, mapping)
