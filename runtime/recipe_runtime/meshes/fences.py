"""Walls and fences. Both extend along y."""

from __future__ import annotations

from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import Pattern, Surface

_WALL = Surface("wall", Pattern.BRICK, Tag.WALLS)
_COPING = Surface("coping", Pattern.CONCRETE, Tag.WALLS)
_RAILING = Surface("fence", Pattern.METAL, Tag.FENCES)
_BOARDS = Surface("fence", Pattern.WOOD, Tag.FENCES)
_PICKET, _RAILS, _BOARDED = 0, 1, 2


def wall(b: Builder, e: Element) -> None:
    """Build a free-standing wall with a plinth and a coping. Its front is at x = 0 and faces +x."""
    thick, width, height = e.size
    half = width / 2
    b.box(_WALL, (-thick, -half, 0.0), (0.0, half, height - 0.12), "-z")
    b.box(_COPING, (-thick - 0.06, -half, height - 0.12), (0.06, half, height))
    b.box(_COPING, (-thick - 0.03, -half, 0.0), (0.03, half, 0.25), "-z")


def fence(b: Builder, e: Element) -> None:
    """Build a fence centred on the origin that faces +x; `style` 0 is a picket fence, 1 a railing, 2 close boards."""
    {_PICKET: _pickets, _RAILS: _railing, _BOARDED: _boards}[int(e.shape["style"])](b, *e.size)


def _posts(b: Builder, surface: Surface, thick: float, length: float, height: float, every: float) -> None:
    count = max(1, int(length / every + 0.5))
    for k in range(count + 1):
        y = (length - thick) * (k / count - 0.5)
        b.box(surface, (-thick / 2, y - thick / 2, 0.0), (thick / 2, y + thick / 2, height), "-z")


def _pickets(b: Builder, thick: float, length: float, height: float) -> None:
    """Add pointed pickets in front of two rails."""
    half, count = thick / 2, max(2, int(length / 0.18 + 0.5))
    _posts(b, _BOARDS, thick * 0.6, length, height * 0.92, 2.4)
    for z in (0.25 * height, 0.7 * height):
        b.box(_BOARDS, (-0.2 * thick, -length / 2, z), (0.1 * thick, length / 2, z + 0.08), "-y +y")
    back = 0.1 * thick
    for k in range(count):
        y, w = length * ((k + 0.5) / count - 0.5), 0.3 * length / count
        outline = [(y - w, 0.08), (y + w, 0.08), (y + w, height - w), (y, height), (y - w, height - w)]
        b.fan(_BOARDS, [(half, py, z) for py, z in outline])
        b.fan(_BOARDS, [(back, py, z) for py, z in outline[::-1]])
        for (y0, z0), (y1, z1) in zip(outline[1:], [*outline[2:], outline[0]], strict=True):
            b.quads(_BOARDS, [[(half, y0, z0), (back, y0, z0), (back, y1, z1), (half, y1, z1)]])


def _railing(b: Builder, thick: float, length: float, height: float) -> None:
    """Add thin bars between two iron rails."""
    _posts(b, _RAILING, thick, length, height, 2.0)
    for z in (0.12, height - 0.16):
        b.box(_RAILING, (-0.35 * thick, -length / 2, z), (0.35 * thick, length / 2, z + 0.04), "-y +y")
    count, w = max(2, int(length / 0.14 + 0.5)), 0.011
    for k in range(count):
        y = length * ((k + 0.5) / count - 0.5)
        b.box(_RAILING, (-w, y - w, 0.05), (w, y + w, height - 0.02), "-z")


def _boards(b: Builder, thick: float, length: float, height: float) -> None:
    """Add adjoining vertical boards under a rail."""
    half, count = thick / 2, max(1, int(length / 0.9 + 0.5))
    _posts(b, _BOARDS, thick, length, height, 2.4)
    for k in range(count):
        y0, y1 = length * (k / count - 0.5), length * ((k + 1) / count - 0.5)
        x = 0.25 * half * (1 if k % 2 else -1)
        b.box(_BOARDS, (x - 0.3 * half, y0, 0.05), (x + 0.3 * half, y1, height - 0.06))
    b.box(_BOARDS, (-half, -length / 2, height - 0.06), (half, length / 2, height))
