"""The library of blueprints: pedestrians, vehicles, and two-wheelers with their riders."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from recipe_compiler.ir.plan import ActorMesh, ActorPlan, Pose, TexturePlan
from recipe_compiler.ir.semantic_tags import BODIES, BODY_TAGS, Category, Tag
from recipe_compiler.ir.streams import Stream

Palette = dict[str, tuple[str, ...]]


@dataclass(frozen=True)
class Blueprint:
    """A kind of actor.

    `shape` determines its mesh and joints; `palette` holds the possible colours of each slot. `attributes` have CARLA's
    names: `generation` of a pedestrian; `base_type` and `number_of_wheels` of a vehicle.
    """

    id: str
    category: Category
    tag: int
    shape: dict[str, float]
    palette: Palette
    default_speed: float  # m/s
    attributes: dict[str, str]
    mesh: ActorMesh | None = None  # of a blueprint of the recipe
    textures: Mapping[str, TexturePlan] = field(default_factory=dict)  # by slot, likewise


_SKIN = ("#f1c7a5", "#e0ac86", "#c98f67", "#a86f4b", "#7d4f35", "#5a3826")
_YOUNG_HAIR = ("#1e1814", "#2e221b", "#4a3222", "#6d4a2e", "#a57c4a", "#5b2f1d")
_HAIR = (*_YOUNG_HAIR, "#8e8a86")
_GREY = ("#8e8a86", "#b4b0aa", "#d6d3cc", "#6e6a66")
_INNER = ("#e9e6de", "#23262c", "#8fa3b5", "#b8b2a4", "#7d3b38")
_SOLES = ("#e6e3da", "#2a2826", "#8a6a48")
_DENIM = ("#2b3d5c", "#3f5a80", "#6a86a6", "#1e2a40", "#54606e")
_HIGH_VISIBILITY = ("#d8e23a", "#f07a22")
_GROWN = 1.55  # metres; shorter pedestrians are children
_SHIRTS = (
    "#b43a35", "#2f5e8c", "#e3ded3", "#37704f", "#d9a63a", "#3b3f4a", "#7a4c7e", "#c96f3c",
    "#5f8fa8", "#8c8f94", "#d7c3a1", "#22334d",
)  # fmt: skip
_BRIGHT = ("#d8443c", "#2f7fc1", "#f0b429", "#4aa564", "#e87ea1", "#7c5cbf", "#f2efe6", "#27496d")  # children's
_TROUSERS = ("#2c3446", "#3b3b40", "#5a5346", "#24262b", "#6f6a5e", "#41536e", "#4a3d34")
_SHOES = ("#1d1b1a", "#4b3524", "#d8d6d0", "#6a3b2a", "#2b3442")
_BAGS = ("#2a2d33", "#7a3b2e", "#3d5a44", "#4a5a78", "#c2853c", "#5b4636")
_HATS = ("#2a2d33", "#8f2f2a", "#35507a", "#d8d4c8", "#4a5f43", "#c98a2e")
_HELMETS = ("#f0efe9", "#1b1c1f", "#b3272d", "#2c5a9a", "#d8d23a", "#e8762c")
_PAINT = (
    "#d9dadb", "#1f2124", "#8b9095", "#a3232a", "#1f3f70", "#4d5a60", "#e8e4da", "#2c4a3a",
    "#b9702c", "#5e1f2c", "#6f8fa8",
)  # fmt: skip

CROPPED, SHORT, LONG, TIED, CAP, BEANIE, CYCLIST, FULL, CURLY, BOB, BALD = range(11)  # hair and hats
BACKPACK, SATCHEL, HANDBAG, SHOPPING = 1, 2, 3, 4
COLLAR, HOOD, OPEN, VEST = 1, 2, 3, 4  # tops; 0: a T-shirt or a sweater
STRIPES, CHECKS, PRINT = 1, 2, 3


# The shape of a person. `shoulder` and `girth` scale the average build for a height; `head` and `limb` scale an adult's
# head and legs. `coat` lowers the hem, in metres. sleeves: 0 short, 1 long. legs: 0 shorts, 1 trousers, 2 skirt.
# `female` is between male (0) and female (1) proportions; `stoop` bends an old back, in degrees. glasses: 2 dark.
# phone: 1 for a person who telephones.
_PERSON = {
    "shoulder": 1.0,
    "girth": 1.0,
    "hair": float(SHORT),
    "sleeves": 1.0,
    "legs": 1.0,
    "coat": 0.0,
    "head": 1.0,
    "limb": 1.0,
    "bag": 0.0,
    "female": 0.0,
    "stoop": 0.0,
    "top": 0.0,
    "print": 0.0,
    "denim": 0.0,
    "beard": 0.0,
    "phone": 0.0,
    "glasses": 0.0,
}


def _clothing(child: bool, hats: tuple[str, ...], person: Mapping[str, float]) -> Palette:
    worn: Palette = {"bag": _BAGS} if person["bag"] else {}
    if person["hair"] >= CAP:
        worn["hat"] = hats
    return worn | {
        "skin": _SKIN,
        "hair": _GREY if person["stoop"] > 0.0 else _YOUNG_HAIR if child else _HAIR,
        "shirt": _HIGH_VISIBILITY if person["top"] == VEST else _BRIGHT if child else _SHIRTS,
        "inner": _INNER,
        "sole": _SOLES,
        "trousers": _DENIM if person["denim"] else _TROUSERS,
        "shoes": _SHOES,
        "lips": ("#a8625a", "#8f4f48"),
        "eye": ("#e9e5df",),
        "pupil": ("#2a1d16", "#1c1512", "#33414d"),
    }


def _walker(number: int, height: float, speed: float = 1.4, **person: float) -> Blueprint:
    """Return a pedestrian with a height in metres, a child below `_GROWN`; `person` overrides values of `_PERSON`."""
    child = height < _GROWN
    shape = _numbers({"height": height}, _PERSON, person)
    return Blueprint(
        f"walker.pedestrian.{number:04d}",
        "pedestrian",
        Tag.PEDESTRIAN.value,
        shape,
        _clothing(child, _HATS, shape),
        speed,
        {"generation": "child" if child else "adult"},
    )


def _coloured(paint: tuple[str, ...]) -> Palette:
    return {
        "paint": paint,
        "glass": ("#1c2328", "#20282c"),
        "trim": ("#17181a", "#232427"),
        "rubber": ("#1a1a1b",),
        "disc": ("#6f7174",),
        "rim": ("#9a9da1", "#75787c", "#b9bcc0"),
        "headlight": ("#a9b3ba",),
        "taillight": ("#7d0d12",),
        "brakelight": ("#8f1016",),
        "indicator_left": ("#c9741a",),
        "indicator_right": ("#c9741a",),
        "reverselight": ("#c9ccce",),
        "seats": ("#26272a", "#3a3733", "#5f5548"),
        "plate": ("#d9d7cf",),
    }


def _numbers(*parts: Mapping[str, float]) -> dict[str, float]:
    """Return the parts of a shape as one; later values replace earlier ones."""
    return {key: float(value) for part in parts for key, value in part.items()}


def _body(name: str, size: tuple[float, float, float]) -> dict[str, float]:
    return {"body": BODIES.index(name.split(".")[0]), "length": size[0], "width": size[1], "height": size[2]}


def _vehicle(
    name: str,
    size: tuple[float, float, float],
    *,
    speed: float = 9.0,
    paint: tuple[str, ...] = _PAINT,
    livery: tuple[str, ...] = (),
    beacon: tuple[str, ...] = (),
    cargo: tuple[str, ...] = (),
    **shape: float,
) -> Blueprint:
    """Return a vehicle.

    Args:
        name: the blueprint's id without `vehicle.`.
        size: length, width and height, metres.
        speed: default speed, m/s.
        paint: colours to draw from.
        livery: colours of a band over the doors, or of the name on a truck's load, if it has one.
        beacon: colours of a light bar, if it has one.
        cargo: colours of a truck's load.
        shape: `wheelbase`, radius of a `wheel` and ground `clearance`, metres; number of `spokes` of a rim; `blind`: 1
            for a van without rear windows; `sign`: height of a taxi's lit roof sign, metres; `style`: the number of
            the outlines of its body, for a truck of its load.
    """
    kind, _, _ = name.partition(".")
    numbers = _numbers(_body(name, size), {"spokes": 5, "blind": 0, "sign": 0, "style": 0}, shape)
    base = kind if kind in ("van", "truck", "bus") else "car"
    attributes = {"base_type": base, "number_of_wheels": "4"}
    tag = BODY_TAGS[kind].value
    palette = _coloured(paint) | {
        slot: c for slot, c in (("livery", livery), ("beacon", beacon), ("cargo", cargo)) if c
    }
    if kind == "bus":
        palette["display"] = ("#1c1c1e",)
    return Blueprint(f"vehicle.{name}", "vehicle", tag, numbers, palette, speed, attributes)


def _twowheeler(
    name: str, size: tuple[float, float, float], *, speed: float, paint: tuple[str, ...], rider: float, **shape: float
) -> Blueprint:
    """Return a two-wheeler with a rider `rider` metres tall; the size includes both.

    `shape` has `wheelbase` and the radius of a `wheel`, metres, and overrides values of `_PERSON`.
    """
    kind, _, _ = name.partition(".")
    numbers = _numbers(_body(name, size), {"clearance": 0.15, "rider": rider}, _PERSON, shape)
    palette = _clothing(rider < _GROWN, _HELMETS, numbers) | _coloured(paint)
    lamps = ("brakelight", "indicator_left", "indicator_right", "disc")
    for absent in ("glass", "seats", "reverselight", *(("plate", *lamps) if kind == "bicycle" else ("disc",))):
        palette.pop(absent, None)
    attributes = {"base_type": kind, "number_of_wheels": "2"}
    return Blueprint(f"vehicle.{name}", "vehicle", BODY_TAGS[kind].value, numbers, palette, speed, attributes)


_PEOPLE = (
    _walker(1, 1.78, top=COLLAR, denim=1),
    _walker(2, 1.66, shoulder=0.92, girth=0.92, female=1, hair=LONG, print=STRIPES, denim=1, bag=HANDBAG),
    _walker(3, 1.84, shoulder=1.06, girth=1.04, hair=CROPPED, sleeves=0, print=PRINT, bag=BACKPACK),
    _walker(4, 1.71, shoulder=0.93, girth=0.95, female=1, hair=TIED, top=OPEN, coat=0.22),
    _walker(5, 1.75, shoulder=1.05, girth=1.2, top=OPEN, coat=0.06, beard=1),
    _walker(6, 1.62, shoulder=0.95, girth=1.12, female=1, hair=BOB, legs=2, glasses=1),
    _walker(7, 1.80, shoulder=1.02, girth=0.94, hair=CAP, legs=0, sleeves=0, glasses=2),
    _walker(8, 1.69, shoulder=0.92, girth=0.88, female=1, hair=TIED, sleeves=0, denim=1, bag=SATCHEL),
    _walker(9, 1.88, shoulder=1.04, coat=0.3, top=COLLAR),
    _walker(10, 1.58, shoulder=0.93, female=1, hair=LONG, coat=0.1, top=HOOD),
    _walker(11, 1.28, 1.2, shoulder=0.92, girth=0.95, sleeves=0, legs=0, head=1.2, limb=0.95, print=STRIPES),
    _walker(12, 1.40, 1.3, shoulder=0.9, girth=0.9, hair=TIED, legs=2, head=1.14, limb=0.98),
    _walker(13, 1.05, 1.0, shoulder=0.9, girth=1.05, hair=CROPPED, head=1.42, limb=0.88, denim=1, print=PRINT),
    _walker(14, 1.18, 1.1, shoulder=0.9, hair=LONG, legs=2, sleeves=0, head=1.29, limb=0.92),
    _walker(15, 1.34, 1.25, shoulder=0.92, hair=CAP, head=1.17, limb=0.96, bag=BACKPACK, top=HOOD),
    _walker(
        16, 1.52, 1.35, shoulder=0.94, girth=0.92, hair=CURLY, head=1.07, limb=1.0, bag=BACKPACK, top=HOOD, denim=1
    ),
    _walker(17, 1.82, shoulder=1.06, girth=1.28, hair=BALD, sleeves=0, denim=1, beard=1),
    _walker(18, 1.73, shoulder=1.0, hair=BEANIE, coat=0.08, top=HOOD),
    _walker(19, 1.64, shoulder=0.92, girth=0.96, female=1, hair=LONG, coat=0.26, bag=SHOPPING),
    _walker(20, 1.70, 1.1, shoulder=0.98, girth=1.08, hair=CAP, coat=0.12, stoop=14, top=COLLAR),
    _walker(
        21,
        1.60,
        1.0,
        shoulder=0.92,
        girth=1.1,
        female=1,
        hair=CURLY,
        legs=2,
        coat=0.14,
        stoop=16,
        glasses=1,
        bag=HANDBAG,
    ),
    _walker(22, 1.79, shoulder=1.03, top=VEST, sleeves=0, hair=CAP, beard=1),
    _walker(23, 1.76, shoulder=1.0, girth=0.9, hair=SHORT, top=COLLAR, print=CHECKS, denim=1, glasses=1, bag=SATCHEL),
    _walker(24, 1.70, shoulder=0.92, girth=0.94, female=1, hair=CURLY, top=OPEN, denim=1, phone=1),
    _walker(25, 1.86, shoulder=1.04, girth=1.08, hair=CROPPED, top=OPEN, beard=1, glasses=2, phone=1),
    _walker(26, 1.68, shoulder=0.92, girth=0.9, female=1, hair=BOB, legs=2, sleeves=0, print=STRIPES),
)

_CARS = (
    _vehicle("sedan.a", (4.68, 1.82, 1.45), wheelbase=2.75, wheel=0.325, clearance=0.17),
    _vehicle("sedan.b", (4.92, 1.87, 1.47), wheelbase=2.92, wheel=0.34, clearance=0.16, spokes=10, style=3),
    _vehicle("sedan.taxi", (4.80, 1.84, 1.62), wheelbase=2.82, wheel=0.33, clearance=0.17,
             sign=0.12, paint=("#e0b11f", "#d9d6c8")),
    _vehicle("sedan.coupe", (4.52, 1.86, 1.36), wheelbase=2.68, wheel=0.34, clearance=0.14, spokes=10, style=1),
    _vehicle("sedan.police", (4.84, 1.86, 1.59), wheelbase=2.84, wheel=0.335, clearance=0.17, sign=0.12, style=2,
             paint=("#e6e7e8",), livery=("#1d4f9c", "#2c6a3f"), beacon=("#1c3fc0",)),
    _vehicle("hatchback.city", (3.44, 1.65, 1.50), wheelbase=2.34, wheel=0.29, clearance=0.15, spokes=6, style=1),
    _vehicle("hatchback.estate", (4.74, 1.83, 1.49), wheelbase=2.80, wheel=0.33, clearance=0.16, spokes=10, style=2),
    _vehicle("hatchback.a", (4.08, 1.76, 1.49), wheelbase=2.55, wheel=0.315, clearance=0.17),
    _vehicle("hatchback.b", (3.62, 1.66, 1.52), wheelbase=2.36, wheel=0.295, clearance=0.16, spokes=7, style=3),
    _vehicle("suv.a", (4.62, 1.88, 1.68), wheelbase=2.70, wheel=0.365, clearance=0.22),
    _vehicle("suv.b", (4.95, 1.96, 1.80), wheelbase=2.90, wheel=0.395, clearance=0.24, spokes=6, style=2),
    _vehicle("suv.compact", (4.26, 1.80, 1.62), wheelbase=2.60, wheel=0.345, clearance=0.20, spokes=7, style=1),
    _vehicle("van.a", (5.15, 1.98, 2.05), wheelbase=3.10, wheel=0.34, clearance=0.2, speed=8.0),
    _vehicle(
        "van.cargo", (5.45, 2.02, 2.38), wheelbase=3.30, wheel=0.345, clearance=0.2, speed=8.0, blind=True, style=1,
        paint=("#e4e2da", "#d8d9da", "#3a5f8c", "#e0a92e", "#5b6166"),
    ),
    _vehicle("pickup.a", (5.25, 1.92, 1.80), wheelbase=3.22, wheel=0.385, clearance=0.25),
    _vehicle(
        "bus.city", (8.3, 2.35, 2.95), wheelbase=3.95, wheel=0.46, clearance=0.26, speed=7.0,
        paint=("#b5382f", "#2f6fa3", "#d8a531", "#e4e2da", "#3f7d55"),
    ),
    _vehicle(
        "bus.school", (7.6, 2.3, 2.85), wheelbase=3.9, wheel=0.43, clearance=0.28, speed=7.0,
        paint=("#e0a21c", "#e8b53a"),
    ),
    _vehicle(
        "truck.box", (7.2, 2.3, 3.1), wheelbase=4.1, wheel=0.45, clearance=0.3, speed=7.0,
        paint=("#e4e2da", "#2f5e8c", "#c0c4c6", "#8a2f2c", "#d8a531"),
        cargo=("#c9c8c2", "#d2d0c8", "#b9bdbf"), livery=("#2f5e8c", "#8a2f2c", "#2c5a44", "#2b2e33"),
    ),
    _vehicle(
        "truck.tanker", (7.6, 2.35, 3.0), wheelbase=4.2, wheel=0.46, clearance=0.3, speed=7.0, style=1,
        paint=("#8a2f2c", "#2f5e8c", "#c0c4c6", "#e4e2da"),
        cargo=("#b4b8bb", "#c6c6c0"), livery=("#a8322b", "#2f5e8c", "#d8a531"),
    ),
    _vehicle(
        "truck.tipper", (6.8, 2.35, 2.8), wheelbase=3.9, wheel=0.47, clearance=0.31, speed=7.0, style=2,
        paint=("#d8a531", "#b5382f", "#2f5e8c", "#37704f", "#e4e2da"),
        cargo=("#7d4a2c", "#4d5358", "#8b8a84"),
    ),
    _vehicle(
        "truck.small", (6.0, 2.12, 2.75), wheelbase=3.35, wheel=0.39, clearance=0.27, speed=7.5,
        paint=("#e4e2da", "#c0c4c6", "#37704f", "#b5382f"),
        cargo=("#c9c8c2", "#b9bdbf"), livery=("#b5382f", "#2f5e8c", "#37704f"),
    ),
)  # fmt: skip
_RIDDEN = (
    _twowheeler(
        "motorcycle.a", (2.12, 0.86, 1.66), wheelbase=1.40, wheel=0.31, rider=1.78, speed=9.0, hair=FULL,
        paint=("#a3232a", "#1f3f70", "#1f2124", "#d07a22", "#3d6b4a"),
    ),
    _twowheeler(
        "motorcycle.b", (2.18, 0.86, 1.60), wheelbase=1.46, wheel=0.32, rider=1.68, speed=8.5, hair=FULL,
        shoulder=0.94, girth=0.95, paint=("#1f2124", "#d9dadb", "#5e1f2c", "#6f8fa8"),
    ),
    _twowheeler(
        "scooter.a", (1.82, 0.78, 1.58), wheelbase=1.28, wheel=0.245, rider=1.74, speed=8.0, hair=FULL,
        paint=("#7fa9a0", "#e8e4da", "#a3232a", "#d8a531", "#6f8fa8"),
    ),
    _twowheeler(
        "scooter.b", (1.88, 0.78, 1.54), wheelbase=1.32, wheel=0.26, rider=1.66, speed=8.0, hair=FULL,
        shoulder=0.94, girth=0.95, paint=("#1f2124", "#d9dadb", "#1f3f70", "#8b9095"),
    ),
    _twowheeler(
        "bicycle.a", (1.76, 0.62, 1.84), wheelbase=1.06, wheel=0.345, rider=1.78, speed=4.6, hair=CYCLIST,
        bag=BACKPACK, paint=("#a3232a", "#1f3f70", "#2c4a3a", "#1f2124", "#d8a531"),
    ),
    _twowheeler(
        "bicycle.b", (1.74, 0.62, 1.72), wheelbase=1.04, wheel=0.345, rider=1.66, speed=4.0, hair=LONG, sleeves=0,
        shoulder=0.93, girth=0.94, paint=("#6f8fa8", "#e8e4da", "#b9702c", "#4d5a60"),
    ),
    _twowheeler(
        "bicycle.child", (1.42, 0.60, 1.45), wheelbase=0.86, wheel=0.255, rider=1.36, speed=3.2, hair=CYCLIST,
        sleeves=0, legs=0, shoulder=0.92, head=1.16, limb=0.97, paint=("#d8443c", "#2f7fc1", "#f0b429", "#7c5cbf"),
    ),
)  # fmt: skip

LIBRARY: tuple[Blueprint, ...] = tuple(sorted((*_PEOPLE, *_CARS, *_RIDDEN), key=lambda blueprint: blueprint.id))
"""All blueprints, sorted by id."""


def specimen(blueprint: Blueprint) -> tuple[ActorPlan, dict[str, str]]:
    """Return a stationary actor of a blueprint at the origin, and colours drawn by the blueprint's id."""
    actor = ActorPlan(
        name=blueprint.id,
        blueprint=blueprint.id,
        category=blueprint.category,
        tag=blueprint.tag,
        instance=1,
        shape=blueprint.shape,
        start=Pose(),
        route=(),
        speed=blueprint.default_speed,
        mesh=blueprint.mesh,
    )
    colours = {slot: Stream(0, "specimen", blueprint.id, slot).choice(c) for slot, c in blueprint.palette.items()}
    return actor, colours


def names() -> list[str]:
    """Return the values of `blueprint` in a recipe: a glob pattern for each family, then every id."""
    ids = [blueprint.id for blueprint in LIBRARY]
    return [*sorted({f"{name.rsplit('.', 1)[0]}.*" for name in ids}), *ids]


def parks(blueprint: Blueprint) -> bool:
    """Whether a vehicle has four wheels and fits into a parking bay."""
    return blueprint.attributes.get("number_of_wheels") == "4" and blueprint.shape["length"] <= 5.6


def match(glob: str, own: Sequence[Blueprint] = ()) -> tuple[Blueprint, ...]:
    """Return the blueprints whose id matches a case-sensitive glob such as `walker.pedestrian.*`, sorted by id.

    Args:
        glob: the pattern.
        own: the blueprints of the recipe, which are added to those of the library.
    """
    mine = [blueprint for blueprint in own if fnmatchcase(blueprint.id, glob)]
    found = _match(glob)
    return tuple(sorted((*found, *mine), key=lambda blueprint: blueprint.id)) if mine else found


@functools.lru_cache(maxsize=256)
def _match(glob: str) -> tuple[Blueprint, ...]:
    return tuple(blueprint for blueprint in LIBRARY if fnmatchcase(blueprint.id, glob))
