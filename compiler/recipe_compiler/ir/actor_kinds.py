"""Categories of actors and families of vehicles: the only table of their names, numbers and semantic tags."""

from __future__ import annotations

from typing import Literal, get_args

from recipe_compiler.ir.semantic_tags import Tag

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
}
"""Family of vehicles, the second part of a blueprint's id -> its semantic tag."""

BODIES: tuple[str, ...] = tuple(BODY_TAGS)
"""Families of vehicles. `shape["body"]` of a blueprint is an index into this tuple, so new ones are appended."""
