"""The lamps that burn and the bodies that stand near the ground, gathered on the host for a frame."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device import wp
from recipe_runtime.render.geometry import Geometry
from recipe_runtime.render.nearby import Bodies, Lamps
from recipe_runtime.transforms import Array

_CANDELA = 1.0 / 11000.0  # light on a white surface a metre away, in the scale of `air`, of one candela
_SPILL = 1400.0  # candela above which a lamp's light near by grows by the square root only
_MOST_LAMPS = 256
_LOWEST = 0.4  # metres above its actor's foot at which a part no longer darkens the ground
_UNDER = 0.72  # share of the sky's light that a wide body flat on the ground keeps from it


def lamps_at(geometry: Geometry, world_from_parts: Array, eye: Array, device: str) -> Any:
    """The lamps nearest to the eye, in the geometry's order."""
    rows = [_lamp(mounted, world_from_parts[mounted.part]) for mounted in geometry.lights]
    if len(rows) > _MOST_LAMPS:
        gaps = [float(sum((p - e) * (p - e) for p, e in zip(row[:3], eye, strict=True))) for row in rows]
        kept = sorted(sorted(range(len(rows)), key=lambda i: (gaps[i], i))[:_MOST_LAMPS])
        rows = [rows[i] for i in kept]
    table = np.array(rows, np.float64).reshape(-1, 12) if rows else np.zeros((1, 12))
    lamps = Lamps()
    lamps.position = _upload(table[:, 0:3], wp.vec3f, device)
    lamps.direction = _upload(table[:, 3:6], wp.vec3f, device)
    lamps.power = _upload(table[:, 6:9], wp.vec3f, device)
    lamps.cone = _upload(table[:, 9:11], wp.vec2f, device)
    lamps.reach = _upload(table[:, 11], wp.float32, device)
    crowded = len(geometry.lights) > _MOST_LAMPS  # then which lamps are here may change from frame to frame
    moves = [int(crowded or mounted.part != 0) for mounted in geometry.lights[:_MOST_LAMPS]] or [1]
    lamps.moves = wp.array(np.array(moves, np.int32), dtype=wp.int32, device=device)
    lamps.count = len(rows)
    return lamps


def no_lamps(device: str) -> Any:
    """What burns by day."""
    lamps = Lamps()
    lamps.position, lamps.direction, lamps.power = (_upload(np.zeros((1, 3)), wp.vec3f, device) for _ in range(3))
    lamps.cone, lamps.reach = _upload(np.zeros((1, 2)), wp.vec2f, device), _upload(np.zeros(1), wp.float32, device)
    lamps.moves, lamps.count = wp.zeros(1, dtype=wp.int32, device=device), 0
    return lamps


def bodies_at(geometry: Geometry, parts: Array, device: str) -> Any:
    """The moving parts that come within half a metre of their actor's foot."""
    table = np.zeros((1, 9))
    if geometry.actors:
        boxes = _footprints(parts, geometry.part_bounds)
        foot = np.minimum.reduceat(boxes[:, 2], [actor.first_part for actor in geometry.actors])
        foot = np.repeat(foot, [actor.parts for actor in geometry.actors])
        height = boxes[:, 2] - foot
        # What a disc of the part's breadth hides of the sky, seen from the ground below its middle.
        lift = height / (np.minimum(boxes[:, 5], boxes[:, 6]) + 0.04)
        strength = _UNDER / (1.0 + lift * lift)
        table = np.column_stack([boxes[:, :2], foot, boxes[:, 3:7], height, strength])[height < _LOWEST]
    bodies = Bodies()
    bodies.centre = _upload(table[:, 0:3], wp.vec3f, device)
    bodies.axis = _upload(table[:, 3:5], wp.vec2f, device)
    bodies.half = _upload(table[:, 5:7], wp.vec2f, device)
    bodies.spread = _upload(0.05 + 0.35 * np.minimum(table[:, 5], table[:, 6]) + 0.4 * table[:, 7], wp.float32, device)
    bodies.strength = _upload(table[:, 8], wp.float32, device)
    bodies.count = len(table) if geometry.actors else 0
    return bodies


def _lamp(mounted: Any, world: Array) -> list[float]:
    light = mounted.light
    position, direction = light.position, light.direction
    at = [sum(float(world[r, c]) * position[c] for c in range(3)) + float(world[r, 3]) for r in range(3)]
    to = [sum(float(world[r, c]) * direction[c] for c in range(3)) for r in range(3)]
    # What falls near a strong lamp is the spill of a beam that is aimed far ahead.
    spill = min(1.0, float(np.sqrt(_SPILL / light.intensity)))
    power = [light.intensity * spill * _CANDELA * c for c in light.colour]
    full = light.cone + (1.0 - light.cone) * 0.75
    return [*at, *to, *power, light.cone, full, 3.0 + 0.6 * float(np.sqrt(light.intensity))]


def _footprints(world: Array, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of every part: centre x, y, lowest z, level axis and half sizes of its box. [P, 7]"""
    centre, half = (boxes[:, 0] + boxes[:, 1]) / 2.0, (boxes[:, 1] - boxes[:, 0]) / 2.0
    m = world[:, :, :3]
    at = m[:, :, 0] * centre[:, None, 0] + m[:, :, 1] * centre[:, None, 1] + m[:, :, 2] * centre[:, None, 2]
    at = at + world[:, :, 3]
    reach = np.abs(m[:, :, 0]) * half[:, None, 0] + np.abs(m[:, :, 1]) * half[:, None, 1]
    reach = reach + np.abs(m[:, :, 2]) * half[:, None, 2]
    # The first axis that lies level enough gives the direction; a limb's box is nearly round anyway.
    size = np.sqrt(m[:, 0, 0] * m[:, 0, 0] + m[:, 1, 0] * m[:, 1, 0])
    level = size > 0.3
    x = np.where(level, m[:, 0, 0] / np.maximum(size, 0.3), 1.0)
    y = np.where(level, m[:, 1, 0] / np.maximum(size, 0.3), 0.0)
    h0 = np.where(level, _extents(m, half, x, y), reach[:, 0])
    h1 = np.where(level, _extents(m, half, -y, x), reach[:, 1])
    return np.column_stack([at[:, :2], at[:, 2] - reach[:, 2], x, y, h0, h1])


def _extents(
    m: Array, half: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Half the breadth of every part's box along a level direction."""
    along = [np.abs(m[:, 0, c] * x + m[:, 1, c] * y) * half[:, c] for c in range(3)]
    total: NDArray[np.float64] = along[0] + along[1] + along[2]
    return total


def _upload(values: NDArray[np.float64], kind: Any, device: str) -> Any:
    return wp.array(np.ascontiguousarray(values).astype(np.float32), dtype=kind, device=device)
