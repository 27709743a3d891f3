"""Bounds of the bodies of a plan: for each kind of town element and of actor, its keys and their ranges.

The town generators and the library of blueprints stay within these tables, which the tests assert over seeds and
parameters. A plan read from a file is checked against them before use, since a body's shape determines how many
triangles it has. A range of two integers accepts whole numbers only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Element
from recipe_compiler.ir.plurals import count
from recipe_compiler.ir.semantic_tags import BODIES, BODY_TAGS, Tag

Range = tuple[float, float]

MAX_ROUTE_METRES = 16_000_000  # of the routes of all vehicles of a scene; a driver keeps a speed for each metre
MAX_TOUCHING = 4_000  # pairs of actors; PyBullet fails when it reports about 20,000 points of contact
MAX_TRIANGLES = 15_000_000  # of a town, if each of its elements has as many as its kind may have
MAX_PROP_TRIANGLES = 4_000_000  # of the props of a scene; plans do not have the contents of their meshes
MAX_TEXTURE_PIXELS = 64 << 20  # of all images of an appearance


@dataclass(frozen=True)
class Kind:
    """What a town may have of one kind of element.

    Attributes:
        max_count: maximal number of elements.
        size: ranges of the extents along the element's own x, y and z, metres.
        max_triangles: maximal number of triangles of one element's mesh, as the tests measure.
        shape: range of each key; all keys are required.
    """

    max_count: int
    size: tuple[Range, Range, Range]
    max_triangles: int
    shape: Mapping[str, Range] = field(default_factory=dict)


_KEY, _FLAG = {"key": (0, 63)}, (0, 1)


def _fixed(max_count: int, size: tuple[float, float, float], triangles: int, **shape: Range) -> Kind:
    """A kind whose elements are all of one size."""
    x, y, z = size
    return Kind(max_count, ((x, x), (y, y), (z, z)), triangles, shape)


KINDS: dict[str, Kind] = {
    "bench": _fixed(700, (0.5, 1.6, 0.85), 140),
    "bicycles": _fixed(300, (1.9, 1.8, 1.1), 2000, **_KEY),
    "billboard": _fixed(20, (0.5, 6.0, 6.0), 300, **_KEY),
    "bin": _fixed(700, (0.42, 0.42, 0.95), 120),
    "board": _fixed(400, (0.5, 0.62, 1.1), 500, **_KEY),
    "bollard": _fixed(250, (0.2, 0.2, 0.9), 200),
    "building": Kind(
        1200,
        ((12.0, 12.0), (7.0, 22.0), (6.0, 60.0)),
        7500,
        {
            "floors": (2, 16), "storey": (2.9, 3.4), "ground": (3.7, 4.6), "bays": (3, 8), "style": (0, 5),
            "shop": _FLAG, "awning": _FLAG, "left": _FLAG, "right": _FLAG, "roof": _FLAG, **_KEY,
        },
    ),
    "bus_stop": _fixed(200, (1.6, 4.0, 2.6), 400),
    "bush": Kind(1200, ((0.8, 2.1), (0.8, 2.1), (0.6, 1.7)), 800, _KEY),
    "cafe": _fixed(900, (1.3, 1.8, 2.4), 500, **_KEY),
    "carriageway": Kind(
        150,
        ((48.0, 48.0), (8.0, 24.0), (0.0, 0.0)),
        400,
        {"limit": (5, 150), "lanes": (2, 5), "lane": (3.0, 4.0), "shoulder": (2.0, 3.0), **_KEY},
    ),
    "delivery": _fixed(200, (0.8, 1.2, 1.3), 170, **_KEY),
    "fence": Kind(1500, ((0.08, 0.08), (0.8, 36.0), (1.0, 1.7)), 3000, {"style": (0, 2)}),
    "fountain": _fixed(2, (7.0, 7.0, 2.6), 4000),
    "gantry": Kind(
        60,
        ((0.9, 0.9), (10.0, 25.0), (7.4, 7.4)),
        1500,
        {"lanes": (2, 5), "lane": (3.0, 4.0), "first": (-10.0, 0.0), "exit": _FLAG, **_KEY},
    ),
    "ground": _fixed(2, (2400.0, 2400.0, 0.05), 2000, gap=(0.0, 60.0)),
    "guardrail": Kind(300, ((0.3, 0.5), (5.0, 48.0), (0.75, 0.8)), 500, {"double": _FLAG}),
    "hedge": Kind(1000, ((0.6, 0.8), (0.8, 36.0), (1.0, 1.7)), 4300, _KEY),
    "house": Kind(
        600,
        ((7.9, 10.1), (9.4, 13.1), (2.8, 6.2)),
        1500,
        {
            "floors": (1, 2), "storey": (2.6, 2.9), "roof": (0, 2), "pitch": (0.5, 0.9), "style": (0, 2),
            "garage": _FLAG, "porch": _FLAG, **_KEY,
        },
    ),
    "hydrant": _fixed(400, (0.3, 0.3, 0.8), 300),
    "junction": Kind(
        120,
        ((12.0, 17.0), (12.0, 17.0), (0.0, 0.0)),
        140,
        {"over_x": (6.0, 9.0), "over_y": (6.0, 9.0), "wide_x": (3.0, 5.5), "wide_y": (3.0, 5.5), **_KEY},
    ),
    "kiosk": _fixed(30, (2.5, 3.0, 2.8), 500, **_KEY),
    "lamp": Kind(1500, ((0.16, 0.2), (0.16, 0.2), (4.0, 10.0)), 140, {"arm": (0.5, 2.5)}),
    "letter_box": _fixed(200, (0.4, 0.44, 1.3), 300),
    "path": Kind(600, ((10.0, 48.0), (2.5, 3.0), (0.0, 0.01)), 10, {"drive": _FLAG}),
    "parking": Kind(100, ((6.2, 62.0), (2.1, 2.1), (0.0, 0.01)), 60, {"bays": (1, 10)}),
    "planter": _fixed(400, (1.2, 1.2, 0.9), 1000, **_KEY),
    "road": Kind(
        300,
        ((18.0, 120.0), (6.0, 10.6), (0.0, 0.0)),
        500,
        {
            "limit": (5, 150), "stop_a": (0.0, 3.5), "stop_b": (0.0, 3.5),
            "bay": (0.0, 2.3), "bay_from": (-55.0, 0.0), "bays": (0, 18),
            "bay_length": (6.2, 6.2), **_KEY,
        },
    ),
    "sidewalk": Kind(
        150,
        ((20.0, 125.0), (20.0, 125.0), (0.15, 0.15)),
        2000,
        {"radius": (3.0, 3.0), "walk": (2.0, 6.0), "verge": (0.0, 2.5), "paved": _FLAG},
    ),
    "sign": Kind(1500, ((0.1, 0.1), (0.5, 1.0), (2.5, 3.1)), 250, {"face": (0, 6), "value": (0, 120)}),
    "statue": _fixed(80, (2.0, 2.0, 4.5), 1500, **_KEY),
    "tower": Kind(70, ((15.0, 31.0), (19.0, 45.0), (8.0, 61.0)), 100, _KEY),
    "traffic_light": Kind(80, ((0.26, 0.26), (0.26, 0.26), (5.6, 5.6)), 260, {
        "arm": (1.0, 5.0), "cycle": (10.0, 300.0), "green_from": (0.0, 300.0), "green": (1.0, 300.0),
        "amber": (1.0, 10.0),
    }),
    "tree": Kind(
        1800,
        ((1.0, 9.0), (1.0, 9.0), (3.0, 15.0)),
        5800,
        {"trunk": (0.1, 0.26), "key": (0, 1 << 20), "species": (0, 4)},
    ),
    "wall": _fixed(250, (0.25, 9.0, 2.6), 60),
}  # fmt: skip

_MAX_REACH = 4.5  # metres, half the length of the longest vehicle

_MAX_BODY = 20.0  # metres, extent of a body from a file

_PERSON: dict[str, Range] = {
    "shoulder": (0.85, 1.15), "girth": (0.8, 1.35), "hair": (0, 10), "sleeves": (0, 1), "legs": (0, 2),
    "coat": (0.0, 0.35), "head": (0.95, 1.5), "limb": (0.85, 1.1), "bag": (0, 4),
    "female": (0, 1), "stoop": (0.0, 20.0), "top": (0, 4), "print": (0, 3),
    "denim": (0, 1), "beard": (0, 1), "phone": (0, 1), "glasses": (0, 2),
}  # fmt: skip
_WALKER: dict[str, Range] = {"height": (0.95, 2.05), **_PERSON}
_CAR: dict[str, Range] = {
    "body": (0, 6), "length": (3.2, 9.0), "width": (1.5, 2.5), "height": (1.3, 3.3), "wheelbase": (2.2, 4.3),
    "wheel": (0.28, 0.48), "clearance": (0.14, 0.32), "spokes": (3, 16), "blind": (0, 1), "sign": (0.0, 0.15),
    "style": (0, 3),
}  # fmt: skip
_TWO_WHEELER: dict[str, Range] = {
    "body": (7, 9), "length": (1.3, 2.4), "width": (0.5, 1.0), "height": (1.3, 2.0), "wheelbase": (0.8, 1.6),
    "wheel": (0.24, 0.38), "clearance": (0.1, 0.2), "rider": (1.2, 2.0), **_PERSON,
}  # fmt: skip


def town_faults(elements: Iterable[Element]) -> Iterator[str]:
    """Yield what is invalid about the elements of a town: shapes, sizes and numbers."""
    numbers: Counter[str] = Counter()
    for element in elements:
        numbers[element.kind] += 1
        wrong = _element_fault(element)
        if wrong is not None:
            yield f"{element.name!r} of the town: {wrong}"
    known = {kind: number for kind, number in numbers.items() if kind in KINDS}
    for kind, number in sorted(known.items()):
        if number > KINDS[kind].max_count:
            yield f"the town has {count(number, kind)}; at most {KINDS[kind].max_count:,} are allowed"
    triangles = sum(KINDS[kind].max_triangles * number for kind, number in known.items())
    if triangles > MAX_TRIANGLES:
        yield f"the town may have {triangles:,} triangles; at most {MAX_TRIANGLES:,} are allowed"


def _element_fault(element: Element) -> str | None:
    kind = KINDS.get(element.kind)
    if kind is None:
        return f"there is no kind of element {element.kind!r}"
    for axis, value, span in zip("xyz", element.size, kind.size, strict=True):
        if not span[0] <= value <= span[1]:
            return f"its size along {axis} is {value:g} m; a {element.kind} has {_shown(span)}"
    return _shape_fault(element.kind, element.shape, kind.shape)


def route_metres(actors: Iterable[ActorPlan]) -> float:
    """The length of the routes of all vehicles, in metres."""
    total = 0.0
    for actor in actors:
        if actor.category == "vehicle":
            points = [(actor.start.x, actor.start.y), *((point.x, point.y) for point in actor.route)]
            total += sum(exact.distance(*a, *b) for a, b in pairwise(points))
    return total


def routes_fault(actors: Iterable[ActorPlan]) -> str | None:
    """What is wrong with the length of the routes of a scene, in words; None if nothing is."""
    metres = route_metres(actors)
    if metres <= MAX_ROUTE_METRES:
        return None
    most = f"at most {MAX_ROUTE_METRES // 1000:,} are allowed"
    return f"the routes of the vehicles are {metres / 1000:,.0f} km long, and {most}"


def starts_fault(actors: Iterable[ActorPlan]) -> str | None:
    """What is wrong with the starts of a scene, in words; None if nothing is: too many actors start inside others."""
    bodies = sorted((a.start.x, a.start.y, _reach(a)) for a in actors)
    pairs = 0
    for n, (x, y, reach) in enumerate(bodies):
        for other_x, other_y, other_reach in bodies[n + 1 :]:
            if other_x - x >= reach + _MAX_REACH:
                break
            pairs += exact.distance(x, y, other_x, other_y) < reach + other_reach
    if pairs <= MAX_TOUCHING:
        return None
    return f"{pairs:,} pairs of actors start on top of each other, and at most {MAX_TOUCHING:,} may"


def _reach(actor: ActorPlan) -> float:
    """Half the length of a vehicle, or half the width of a person, about, in metres."""
    return min(actor.shape.get("length", 0.6) / 2, _MAX_REACH)


def actor_fault(actor: ActorPlan) -> str | None:
    """Return what is invalid about an actor's blueprint, tag or shape; None if it is valid."""
    ranges = shape_of(actor.blueprint)
    if not ranges:
        return f"there is no blueprint {actor.blueprint!r}"
    family, kind = actor.blueprint.split(".")[:2]
    category, tag = ("pedestrian", Tag.PEDESTRIAN) if family == "walker" else ("vehicle", BODY_TAGS[kind])
    if (actor.category, actor.tag) != (category, tag):
        return f"a {actor.blueprint} is not a {actor.category} with tag {actor.tag}"
    if actor.mesh is not None:
        size = max(b - a for a, b in zip(actor.mesh.low, actor.mesh.high, strict=True))
        if "rider" in actor.shape or size > _MAX_BODY:
            return f"a {actor.blueprint} cannot have a body from a file whose extent is {size:g} m"
    return _shape_fault(actor.blueprint, actor.shape, ranges)


POSE = "pose"
"""A key of the shape of some pedestrians: what they do."""
TALKING, SITTING = 1, 2


def shape_of(blueprint: str) -> Mapping[str, Range]:
    """Return the range of each key in the shape of a blueprint; empty for an unknown blueprint."""
    if blueprint.startswith("walker.pedestrian."):
        return _WALKER
    family, _, rest = blueprint.partition(".")
    body = rest.partition(".")[0]
    if family == "vehicle" and body in BODIES:
        number = BODIES.index(body)
        return {**(_TWO_WHEELER if number >= BODIES.index("motorcycle") else _CAR), "body": (number, number)}
    return {}


def _shape_fault(what: str, shape: Mapping[str, float], ranges: Mapping[str, Range]) -> str | None:
    """Return the first key of a shape that is missing, unknown or out of range, in words."""
    for key in sorted(({*shape} ^ {*ranges}) - ({POSE} if ranges is _WALKER else set())):
        return f"its shape has {key!r}, which no {what} has" if key in shape else f"its shape lacks {key!r}"
    for key, span in {**ranges, **({POSE: (TALKING, SITTING)} if POSE in shape else {})}.items():
        value = shape[key]
        whole = isinstance(span[0], int) and isinstance(span[1], int)
        if not span[0] <= value <= span[1] or (whole and value != int(value)):
            return f"its {key} is {value:g}; a {what} has {'a whole number of ' if whole else ''}{_shown(span)}"
    return None


def _shown(span: Range) -> str:
    return f"{span[0]:g} to {span[1]:g}"
