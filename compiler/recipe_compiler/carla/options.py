"""What the user of an import chooses: values that a configuration leaves to CARLA's server or to other programs."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.carla.catalogue import blueprints
from recipe_compiler.carla.forms.collector import kind_of
from recipe_compiler.carla.forms.specs import Kind
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.library.towns import NAMES
from recipe_compiler.schema.fields import MAX_FRAMES, TRAFFIC_LIMIT

DEFAULT_HERO = "vehicle.lincoln.mkz_2017"
"""The vehicle that ScenarioRunner gives to the role `hero` (srunner/scenarios/route_scenario.py)."""


@dataclass(frozen=True)
class Options:
    """Values that are chosen for an import.

    Args:
        town: the town of the library; None: the one most similar to the configuration's.
        frames: the number of frames, instead of the configuration's; None: the configuration's.
        hero: CARLA's blueprint or glob of each actor to which a sensor is attached and which another program spawns;
            None: a car for the role `hero`, an error for other roles.
        vehicles: vehicles in traffic, in addition to the configuration's.
        pedestrians: pedestrians in traffic, in addition to the configuration's.

    Raises:
        InputError: the library has no such town, CARLA has no such blueprint, or a number is out of range.
    """

    town: str | None = None
    frames: int | None = None
    hero: str | None = None
    vehicles: int = 0
    pedestrians: int = 0

    def __post_init__(self) -> None:
        if self.town is not None and self.town not in NAMES:
            remedy = f"write one of {', '.join(NAMES)}"
            raise InputError(f"there is no town {self.town[:100]!r}", help=remedy, code=Code.UNKNOWN_NAME)
        if self.hero is not None and _kind(self.hero) is None:
            message = f"CARLA has no vehicle or walker {self.hero[:100]!r}"
            remedy = f"write a blueprint of its catalogue, such as {DEFAULT_HERO}, or vehicle.*"
            raise InputError(message, help=remedy, code=Code.UNKNOWN_NAME)
        limits = {"frames": (self.frames, 1, MAX_FRAMES)}
        limits |= {"vehicles": (self.vehicles, 0, TRAFFIC_LIMIT), "pedestrians": (self.pedestrians, 0, TRAFFIC_LIMIT)}
        for name, (number, low, high) in limits.items():
            if number is not None and not low <= number <= high:
                remedy = f"write a number from {low} to {high}"
                raise InputError(f"{number} {name} are out of range", help=remedy, code=Code.OUT_OF_RANGE)

    def hero_for(self, role: str) -> tuple[str, Kind] | None:
        """Return CARLA's blueprint, and its kind, of the actor that another program spawns for a role; None: unknown.

        Args:
            role: the role name to which a sensor is attached, and which no entry of the configuration has.
        """
        blueprint = self.hero or (DEFAULT_HERO if role == "hero" else "")
        kind = _kind(blueprint)
        return None if kind is None else (blueprint, kind)


def _kind(blueprint: str) -> Kind | None:
    """Return the kind of an actor's blueprint or glob; None if CARLA has no such walker or vehicle."""
    kind = kind_of(blueprint)
    if kind not in ("walker", "vehicle") or blueprints.closest_match(blueprint, kind, 0, "hero") is None:
        return None
    return kind
