"""CARLA's towns and those of the library that are most like them."""

from __future__ import annotations

import re

_LIKE = {
    "town01": ("suburb", "a small town with T-junctions"),
    "town02": ("suburb", "a small residential town"),
    "town03": ("downtown", "a large town with a roundabout and a tunnel"),
    "town04": ("highway", "a ring motorway around a small town"),
    "town05": ("downtown", "a grid of wide streets"),
    "town06": ("highway", "long motorways with many junctions"),
    "town07": ("suburb", "a rural community"),
    "town10": ("downtown", "a city centre"),
    "town10hd": ("downtown", "a city centre"),
    "town11": ("suburb", "a large map without buildings"),
    "town12": ("downtown", "a large map with a city and its surroundings"),
    "town13": ("downtown", "a large map with a city and its surroundings"),
    "town15": ("plaza", "a university campus"),
}

DEFAULT = "Town10HD"
"""The town that CARLA's server loads by itself, and OSCAR's."""

NAMES = ("Town01 to Town07", "Town10HD", "Town11", "Town12", "Town13", "Town15")


def most_like(town: str) -> tuple[str, str] | None:
    """The town of the library that is most like one of CARLA's, and a description of CARLA's; None if it is unknown.

    Args:
        town: its name, with or without the path and the ending `_Opt`.
    """
    name = re.sub(r"_opt\Z", "", town.strip().rsplit("/", 1)[-1].lower())
    return _LIKE.get(name)
