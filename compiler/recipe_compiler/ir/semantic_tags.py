"""CARLA's semantic tags (version 0.9.14 and later), the categories of actors and the families of vehicles.

This is the only table of their numbers and names.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Literal, get_args


class Tag(IntEnum):
    """Class of a surface, numbered as in `carla.CityObjectLabel`."""

    UNLABELED = 0
    ROADS = 1
    SIDEWALKS = 2
    BUILDINGS = 3
    WALLS = 4
    FENCES = 5
    POLES = 6
    TRAFFIC_LIGHT = 7
    TRAFFIC_SIGNS = 8
    VEGETATION = 9
    TERRAIN = 10
    SKY = 11
    PEDESTRIAN = 12
    RIDER = 13
    CAR = 14
    TRUCK = 15
    BUS = 16
    TRAIN = 17
    MOTORCYCLE = 18
    BICYCLE = 19
    STATIC = 20
    DYNAMIC = 21
    OTHER = 22
    WATER = 23
    ROAD_LINES = 24
    GROUND = 25
    BRIDGE = 26
    RAIL_TRACK = 27
    GUARD_RAIL = 28

    @property
    def label(self) -> str:
        """CARLA's name of the tag, such as `TrafficLight`."""
        return "".join(word.capitalize() for word in self.name.split("_"))


TAG_OF_LABEL: dict[str, Tag] = {tag.label: tag for tag in Tag}
"""CARLA's name -> tag."""

PropLabel = Literal[
    "Buildings", "Walls", "Fences", "Poles", "TrafficLight", "TrafficSigns", "Vegetation", "Static", "Dynamic", "Other",
    "Bridge", "GuardRail",
]  # fmt: skip
"""Names of the tags that a prop may have."""

Category = Literal["pedestrian", "vehicle"]

CATEGORIES: tuple[Category, ...] = get_args(Category)
"""The categories of actors."""

BODY_TAGS: dict[str, Tag] = {
    "sedan": Tag.CAR,
    "hatchback": Tag.CAR,
    "suv": Tag.CAR,
    "van": Tag.CAR,
    "pickup": Tag.CAR,
    "bus": Tag.BUS,
    "truck": Tag.TRUCK,
    "motorcycle": Tag.MOTORCYCLE,
    "bicycle": Tag.BICYCLE,
    "scooter": Tag.MOTORCYCLE,
}
"""Family of vehicles, the second part of a blueprint's id -> its semantic tag."""

BODIES: tuple[str, ...] = tuple(BODY_TAGS)
"""Families of vehicles. `shape["body"]` of a blueprint is an index into this tuple, so new ones are appended."""
