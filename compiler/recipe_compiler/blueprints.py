"""The library of actors: pedestrians and vehicles, as numbers and palettes."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

PEDESTRIAN, CAR, TRUCK, BUS = 12, 14, 15, 16  # CARLA 0.9.14+ semantic tags


@dataclass(frozen=True)
class Blueprint:
    """What an actor may be. `shape` is for its mesh and joints; `palette` holds the colours each slot may have."""

    id: str
    category: Literal["pedestrian", "vehicle"]
    tag: int
    shape: dict[str, float]
    palette: dict[str, tuple[str, ...]]
    default_speed: float  # m/s


_SKIN = ("#f1c7a5", "#e0ac86", "#c98f67", "#a86f4b", "#7d4f35", "#5a3826")
_HAIR = ("#1e1814", "#2e221b", "#4a3222", "#6d4a2e", "#a57c4a", "#8e8a86", "#5b2f1d")
_SHIRTS = (
    "#b43a35", "#2f5e8c", "#e3ded3", "#37704f", "#d9a63a", "#3b3f4a", "#7a4c7e", "#c96f3c",
    "#5f8fa8", "#8c8f94", "#d7c3a1", "#22334d",
)  # fmt: skip
_TROUSERS = ("#2c3446", "#3b3b40", "#5a5346", "#24262b", "#6f6a5e", "#41536e", "#4a3d34")
_SHOES = ("#1d1b1a", "#4b3524", "#d8d6d0", "#6a3b2a", "#2b3442")

_PAINT = (
    "#d9dadb", "#1f2124", "#8b9095", "#a3232a", "#1f3f70", "#4d5a60", "#e8e4da", "#2c4a3a",
    "#b9702c", "#5e1f2c", "#6f8fa8",
)  # fmt: skip


def _walker(
    number: int,
    height: float,
    *,
    shoulder: float,
    girth: float,
    hair: int,
    sleeves: int = 1,
    legs: int = 1,
    coat: float = 0.0,
    head: float = 1.0,
    speed: float = 1.4,
) -> Blueprint:
    """A pedestrian. `shoulder` and `girth` scale an average build of that height; `coat` lowers the hem, in metres.

    hair: 0 cropped, 1 short, 2 to the shoulders, 3 tied up, 4 a cap. sleeves: 0 short, 1 long. legs: 0 shorts,
    1 trousers, 2 a skirt.
    """
    shape = {
        "height": height,
        "shoulder": shoulder,
        "girth": girth,
        "hair": hair,
        "sleeves": sleeves,
        "legs": legs,
        "coat": coat,
        "head": head,
    }
    palette = {"skin": _SKIN, "hair": _HAIR, "shirt": _SHIRTS, "trousers": _TROUSERS, "shoes": _SHOES}
    return Blueprint(
        f"walker.pedestrian.{number:04d}",
        "pedestrian",
        PEDESTRIAN,
        {k: float(v) for k, v in shape.items()},
        palette,
        speed,
    )


_BODIES = ("sedan", "hatchback", "suv", "van", "pickup", "bus", "truck")  # index: the mesh's `body`


def _vehicle(
    name: str,
    body: str,
    size: tuple[float, float, float],
    *,
    wheelbase: float,
    wheel: float,
    clearance: float,
    tag: int = CAR,
    speed: float = 9.0,
    paint: tuple[str, ...] = _PAINT,
) -> Blueprint:
    """A vehicle of that length, width and height; `wheel` is a radius."""
    shape = {
        "body": float(_BODIES.index(body)),
        "length": size[0],
        "width": size[1],
        "height": size[2],
        "wheelbase": wheelbase,
        "wheel": wheel,
        "clearance": clearance,
    }
    palette = {
        "paint": paint,
        "glass": ("#1c2328", "#20282c"),
        "trim": ("#17181a", "#232427"),
        "rubber": ("#1a1a1b",),
        "rim": ("#9a9da1", "#75787c", "#b9bcc0"),
        "headlight": ("#f4f2ea",),
        "taillight": ("#8e1418",),
        "plate": ("#e9e7df",),
    }
    return Blueprint(f"vehicle.{name}", "vehicle", tag, shape, palette, speed)


LIBRARY: tuple[Blueprint, ...] = tuple(
    sorted(
        (
            _walker(1, 1.78, shoulder=1.0, girth=1.0, hair=1),
            _walker(2, 1.66, shoulder=0.92, girth=0.92, hair=2),
            _walker(3, 1.84, shoulder=1.06, girth=1.04, hair=0, sleeves=0),
            _walker(4, 1.71, shoulder=0.93, girth=0.95, hair=3, coat=0.22),
            _walker(5, 1.75, shoulder=1.05, girth=1.2, hair=1, coat=0.06),
            _walker(6, 1.62, shoulder=0.95, girth=1.12, hair=2, legs=2),
            _walker(7, 1.80, shoulder=1.02, girth=0.94, hair=4, legs=0, sleeves=0),
            _walker(8, 1.69, shoulder=0.92, girth=0.88, hair=3, sleeves=0),
            _walker(9, 1.88, shoulder=1.04, girth=1.0, hair=1, coat=0.3),
            _walker(10, 1.58, shoulder=0.93, girth=1.0, hair=2, coat=0.1),
            _walker(11, 1.28, shoulder=0.92, girth=0.95, hair=1, sleeves=0, legs=0, head=1.18, speed=1.2),
            _walker(12, 1.40, shoulder=0.9, girth=0.9, hair=3, legs=2, head=1.14, speed=1.3),
            _vehicle("sedan.a", "sedan", (4.68, 1.82, 1.45), wheelbase=2.75, wheel=0.325, clearance=0.17),
            _vehicle("sedan.b", "sedan", (4.92, 1.87, 1.47), wheelbase=2.92, wheel=0.34, clearance=0.16),
            _vehicle("hatchback.a", "hatchback", (4.08, 1.76, 1.49), wheelbase=2.55, wheel=0.315, clearance=0.17),
            _vehicle("hatchback.b", "hatchback", (3.62, 1.66, 1.52), wheelbase=2.36, wheel=0.295, clearance=0.16),
            _vehicle("suv.a", "suv", (4.62, 1.88, 1.68), wheelbase=2.70, wheel=0.365, clearance=0.22),
            _vehicle("van.a", "van", (5.15, 1.98, 2.05), wheelbase=3.10, wheel=0.34, clearance=0.2, speed=8.0),
            _vehicle("pickup.a", "pickup", (5.25, 1.92, 1.80), wheelbase=3.22, wheel=0.385, clearance=0.25),
            _vehicle(
                "bus.city", "bus", (10.8, 2.5, 3.05), wheelbase=5.6, wheel=0.48, clearance=0.26, tag=BUS, speed=7.0,
                paint=("#b5382f", "#2f6fa3", "#d8a531", "#e4e2da", "#3f7d55"),
            ),
            _vehicle(
                "truck.box", "truck", (7.2, 2.3, 3.1), wheelbase=4.1, wheel=0.45, clearance=0.3, tag=TRUCK, speed=7.0,
                paint=("#e4e2da", "#2f5e8c", "#c0c4c6", "#8a2f2c", "#d8a531"),
            ),
        ),
        key=lambda blueprint: blueprint.id,
    )
)  # fmt: skip
"""All blueprints, sorted by id."""


@functools.lru_cache(maxsize=256)
def match(glob: str) -> tuple[Blueprint, ...]:
    """The blueprints whose id matches a case-sensitive glob such as `walker.pedestrian.*`, sorted by id."""
    return tuple(blueprint for blueprint in LIBRARY if fnmatchcase(blueprint.id, glob))
