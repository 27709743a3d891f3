"""Seasons: the colours of leaves, flowers and grass. They change no geometry, so all seasons have the same labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, get_args

from recipe_compiler.ir.plan import Element
from recipe_compiler.ir.streams import Stream

Season = Literal["spring", "summer", "autumn", "winter"]
NAMES: tuple[str, ...] = get_args(Season)

_EVERGREEN = frozenset({1, 4})  # species of trees
_COLOURS: dict[str, dict[str, tuple[str, ...]]] = {
    "spring": {
        "leaves": ("#6f8446", "#78904e", "#82934f", "#6a7f48", "#74884a", "#b59a9c"),
        "flowers": ("#c9b03f", "#b98ab0", "#d8d2c8", "#c4605a"),
        "grass": ("#66764f", "#6a7951"),
    },
    "autumn": {
        "leaves": ("#927236", "#9c6432", "#7f472f", "#a08840", "#6f6a40", "#8a5a34"),
        "flowers": ("#a0562f", "#8a4a5c", "#a8843c"),
        "grass": ("#706f4e", "#747052"),
    },
    "winter": {
        "leaves": ("#665c50", "#70655a", "#5c544b", "#746a58"),
        "flowers": ("#5d6048",),
        "grass": ("#767462", "#7a7765"),
    },
}
_GRASS = ("yard", "verge", "ground")


def in_season(
    looks: Mapping[str, dict[str, str]], elements: Sequence[Element], season: Season
) -> dict[str, dict[str, str]]:
    """Return the looks of all bodies in a season; those of a town's looks are of summer.

    Evergreen trees and hedges keep their colours.

    Args:
        looks: by body, slot -> "#rrggbb".
        elements: those of the town.
        season: the season; each plant draws its colour by its name.
    """
    found = dict(looks)
    if season == "summer":
        return found
    colours = _COLOURS[season]
    for element in elements:
        evergreen = element.kind == "hedge" or element.shape.get("species") in _EVERGREEN
        own = {}
        for slot in found.get(element.name, {}):
            kind = "grass" if slot in _GRASS else slot
            if kind in colours and not (evergreen and kind == "leaves"):
                # (All lawns of a town have one colour, or they would end at invisible lines.)
                key = "grass" if kind == "grass" else element.name
                own[slot] = Stream(0, "season", season, key, kind).choice(colours[kind])
        if own:
            found[element.name] = {**found[element.name], **own}
    return found
