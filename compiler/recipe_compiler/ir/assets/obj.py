"""Wavefront OBJ: vertices, texture coordinates, normals and faces, without references to other files."""

from __future__ import annotations

import io
import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from recipe_compiler.ir.assets.geometry import (
    MAX_SLOTS,
    MAX_TRIANGLES,
    MAX_VERTICES,
    AssetError,
    Floats,
    Indices,
    Raw,
    check_count,
)
from recipe_compiler.ir.assets.names import slot
from recipe_compiler.ir.assets.stl import SLOT, number

_IGNORED = {b"o", b"g", b"s", b"mg", b"l", b"p", b"vp", b"lod", b"shadow_obj", b"trace_obj", b"bevel", b"c_interp"}

_MAX_LINE = 1 << 20  # bytes; a polygon's corners are on one

Corner = tuple[int, int, int]  # vertex, texture coordinate, normal; -1: none


@dataclass
class _Group:
    """The faces of one material, and the corners that they use."""

    corners: dict[Corner, int] = field(default_factory=dict)
    triangles: list[tuple[int, int, int]] = field(default_factory=list)


@dataclass
class _Column:
    """Rows of numbers, one after the other: a list of lists would take eight times the memory."""

    width: int
    numbers: array[float] = field(default_factory=lambda: array("d"))

    def __len__(self) -> int:
        """The number of rows."""
        return len(self.numbers) // self.width

    def rows(self) -> Floats:
        """The rows as an array [N, width]."""
        return np.array(self.numbers, np.float64).reshape(-1, self.width)


@dataclass
class _Reader:
    points: _Column = field(default_factory=lambda: _Column(3))
    uvs: _Column = field(default_factory=lambda: _Column(2))
    normals: _Column = field(default_factory=lambda: _Column(3))
    groups: dict[str, _Group] = field(default_factory=dict)
    slot: str = SLOT
    count: int = 0

    def line(self, words: Sequence[bytes]) -> None:
        """Parse one line."""
        word = words[0]
        if word == b"v":
            self._numbers(self.points, words)
        elif word == b"vt":
            self._numbers(self.uvs, words)
        elif word == b"vn":
            self._numbers(self.normals, words)
        elif word == b"f":
            self._face(words[1:])
        elif word == b"usemtl":
            self.slot = slot(b" ".join(words[1:]).decode("ascii", "replace"), SLOT)
        elif word == b"mtllib":
            raise AssetError("`mtllib` names another file; remove the line, colours come from `look` and `image`")
        elif word not in _IGNORED:
            shown = word[:20].decode("ascii", "replace")
            raise AssetError(f"{shown!r} is not part of a plain triangle mesh; export it as plain faces")

    def _numbers(self, column: _Column, words: Sequence[bytes]) -> None:
        if len(words) - 1 < column.width:
            raise AssetError(f"{len(words) - 1} numbers instead of {column.width}; export it again")
        if len(column) >= MAX_VERTICES:
            check_count(len(column) + 1, "vertices", MAX_VERTICES)
        column.numbers.extend([number(w) for w in words[1 : 1 + column.width]])

    def _corner(self, word: bytes) -> Corner:
        cells = word.split(b"/")
        columns = (self.points, self.uvs, self.normals)
        found = [-1, -1, -1]
        for place, (cell, column) in enumerate(zip(cells, columns, strict=False)):
            if cell:
                found[place] = _index(cell, len(column))
        if len(cells) > 3 or found[0] < 0:
            raise AssetError("a corner of a face has no vertex; export it again")
        return found[0], found[1], found[2]

    def _face(self, words: Sequence[bytes]) -> None:
        if len(words) < 3:
            raise AssetError("a face has fewer than three corners; export it again")
        self.count += len(words) - 2
        check_count(self.count, "triangles", MAX_TRIANGLES)
        group = self.groups.setdefault(self.slot, _Group())
        check_count(len(self.groups), "materials", MAX_SLOTS)
        numbers = [group.corners.setdefault(self._corner(word), len(group.corners)) for word in words]
        group.triangles += [(numbers[0], numbers[k], numbers[k + 1]) for k in range(1, len(numbers) - 1)]


def read(content: bytes) -> list[Raw]:
    """Return a part for each material of the faces; polygons become triangle fans.

    Raises:
        AssetError: a line is invalid; the message has its number.
    """
    if b"\0" in content:
        raise AssetError("is not an OBJ file: it holds a zero byte; OBJ is text")
    reader = _Reader()
    joined = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for at, line in enumerate(io.BytesIO(joined), start=1):
        if len(line) > _MAX_LINE:
            raise AssetError(f"line {at} is longer than {_MAX_LINE >> 20} MiB; export it with smaller faces")
        words = line.split(b"#", 1)[0].split()
        if words:
            try:
                reader.line(words)
            except AssetError as error:
                raise AssetError(f"line {at}: {error}") from None
    columns = [column.rows() for column in (reader.points, reader.uvs, reader.normals)]
    return [_raw(columns, slot, group) for slot, group in reader.groups.items()]


def _raw(columns: Sequence[Floats], slot: str, group: _Group) -> Raw:
    corners: Indices = np.array(list(group.corners), np.int64).reshape(-1, 3)
    points, uvs, normals = columns
    uv = None
    if len(uvs) and (corners[:, 1] >= 0).all():
        uv = uvs[corners[:, 1]]
        uv = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=-1)  # in OBJ files, v = 0 is the bottom
    normal = normals[corners[:, 2]] if len(normals) and (corners[:, 2] >= 0).all() else None
    triangles: Indices = np.array(group.triangles, np.int64).reshape(-1, 3)
    return Raw(slot, points[corners[:, 0]], triangles, normal, uv, both_sides=True)


def _index(cell: bytes, count: int) -> int:
    """Convert an index that counts from 1, or from -1 backwards, to one that counts from 0."""
    shown = cell[:20].decode("ascii", "replace")
    if not re.match(rb"-?[0-9]{1,9}\Z", cell):
        raise AssetError(f"{shown!r} is not a corner of a face; export it again")
    value = int(cell)
    value = value - 1 if value > 0 else count + value
    if not 0 <= value < count or cell.strip(b"-0") == b"":
        raise AssetError(f"a face names number {shown} of {count}, which does not exist; export it again")
    return value
