"""The annotated classes: CARLA's tags, COCO's category ids and MOTS's class numbers."""

from __future__ import annotations

from recipe_compiler.ir.semantic_tags import Tag

_PERSONS = (Tag.PEDESTRIAN, Tag.RIDER)
_VEHICLES = (Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.TRAIN, Tag.MOTORCYCLE, Tag.BICYCLE)

# CARLA's tag -> name. Category ids count from 1 in this order in every dataset, whichever classes it contains.
CATEGORIES: dict[int, str] = {tag.value: tag.label for tag in (*_PERSONS, *_VEHICLES)}
CATEGORY_IDS: dict[int, int] = {tag: number for number, tag in enumerate(CATEGORIES, start=1)}

MOTS_CLASSES: dict[int, int] = {Tag.PEDESTRIAN.value: 2, Tag.CAR.value: 1}  # all other actors: ignore region
MOTS_IGNORE = 10


def category_rows() -> list[dict[str, object]]:
    """Return the rows of COCO's `categories` table, each with its CARLA tag."""
    return [
        {
            "id": CATEGORY_IDS[tag],
            "name": name,
            "supercategory": "vehicle" if tag in _VEHICLES else "person",
            "tag": tag,
        }
        for tag, name in CATEGORIES.items()
    ]
