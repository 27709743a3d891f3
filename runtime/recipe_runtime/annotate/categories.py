"""The annotated classes: CARLA's tags, COCO's category ids and MOTS's class numbers."""

from __future__ import annotations

# CARLA 0.9.14+ tag -> name. Category ids count from 1 in this order in every dataset, whatever it shows.
CATEGORIES: dict[int, str] = {
    12: "Pedestrian",
    13: "Rider",
    14: "Car",
    15: "Truck",
    16: "Bus",
    17: "Train",
    18: "Motorcycle",
    19: "Bicycle",
}
CATEGORY_IDS: dict[int, int] = {tag: number for number, tag in enumerate(CATEGORIES, start=1)}

MOTS_CLASSES: dict[int, int] = {12: 2, 14: 1}  # pedestrian, car; every other actor is in the ignore region
MOTS_IGNORE = 10


def category_rows() -> list[dict[str, object]]:
    """Return the rows of COCO's `categories` table, each with its CARLA tag."""
    vehicles = {tag for tag in CATEGORIES if tag > 13}
    return [
        {"id": CATEGORY_IDS[tag], "name": name, "supercategory": "vehicle" if tag in vehicles else "person", "tag": tag}
        for tag, name in CATEGORIES.items()
    ]
