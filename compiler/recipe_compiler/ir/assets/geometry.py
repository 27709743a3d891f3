"""Mesh data of a file: triangles by material, in the project's frame, validated and rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_TRIANGLES = 500_000
MAX_VERTICES = 3 * MAX_TRIANGLES
MAX_COORDINATE = 1e6  # in the file's own unit
MAX_UV = 1e4
MAX_SLOTS = 64
GREY = "#909090"

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


class AssetError(ValueError):
    """An asset file is invalid; the message has the fault and the remedy on one line."""


@dataclass(frozen=True)
class Part:
    """Triangles of one material, counter-clockwise seen from outside. x forward, y left, z up; the file's own unit.

    A `picture` is one of the file's images, multiplied by the colour; uv (0, 0) is its top-left corner.
    """

    slot: str
    vertices: Floats  # [V, 3]
    normals: Floats  # [V, 3] unit
    uvs: Floats  # [V, 2]
    triangles: Indices  # [T, 3]
    colour: str = GREY  # sRGB
    picture: int | None = None
    repeat: bool = True  # wrap mode beyond the picture's edges: repeat, else clamp
    mapped: bool = False  # whether the file has texture coordinates for it
    follows: Floats | None = None  # [V, 8] of an actor's body: four nodes, then the weight of each, of sum 1


@dataclass(frozen=True)
class MeshData:
    """A mesh and its box."""

    parts: tuple[Part, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return sum(len(part.triangles) for part in self.parts)


@dataclass(frozen=True)
class Raw:
    """A part as a file gives it. Without normals its faces are flat."""

    slot: str
    vertices: Floats
    triangles: Indices
    normals: Floats | None = None
    uvs: Floats | None = None
    colour: str = GREY
    picture: int | None = None
    repeat: bool = True
    both_sides: bool = False
    follows: Floats | None = None  # [V, 8] of an actor's body: four nodes, then the weight of each, of sum 1


def finish(raws: Sequence[Raw], up: str) -> MeshData:
    """Join the parts of a file into a mesh, with x forward, y left and z up.

    Args:
        raws: the parts.
        up: the file's axis that points up: `y` (then z is forward) or `z`.

    Raises:
        AssetError: the mesh is empty, too large or invalid.
    """
    check_count(sum(len(raw.triangles) * (1 + raw.both_sides) for raw in raws), "triangles", MAX_TRIANGLES)
    parts = [part for raw in raws if (part := _part(raw, up)) is not None]
    if not parts:
        raise AssetError("has no triangle with an area above 0; export it with faces")
    slots = len({part.slot for part in parts})
    if slots > MAX_SLOTS:
        raise AssetError(f"{slots} materials exceed the limit of {MAX_SLOTS}; join some")
    low = np.min([part.vertices.min(axis=0) for part in parts], axis=0)
    high = np.max([part.vertices.max(axis=0) for part in parts], axis=0)
    return MeshData(tuple(parts), _triple(low), _triple(high))


def check_count(count: int, what: str, limit: int) -> None:
    """Raise AssetError if a count exceeds its limit."""
    if count > limit:
        raise AssetError(f"{count} {what} exceed the limit of {limit}; simplify the mesh")


def rounded(values: Floats) -> Floats:
    """Round to a grid of 1e-6; -0 becomes 0."""
    return np.rint(values * 1e6) / 1e6 + 0.0


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products of rows."""
    x, y, z = (a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1], a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
               a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])  # fmt: skip
    return np.stack([x, y, z], axis=-1)


def lengths(a: Floats) -> Floats:
    """Lengths of rows, as a column."""
    size: Floats = np.sqrt(a[:, 0] * a[:, 0] + a[:, 1] * a[:, 1] + a[:, 2] * a[:, 2])[:, None]
    return size


def _part(raw: Raw, up: str) -> Part | None:
    vertices = _bounded(raw.vertices, "a vertex", MAX_COORDINATE)
    triangles = raw.triangles
    if len(triangles) and not (int(triangles.min()) >= 0 and int(triangles.max()) < len(vertices)):
        raise AssetError(f"a face names a vertex that is not there; it has {len(vertices)}")
    vertices = rounded(_turned(vertices, up))
    corners = vertices[triangles]
    faces = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    has_area = lengths(faces)[:, 0] > 1e-12
    triangles, faces = triangles[has_area], faces[has_area]
    if not len(triangles):
        return None
    faces = faces / lengths(faces)
    uvs = np.zeros((len(vertices), 2)) if raw.uvs is None else _bounded(raw.uvs, "a texture coordinate", MAX_UV)
    follows = np.zeros((len(vertices), 0)) if raw.follows is None else raw.follows
    if raw.normals is None:
        order = triangles.reshape(-1)
        vertices, uvs, normals = vertices[order], uvs[order], np.repeat(faces, 3, axis=0)
        follows = follows[order]
        triangles = np.arange(len(order), dtype=np.int64).reshape(-1, 3)
    else:
        normals = _unit(_turned(_bounded(raw.normals, "a normal", MAX_COORDINATE), up), triangles, faces)
        used, triangles = np.unique(triangles, return_inverse=True)
        vertices, uvs, normals, triangles = vertices[used], uvs[used], normals[used], triangles.reshape(-1, 3)
        follows = follows[used]
    if raw.both_sides:
        triangles = np.concatenate([triangles, triangles[:, ::-1] + len(vertices)])
        vertices, uvs = np.concatenate([vertices, vertices]), np.concatenate([uvs, uvs])
        normals, follows = np.concatenate([normals, -normals]), np.concatenate([follows, follows])
    shape = vertices, rounded(normals), rounded(uvs), triangles
    kept = None if raw.follows is None else follows
    return Part(raw.slot, *shape, raw.colour, raw.picture, raw.repeat, raw.uvs is not None, kept)


def _bounded(values: Floats, what: str, most: float) -> Floats:
    if not np.isfinite(values).all():
        raise AssetError(f"{what} is not a finite number (NaN or infinity); export it again")
    if len(values) and float(np.abs(values).max()) > most:
        raise AssetError(f"{what} lies {float(np.abs(values).max()):.3g} away, beyond {most:g}; scale it down")
    return values


def _turned(values: Floats, up: str) -> Floats:
    return values[:, [2, 0, 1]] if up == "y" else values


def _unit(normals: Floats, triangles: Indices, faces: Floats) -> Floats:
    """Normalize normals; a vertex without a normal gets that of its last face."""
    size = lengths(normals)
    missing = size[:, 0] < 1e-6
    unit: Floats = normals / np.where(missing[:, None], 1.0, size)
    if missing.any():
        of_faces = np.zeros_like(unit)
        of_faces[triangles.reshape(-1)] = np.repeat(faces, 3, axis=0)
        unit[missing] = of_faces[missing]
    return unit


def _triple(row: Floats) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])
