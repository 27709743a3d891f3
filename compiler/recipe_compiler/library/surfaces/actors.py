"""Surfaces of actors, by the shape of their blueprint (a test compares them with the meshes).

Texture maps are projected from boxes around the parts at rest. A vehicle has one texture map for its paint, and a
rectangle on each side of its body. A person has one texture map for the trunk, the tails of a coat and the sleeves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from recipe_compiler.ir.plan import ActorPlan
from recipe_compiler.library.surfaces.surface import BoxSide, FlatSurface, Surface, Vec, sides, texture_map

_PAINT = ("paint",)
_SHIRT = ("shirt",)
_ROUND = ("front", "rear", "left", "right")
_REACH = 0.35  # metres from a rectangle's plane within which a body shows a patch: bodies are curved


def actor_surfaces(actor: ActorPlan) -> Iterator[Surface]:
    """Yield the surfaces of an actor, texture maps first. A body from a file has rectangles on all its materials."""
    shape = actor.shape
    if actor.mesh is not None:
        yield from _of_file(actor)
    elif actor.category == "pedestrian":
        yield from _person(actor.name, shape, shape["height"])
    elif "rider" in shape:
        x, y, z = 0.75 * shape["length"] / 2, shape["width"] / 2, 0.8 * shape["height"]
        fork = sides("fork", (-0.4, -0.3, -0.5), (0.5, 0.3, 0.5), _ROUND, "fork ")
        body = sides("chassis", (-x, -y, 0.0), (x, y, z), (*_ROUND, "top"))
        yield texture_map("body", actor.name, _PAINT, [body, fork])
        yield from _person(actor.name, shape, shape["rider"])
    else:
        yield from _vehicle(actor.name, shape)


def _vehicle(name: str, shape: Mapping[str, float]) -> Iterator[Surface]:
    x, y, z = 0.515 * shape["length"], 0.51 * shape["width"], 1.02 * shape["height"]
    low, high = (-x, -y, 0.0), (x, y, z)
    rows = [sides("chassis", low, high, names) for names in (("left", "front"), ("top",), ("right", "rear"))]
    yield texture_map("body", name, _PAINT, rows)
    yield from _sides(name, shape, _PAINT)


def _sides(name: str, shape: Mapping[str, float], slots: tuple[str, ...]) -> Iterator[Surface]:
    x, y, z = shape["length"] / 2, shape["width"] / 2, shape["height"]
    base = shape["clearance"]
    for side in sides("chassis", (-x, -y, base), (x, y, z), ("left", "right", "front", "rear", "top")):
        yield _rectangle(name, "roof" if side.side == "top" else side.side, side, slots)


def _of_file(actor: ActorPlan) -> Iterator[Surface]:
    if actor.category == "pedestrian":
        yield from _chest(actor.name, actor.shape, actor.shape["height"], ())
    else:
        yield from _sides(actor.name, actor.shape, ())


def _person(name: str, shape: Mapping[str, float], h: float) -> Iterator[Surface]:
    """Yield the surfaces of the shirt or coat of a person `h` metres tall."""
    girth, wide = max(shape["girth"], 1.0), max(shape["shoulder"], shape["girth"], 1.0)
    torso = (-0.105 * h * girth, -0.145 * h * wide, -0.055 * h), (0.105 * h * girth, 0.145 * h * wide, 0.3 * h)
    rows = [sides("torso", *torso, (*_ROUND, "top"))]
    hip = 0.0 if "rider" in shape else (0.045 + 0.475 * shape["limb"]) * h  # above the origin of the pelvis
    low, high = hip - 0.05 * h - shape["coat"], hip + 0.1 * h
    tails = (-0.13 * h * girth, -0.14 * h * wide, low), (0.13 * h * girth, 0.14 * h * wide, high)
    rows.append(sides("pelvis", *tails, _ROUND, "tails "))
    if shape["coat"] > 0.0:
        low, high = -0.03 * h - shape["coat"], 0.05 * h
        flap = (-0.16 * h * girth, -0.18 * h * wide, low), (0.16 * h * girth, 0.18 * h * wide, high)
        for hand in ("left", "right"):
            rows.append(sides(f"thigh_{hand}", *flap, _ROUND, f"thigh_{hand} "))
    arms = [("upper_arm", -0.24, 0.03)] + ([("forearm", -0.18, 0.13)] if shape["sleeves"] > 0 else [])
    for arm, end, begin in arms:
        box = (-0.05 * h * girth, -0.05 * h * girth, end * h), (0.05 * h * girth, 0.05 * h * girth, begin * h)
        row = [sides(f"{arm}_{hand}", *box, _ROUND, f"{arm}_{hand} ") for hand in ("left", "right")]
        rows.append([side for found in row for side in found])
    yield texture_map("shirt", name, _SHIRT, rows)
    yield from _chest(name, shape, h, _SHIRT)


def _chest(name: str, shape: Mapping[str, float], h: float, slots: tuple[str, ...]) -> Iterator[Surface]:
    girth, wide = max(shape["girth"], 1.0), max(shape["shoulder"], shape["girth"], 1.0)
    chest = (-0.07 * h * girth, -0.1 * h * wide, 0.0), (0.07 * h * girth, 0.1 * h * wide, 0.22 * h)
    for side, label in zip(sides("torso", *chest, ("front", "rear")), ("chest", "back"), strict=True):
        yield _rectangle(name, label, side, slots, middle=True)


def _rectangle(body: str, name: str, side: BoxSide, slots: tuple[str, ...], middle: bool = False) -> FlatSurface:
    """Return the rectangle of a box's side; its z is 0 at the part's origin, or at its middle if it is level."""
    face = side.face((0.0, 0.0, 1.0, 1.0))
    flat = middle or side.side == "top"
    half = face.width / 2
    fall = face.height / 2 if flat else face.corner[2]
    a, b, c = (face.corner[n] + half * face.right[n] + fall * face.down[n] for n in range(3))
    origin: Vec = (a, b, c)
    z = (-face.height / 2, face.height / 2) if flat else (side.low[2], side.high[2])
    return FlatSurface(name, body, side.part, slots, origin, face.right, face.down, (-half, half), z, _REACH)
