"""Flat surfaces of a town's elements and of boards (a test compares them with the meshes).

Each kind of element has rectangles in the element's own frame. Geometry that is farther from a rectangle's plane than
its `reach` does not show the patch.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from recipe_compiler.ir import exact
from recipe_compiler.ir.patches import STATIC, PatchFace
from recipe_compiler.ir.plan import Element, Pose, PropPlan, TownPlan
from recipe_compiler.library.surfaces.surface import FlatSurface, Range, Surface, Vec, sides, texture_map

_REACH = 0.02  # metres
_BOARD_REACH = 0.005  # metres: less than a board's thickness, so that its other side does not show the patch
_ROAD_REACH = 0.03  # metres: includes road markings and repairs
_CLOSE_BOARDS = 2  # style of a board fence
_FRONT = (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)  # right and down, seen from +x
_BACK = (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
_LEFT = (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)  # seen from +y
_RIGHT = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
_TOP = (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)  # upright for a viewer that looks along +x

_UPRIGHT = {"front": _FRONT, "back": _BACK, "left": _LEFT, "right": _RIGHT, "top": _TOP}


@dataclass(frozen=True)
class _Rectangle:
    """A rectangle in the frame of an element: `origin` is the point of x = z = 0."""

    name: str
    side: str  # a key of _UPRIGHT
    origin: Vec
    x: Range
    z: Range
    reach: float = _REACH


def town_surfaces(town: TownPlan) -> Iterator[Surface]:
    """Yield all surfaces of a town, in the order of its elements."""
    for element in town.elements:
        yield from element_surfaces(element)


def element_surfaces(element: Element) -> Iterator[Surface]:
    """Yield the surfaces of an element, the default one first."""
    for rectangle in _RECTANGLES[element.kind](element) if element.kind in KINDS else ():
        yield _placed(rectangle, element.name, element.pose)


def prop_surfaces(prop: PropPlan) -> Iterator[Surface]:
    """Yield the surfaces of a prop: both sides of a board, or the texture map of a mesh."""
    (x0, y0, z0), (x1, y1, z1) = prop.low, prop.high
    if prop.mesh is not None:
        rows = [sides(STATIC, prop.low, prop.high, names) for names in (("left", "front"), ("top",), ("right", "rear"))]
        whole = texture_map("body", prop.name, (), rows)
        islands = tuple((name, _turned_face(face, prop.pose)) for name, face in whole.islands)
        yield dataclasses.replace(whole, islands=islands)
        return
    for name, x in (("front", x1), ("back", x0)):
        rectangle = _Rectangle(name, name, (x, (y0 + y1) / 2, z0), _centred(y1 - y0), (0.0, z1 - z0), _BOARD_REACH)
        yield _placed(rectangle, prop.name, prop.pose)


def _wall(e: Element) -> list[_Rectangle]:
    thick, width, height = e.size
    z = (0.25, height - 0.12)  # from the plinth to the coping
    return [
        _Rectangle("front", "front", (0.0, 0.0, 0.0), _centred(width), z),
        _Rectangle("back", "back", (-thick, 0.0, 0.0), _centred(width), z),
    ]


def _billboard(e: Element) -> list[_Rectangle]:
    _, width, height = e.size
    return [
        _Rectangle("front", "front", (0.066, 0.0, 0.0), _centred(width - 0.24), (0.46 * height + 0.12, height - 0.12))
    ]


def _bus_stop(e: Element) -> list[_Rectangle]:
    depth, width, _ = e.size
    x0, x1, y = -depth / 2 + 0.25, depth / 2 - 0.44, width / 2
    middle = (x0 + x1) / 2
    return [
        _Rectangle("poster", "right", (middle, y - 0.134, 0.0), _centred(x1 - x0), (0.3, 1.95)),
        _Rectangle("poster_back", "left", (middle, y - 0.016, 0.0), _centred(x1 - x0), (0.3, 1.95)),
    ]


def _kiosk(e: Element) -> list[_Rectangle]:
    depth, width, height = e.size
    x0, x1, z = -depth / 2, depth / 2 - 0.6, (0.0, height - 0.35)
    middle = (x0 + x1) / 2
    return [
        _Rectangle("back", "back", (x0, 0.0, 0.0), _centred(width), z),
        _Rectangle("left", "left", (middle, width / 2, 0.0), _centred(x1 - x0), z),
        _Rectangle("right", "right", (middle, -width / 2, 0.0), _centred(x1 - x0), z),
    ]


def _building(e: Element) -> list[_Rectangle]:
    depth, width, height = e.size
    return [_Rectangle("back", "back", (-depth, 0.0, 0.0), _centred(width), (0.0, height))]


def _house(e: Element) -> list[_Rectangle]:
    """The garage door, if there is one."""
    _, width, _ = e.size
    y0, y1 = -width / 2 + 0.5, -width / 2 + min(3.2, 0.5 * width)
    door = _Rectangle("garage", "front", (-0.2, (y0 + y1) / 2, 0.0), _centred(y1 - y0), (0.0, 2.2))
    return [door] if e.shape["garage"] else []


def _fence(e: Element) -> list[_Rectangle]:
    """A board fence: every other board is set back by 2 cm, and the posts protrude."""
    thick, length, height = e.size
    middle, z = 0.15 * thick, (0.05, height - 0.06)
    if e.shape["style"] != _CLOSE_BOARDS:
        return []
    return [
        _Rectangle("front", "front", (middle, 0.0, 0.0), _centred(length), z),
        _Rectangle("back", "back", (-middle, 0.0, 0.0), _centred(length), z),
    ]


def _gantry(e: Element) -> list[_Rectangle]:
    """The board over each lane, from the left."""
    depth, _, height = e.size
    x, half, z = depth / 2 + 0.072, (e.shape["lane"] - 0.25) / 2, (height - 2.0, height + 0.4)
    middles = [e.shape["first"] + n * e.shape["lane"] for n in range(int(e.shape["lanes"]))]
    return [_Rectangle(f"board{n}", "front", (x, y, 0.0), (-half, half), z) for n, y in enumerate(middles)]


def _sign(e: Element) -> list[_Rectangle]:
    _, across, height = e.size
    return [_Rectangle("front", "front", (0.056, 0.0, 0.0), _centred(across), (height - across, height), 0.018)]


def _road(e: Element) -> list[_Rectangle]:
    length, width, height = e.size
    return [_Rectangle("top", "top", (0.0, 0.0, height), _centred(width), _centred(length), _ROAD_REACH)]


_RECTANGLES: dict[str, Callable[[Element], list[_Rectangle]]] = {
    "billboard": _billboard,
    "building": _building,
    "bus_stop": _bus_stop,
    "carriageway": _road,
    "fence": _fence,
    "gantry": _gantry,
    "house": _house,
    "kiosk": _kiosk,
    "road": _road,
    "sign": _sign,
    "wall": _wall,
}
KINDS = frozenset(_RECTANGLES)
"""Kinds of elements that have surfaces."""


def _centred(length: float) -> Range:
    return -length / 2, length / 2


def _placed(rectangle: _Rectangle, body: str, pose: Pose) -> FlatSurface:
    right, down = _UPRIGHT[rectangle.side]
    x, y, z = _turned(rectangle.origin, pose)
    return FlatSurface(
        name=rectangle.name,
        body=body,
        part=STATIC,
        slots=(),
        origin=(x + pose.x, y + pose.y, z + pose.z),
        right=_turned(right, pose),
        down=_turned(down, pose),
        x=rectangle.x,
        z=rectangle.z,
        reach=rectangle.reach,
    )


def _turned_face(face: PatchFace, pose: Pose) -> PatchFace:
    x, y, z = _turned(face.corner, pose)
    turned = {"right": _turned(face.right, pose), "down": _turned(face.down, pose)}
    # not a copy, whose numbers would not be rounded
    return PatchFace.model_validate({**dict(face), "corner": (x + pose.x, y + pose.y, z + pose.z), **turned})


def _turned(v: Vec, pose: Pose) -> Vec:
    """Return a vector rotated by a pose: roll, then pitch, then yaw, about fixed axes."""
    x, y, z = v
    sine, cosine = exact.sin_cos_deg(pose.roll)
    y, z = cosine * y - sine * z, sine * y + cosine * z
    sine, cosine = exact.sin_cos_deg(pose.pitch)
    x, z = cosine * x + sine * z, cosine * z - sine * x
    sine, cosine = exact.sin_cos_deg(pose.yaw)
    return cosine * x - sine * y + 0.0, sine * x + cosine * y + 0.0, z + 0.0  # -0.0 becomes 0.0
