"""Surfaces to which a patch can be applied: flat rectangles, and texture maps that cover entire bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from recipe_compiler.ir.patches import PatchFace

Vec = tuple[float, float, float]
Range = tuple[float, float]

_GAP = 0.02  # gap between the islands of a texture map, relative to the width of its widest row
_AXES: dict[str, tuple[Vec, Vec]] = {  # directions of u and v, seen from outside, by side of a box
    "front": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    "rear": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "right": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "top": ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
}


@dataclass(frozen=True)
class FlatSurface:
    """A rectangle on a body. Seen from its front, x is to the right and z up from `origin`, metres."""

    name: str
    body: str
    part: str
    slots: tuple[str, ...]  # slots of the body that show a patch; empty: all
    origin: Vec  # in the part's frame
    right: Vec  # unit
    down: Vec  # unit
    x: Range
    z: Range
    reach: float  # metres, see `PatchFace`

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the largest patch that fits."""
        return self.x[1] - self.x[0], self.z[1] - self.z[0]

    @property
    def middle(self) -> tuple[float, float]:
        """Its middle, x and z."""
        return (self.x[0] + self.x[1]) / 2, (self.z[0] + self.z[1]) / 2

    def room(self, x: float, z: float) -> tuple[float, float]:
        """Return width and height of the largest patch centred on a point; 0 or less if the point is outside."""
        return 2 * min(x - self.x[0], self.x[1] - x), 2 * min(z - self.z[0], self.z[1] - z)

    def face(self, x: float, z: float, width: float, height: float) -> PatchFace:
        """Return the face of a patch that is centred on a point."""
        across, along = x - width / 2, -(z + height / 2)
        a, b, c = (self.origin[n] + across * self.right[n] + along * self.down[n] for n in range(3))
        return PatchFace(
            part=self.part,
            corner=(a, b, c),
            right=self.right,
            down=self.down,
            width=width,
            height=height,
            reach=self.reach,
        )


@dataclass(frozen=True)
class WholeSurface:
    """A texture map that covers slots of a body entirely: islands, each projected from one side of a box."""

    name: str
    body: str
    slots: tuple[str, ...]
    islands: tuple[tuple[str, PatchFace], ...]  # each with its name
    aspect: float  # width / height of the map at which texels are square on the body


Surface = FlatSurface | WholeSurface


@dataclass(frozen=True)
class BoxSide:
    """A side of a box around a part of a body, in the part's frame."""

    name: str
    part: str
    side: str  # front (+x), rear, left (+y), right or top
    low: Vec
    high: Vec

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in metres, seen from outside."""
        x, y, z = (b - a for a, b in zip(self.low, self.high, strict=True))
        return {"front": (y, z), "rear": (y, z), "left": (x, z), "right": (x, z), "top": (x, y)}[self.side]

    @property
    def corner(self) -> Vec:
        """The top left corner, seen from outside."""
        (x0, y0, _z0), (x1, y1, z1) = self.low, self.high
        return {
            "front": (x1, y0, z1),
            "rear": (x0, y1, z1),
            "left": (x1, y1, z1),
            "right": (x0, y0, z1),
            "top": (x1, y0, z1),
        }[self.side]

    def face(self, region: tuple[float, float, float, float]) -> PatchFace:
        """Return the face that projects a region of a texture from this side of the box onto the part."""
        right, down = _AXES[self.side]
        width, height = self.size
        depth = max(b - a for a, b in zip(self.low, self.high, strict=True))
        return PatchFace(
            part=self.part,
            corner=self.corner,
            right=right,
            down=down,
            width=width,
            height=height,
            region=region,
            reach=2 * depth,
        )


def texture_map(name: str, body: str, slots: tuple[str, ...], rows: Sequence[Sequence[BoxSide]]) -> WholeSurface:
    """Lay out the sides of boxes in rows, at a common scale, with gaps between them."""
    widths = [sum(side.size[0] for side in row) for row in rows]
    heights = [max(side.size[1] for side in row) for row in rows]
    gap = _GAP * max(widths)
    wide = max(w + gap * (len(row) - 1) for w, row in zip(widths, rows, strict=True))
    high = sum(heights) + gap * (len(rows) - 1)
    islands: list[tuple[str, PatchFace]] = []
    top = 0.0
    for row, tall in zip(rows, heights, strict=True):
        left = 0.0
        for side in row:
            w, h = side.size
            region = left / wide, top / high, min((left + w) / wide, 1.0), min((top + h) / high, 1.0)
            if min(w, h) > 0.0:  # a flat mesh has no other sides
                islands.append((side.name, side.face(region)))
            left += w + gap
        top += tall + gap
    return WholeSurface(name, body, slots, tuple(islands), wide / high)


def sides(part: str, low: Vec, high: Vec, names: Iterable[str], prefix: str = "") -> list[BoxSide]:
    """Return the named sides of a box with corners `low` and `high` in a part's frame."""
    return [BoxSide(f"{prefix}{side}", part, side, low, high) for side in names]
