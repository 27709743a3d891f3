"""CARLA's towns and the most similar ones of the library."""

from __future__ import annotations

import re

_CLOSEST = {
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
"""The town that CARLA's server loads by default; also OSCAR's default."""

NAMES = ("Town01 to Town07", "Town10HD", "Town11", "Town12", "Town13", "Town15")


def closest_match(town: str) -> tuple[str, str] | None:
    """Return the most similar town of the library and a description of CARLA's town; None if that is unknown.

    Args:
        town: the name of CARLA's town, with or without the path and the suffix `_Opt`.
    """
    name = re.sub(r"_opt\Z", "", town.strip().rsplit("/", 1)[-1].lower())
    return _CLOSEST.get(name)
