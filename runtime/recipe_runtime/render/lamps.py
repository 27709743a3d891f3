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


def bodies_at(geometry: Geometry, parts: Array, device: str) -> Any:
    """The moving parts that come within half a metre of their actor's foot."""
    rows: list[list[float]] = []
    for actor in geometry.actors:
        span = range(actor.first_part, actor.first_part + actor.parts)
        boxes = [_footprint(parts[p], geometry.part_bounds[p]) for p in span]
        foot = min(box[2] for box in boxes)
        for box in boxes:
            height = box[2] - foot
            if height < _LOWEST:
                # What a disc of the part's breadth hides of the sky, seen from the ground below its middle.
                lift = height / (min(box[5], box[6]) + 0.04)
                rows.append([box[0], box[1], foot, *box[3:7], height, _UNDER / (1.0 + lift * lift)])
    table = np.array(rows, np.float64).reshape(-1, 9) if rows else np.zeros((1, 9))
    bodies = Bodies()
    bodies.centre = _upload(table[:, 0:3], wp.vec3f, device)
    bodies.axis = _upload(table[:, 3:5], wp.vec2f, device)
    bodies.half = _upload(table[:, 5:7], wp.vec2f, device)
    bodies.spread = _upload(0.05 + 0.35 * np.minimum(table[:, 5], table[:, 6]) + 0.4 * table[:, 7], wp.float32, device)
    bodies.strength = _upload(table[:, 8], wp.float32, device)
    bodies.count = len(rows)
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


def _footprint(world: Array, box: NDArray[np.float64]) -> list[float]:
    """Centre x, y, lowest z, level axis and half sizes of a part's box."""
    low, high = box
    centre, half = (low + high) / 2.0, (high - low) / 2.0
    at = [
        float(world[r, 0] * centre[0] + world[r, 1] * centre[1] + world[r, 2] * centre[2] + world[r, 3])
        for r in (0, 1, 2)
    ]
    # The first axis that lies level enough gives the direction; a limb's box is nearly round anyway.
    axis = np.array([float(world[0, 0]), float(world[1, 0])])
    size = float(np.sqrt(axis[0] * axis[0] + axis[1] * axis[1]))
    axis = axis / size if size > 0.3 else np.array([1.0, 0.0])
    reach = [
        float(abs(world[r, 0]) * half[0] + abs(world[r, 1]) * half[1] + abs(world[r, 2]) * half[2]) for r in (0, 1, 2)
    ]
    if size > 0.3:
        across = [-axis[1], axis[0]]
        h0 = _extent(world, half, float(axis[0]), float(axis[1]))
        h1 = _extent(world, half, float(across[0]), float(across[1]))
    else:
        h0, h1 = reach[0], reach[1]
    return [at[0], at[1], at[2] - reach[2], float(axis[0]), float(axis[1]), h0, h1]


def _extent(world: Array, half: NDArray[np.float64], x: float, y: float) -> float:
    return sum(abs(float(world[0, c]) * x + float(world[1, c]) * y) * float(half[c]) for c in range(3))


def _upload(values: NDArray[np.float64], kind: Any, device: str) -> Any:
    return wp.array(np.ascontiguousarray(values).astype(np.float32), dtype=kind, device=device)
