"""Colours: from sRGB text to linear albedo, by exact arithmetic."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact

from recipe_runtime.meshes.mesh import Pattern
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.geometry import Geometry, SurfaceKey
from recipe_runtime.render.texture.images import SurfaceColours

# Default colours of slots that a look does not set.
_FALLBACK = {
    Pattern.ASPHALT: "#48484a", Pattern.LANES: "#48484a", Pattern.SLABS: "#9a958c",
    Pattern.SETTS: "#8c8983",
    Pattern.PLATES: "#9a958c", Pattern.KERB: "#a09d96", Pattern.PANELS: "#8f8d88",
    Pattern.CONCRETE: "#8f8d88", Pattern.BRICK: "#8a4f3c",
    Pattern.PLASTER: "#c9bfae", Pattern.ROOF: "#6a4a40", Pattern.GRASS: "#5a7438", Pattern.FOLIAGE: "#4c6b2c",
    Pattern.BARK: "#5a4634", Pattern.METAL: "#50565a", Pattern.SKIN: "#c49074", Pattern.CLOTH: "#5a6070",
    Pattern.RUBBER: "#1c1c1e", Pattern.ROAD_PAINT: "#e4e4de", Pattern.CAR_PAINT: "#8c9298", Pattern.GLASS: "#20262a",
    Pattern.WINDOW: "#d8d6d0", Pattern.LAMP: "#ffdca8", Pattern.HEADLIGHT: "#fff4e0", Pattern.TAILLIGHT: "#c01818",
    Pattern.BRAKELIGHT: "#a01018", Pattern.INDICATOR: "#d07818", Pattern.REVERSELIGHT: "#c9ccce",
    Pattern.CABIN: "#20262a", Pattern.NUMBER_PLATE: "#d9d7cf", Pattern.LENS: "#a9b3ba",
    Pattern.STRIPES: "#5a6070", Pattern.CHECKS: "#5a6070", Pattern.PRINT: "#5a6070", Pattern.DENIM: "#2b3d5c",
    Pattern.VEST: "#d8e23a", Pattern.HAIR: "#3a2a1e", Pattern.PLAIN: "#909090", Pattern.CLAPBOARD: "#c4c0b6",
    Pattern.STONE: "#a8a196",
    Pattern.WOOD: "#7a5a3e", Pattern.WATER: "#4a6468", Pattern.NICHE: "#b0aaa0", Pattern.CURTAIN_WALL: "#56646c",
    Pattern.SHOP_WINDOW: "#8c8270", Pattern.POSTER: "#3f6d8c", Pattern.BIRCH_BARK: "#c9c4b8",
    Pattern.IMAGE: "#909090", Pattern.LETTER: "#2b4a6b", Pattern.FACADE: "#4b5660", Pattern.SIGNAL: "#ff3b2a",
}  # fmt: skip
_PANES = (Pattern.WINDOW, Pattern.CURTAIN_WALL, Pattern.SHOP_WINDOW)
_AROUND = {
    **dict.fromkeys(_PANES, "frame"),
    Pattern.FACADE: "wall",
    Pattern.CABIN: "seats",
}  # the slot that gives their second colour
_SHOPS_LIT, _ROOMS_LIT = 0.8, 0.42  # shares of the windows that are lit at night
_PAVING = (Pattern.SLABS, Pattern.SETTS, Pattern.PLATES, Pattern.KERB)
_JOINTED = (*_PAVING, Pattern.ROOF, Pattern.STONE, Pattern.CLAPBOARD, Pattern.WOOD)  # their joints are dark


def surface_colours(
    geometry: Geometry, looks: dict[str, dict[str, str]], album: DeviceArray, device: str
) -> SurfaceColours:
    """Return every surface's colours in one appearance; `album` is a one-element array of its `ImageAtlas`."""
    firsts, seconds = [], []
    for key in geometry.surfaces:
        first = linear_colour(looks.get(key.body, {}).get(key.slot) or _FALLBACK[key.pattern])
        firsts.append(first)
        around = looks.get(key.body, {}).get(_AROUND.get(key.pattern, ""))
        seconds.append(linear_colour(around) if around else _second(key, first))
    out = SurfaceColours()
    out.first = wp.array(np.array(firsts, np.float32), dtype=wp.vec3f, device=device)
    out.second = wp.array(np.array(seconds, np.float32), dtype=wp.vec3f, device=device)
    out.pattern, out.album = geometry.surface_pattern, album
    awake = np.array([_SHOPS_LIT if key.slot == "shop" else _ROOMS_LIT for key in geometry.surfaces], np.float32)
    out.awake = wp.array(awake, dtype=wp.float32, device=device)
    return out


def linear_colour(text: str) -> NDArray[np.float64]:
    """Convert `#rrggbb` to linear RGB."""
    return np.array([srgb_to_linear(int(text[i : i + 2], 16)) for i in (1, 3, 5)])


def _second(key: SurfaceKey, first: Any) -> Any:
    """Return the second colour of a pattern: mortar, joints, sunlit leaves, the road under worn paint, or a frame."""
    if key.pattern in (Pattern.BRICK,):
        return 0.35 * first + 0.65 * np.array([0.36, 0.34, 0.31])
    if key.pattern in _JOINTED:
        return 0.35 * first
    if key.pattern in (Pattern.STRIPES, Pattern.CHECKS, Pattern.PRINT):
        return 0.22 * first if float(first[1]) > 0.2 else 0.25 * first + np.array([0.5, 0.49, 0.46])
    if key.pattern == Pattern.DENIM:
        return 1.7 * first + 0.03
    if key.pattern == Pattern.VEST:
        return np.array([0.72, 0.74, 0.74])
    if key.pattern == Pattern.POSTER:
        return np.array([0.72, 0.69, 0.62])
    if key.pattern == Pattern.NUMBER_PLATE:
        return np.array([0.02, 0.02, 0.025])
    if key.pattern == Pattern.CAR_PAINT:
        return 0.3 * first + np.array([0.10, 0.09, 0.075])
    if key.pattern == Pattern.CABIN:
        return np.array([0.05, 0.048, 0.045])
    if key.pattern == Pattern.LETTER:
        return np.array([0.03, 0.03, 0.03]) if float(first[1]) > 0.25 else np.array([0.75, 0.71, 0.6])
    if key.pattern == Pattern.FOLIAGE:
        return first * np.array([1.35, 1.35, 0.8])
    if key.pattern == Pattern.GRASS:
        return first * np.array([1.6, 1.35, 0.85])
    if key.pattern == Pattern.ROAD_PAINT:
        return np.array([0.07, 0.07, 0.072])
    if key.pattern in _PANES:
        return np.array([0.55, 0.53, 0.5])
    return first


@cache
def srgb_to_linear(value: int) -> float:
    """Convert an 8-bit sRGB value to linear light, 0 to 1."""
    v = value / 255.0
    return v / 12.92 if v <= 0.04045 else exact.power((v + 0.055) / 1.055, 2.4)
