"""Ten recipes of different kinds, each built in seconds, which `benchmarks.estimates` builds to check estimates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from recipe_compiler.ir.modalities import MODALITIES

_WALKERS: dict[str, Any] = {
    "hero1": {"blueprint": "walker.pedestrian.*", "speed": 1.4, "start": {"x": -4, "y": -10, "yaw": 90}},
    "hero2": {"blueprint": "walker.pedestrian.*", "speed": 2.0, "start": {"x": -4, "y": 10, "yaw": -90}},
}
_ALL = list(MODALITIES)


def _sensor(width: int, height: int, capture: Sequence[str], **camera: float) -> dict[str, Any]:
    view = {"width": width, "height": height, "fov": 90, **camera}
    return {"mount": {"x": -8, "y": 0, "z": 1.6, "yaw": 0}, "camera": view, "capture": list(capture)}


def _driving(width: int, height: int, capture: Sequence[str], **camera: float) -> dict[str, Any]:
    return _sensor(width, height, capture, **camera) | {"mount": {"on": "ego", "x": 0.6, "z": 1.5}}


def _recipe(name: str, frames: int, sensor: dict[str, Any], fps: int = 30, **base: Any) -> dict[str, Any]:
    whole = {
        "clock": {"fps": fps, "frames": frames},
        "town": "downtown",
        "actors": _WALKERS,
        "sensors": {"street": sensor},
    }
    return {"recipe": name, "seed": 30, "base": {**whole, **base}}


_EGO = {"ego": {"blueprint": "vehicle.sedan.a"}}
_SEEDS = {"draw": {"count": 4, "values": {"town.seed": {"integer": [1, 10**6]}}}}
_WEATHERS = {name: {"weather": name} for name in ("ClearNoon", "HardRainNoon", "ClearSunset", "CloudyNoon")}

RECIPES: dict[str, dict[str, Any]] = {
    "still camera": _recipe("still", 40, _sensor(800, 600, ["rgb", "depth", "instance"])),
    "driving camera": _recipe(
        "driving", 16, _driving(800, 600, _ALL), actors=_EGO, traffic={"vehicles": 11, "pedestrians": 20}
    ),
    "four towns": _recipe("towns", 6, _sensor(400, 300, _ALL)) | {"sweep": _SEEDS},
    "lens": _recipe("lens", 16, _driving(400, 300, ["rgb", "depth"], lens_k=0.2), actors=_EGO),
    "blur and bloom": _recipe(
        "blur",
        20,
        _driving(640, 480, ["rgb"], motion_blur_intensity=1.0, bloom_intensity=0.7),
        actors=_EGO,
        traffic={"vehicles": 6},
    ),
    "supersampled": _recipe("fine", 16, _driving(400, 300, ["rgb", "instance"], supersample=2), actors=_EGO),
    "small pictures": _recipe("small", 600, _sensor(64, 48, ["rgb", "depth", "instance"])),
    "long simulation": _recipe(
        "simulated", 40, _sensor(160, 120, ["rgb"]), fps=2, traffic={"vehicles": 10, "pedestrians": 20}
    ),
    "four weathers": _recipe("weathers", 16, _sensor(640, 480, _ALL)) | {"deltas": {"weather": _WEATHERS}},
    "labels of a crowd": _recipe(
        "crowd", 40, _sensor(640, 480, ["depth", "instance", "semantic"]), traffic={"pedestrians": 60, "parked": 20}
    ),
}
"""The recipes, by the feature that distinguishes each."""
