"""The choice of the lamps that cast shadows in a frame, those nearest to what the camera sees, and their map views.

The choice depends only on the scene and the poses of camera and parts. A lamp's shadow fades out before the lamp loses
its slot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows import lamp_shadow_kernels as kernels

STATIC_SLOTS, MOVING_SLOTS = int(kernels.STATIC_SLOTS), int(kernels.MOVING_SLOTS)
SLOTS = STATIC_SLOTS + MOVING_SLOTS
MAP_NAMES = ("right", "down", "ahead", "lens", "own")
MAP_KINDS = (wp.vec4f, wp.vec4f, wp.vec4f, wp.vec4f, wp.vec2f)
_AHEAD = 12.0  # metres from the camera to the point ahead of it from which distances are measured
_STATIC_END = 60.0  # metres from that point at which the shadows of the town's lamps have faded out
_MOVING_END = 45.0  # metres, likewise for lamps on moving objects
_FADE = 0.25  # share of that distance over which they fade
_MIN_COSINE = 0.33  # of a map's half angle, at most 71 degrees; the weak light of wider cones beyond has no shadows
_MOVING_RANGE = 30.0  # metres along the axis of a lamp on a moving object at which shadows have faded out
_NEAR = 0.3  # metres, near plane: nearer surfaces cast no shadow


@dataclass(frozen=True)
class LampSlots:
    """The lamps of all slots, for one frame or many."""

    lights: NDArray[np.int64]  # [..., SLOTS] index among the geometry's lights
    weights: Array  # [..., SLOTS] strength of the shadow, 0 if the slot is unused
    columns: tuple[Array, ...]  # by `MAP_NAMES`, [..., SLOTS, 2 or 4]

    def by_frame(self) -> list[LampSlots]:
        """Return the slots of each frame; the first axis must be frames."""
        count = len(self.lights)
        return [LampSlots(self.lights[n], self.weights[n], tuple(c[n] for c in self.columns)) for n in range(count)]


def assign_slots(geometry: Geometry, position: Array, direction: Array, reach: Array, pose: Array) -> LampSlots:
    """Return the lamps that cast shadows.

    Args:
        geometry: The scene.
        position: Of its lights, metres in world space, [..., L, 3].
        direction: Of its lights, unit vectors in world space, [..., L, 3].
        reach: Of its lights, metres, [L].
        pose: World from sensor (x forward), [..., 3, 4].
    """
    if not geometry.lights:
        return _no_slots(pose.shape[:-2])
    leaders = lamp_leaders(geometry)
    middle = _middles(position, leaders)
    away = middle - (pose[..., 3] + pose[..., 0] * _AHEAD)[..., None, :]
    distance = np.sqrt((away[..., 0] * away[..., 0] + away[..., 1] * away[..., 1]) + away[..., 2] * away[..., 2])
    moves = geometry.light_parts != 0
    still = _nearest(distance, np.flatnonzero(~moves), STATIC_SLOTS, _STATIC_END)
    carried = np.flatnonzero(moves & (leaders == np.arange(len(leaders))))
    moving = _nearest(distance, carried, MOVING_SLOTS, _MOVING_END)
    lights, weights = np.concatenate([still[0], moving[0]], axis=-1), np.concatenate([still[1], moving[1]], axis=-1)
    chosen = lights[..., None]
    at, aim = (np.take_along_axis(values, chosen, axis=-2) for values in (middle, direction))
    right, down = _across(aim)
    axes = [np.concatenate([axis, -_along(axis, at)], axis=-1) for axis in (right, down, aim)]
    cosine = np.maximum(geometry.light_rows[:, 10][lights], _MIN_COSINE)
    tangent = np.sqrt(1.0 - cosine * cosine) / cosine
    # (A border of six texels is for the filter.)
    size = np.repeat([float(int(kernels.STATIC_SIZE)), float(int(kernels.MOVING_SIZE))], [STATIC_SLOTS, MOVING_SLOTS])
    texels = np.where(weights > 0.0, (size / 2.0 - 6.0) / tangent, 0.0)
    inverse = np.where(weights > 0.0, tangent / (size / 2.0 - 6.0), 0.0)
    end = np.minimum(reach[lights], np.where(size < int(kernels.STATIC_SIZE), _MOVING_RANGE, np.inf))
    lens = np.stack([texels, np.full_like(texels, _NEAR), end, inverse], axis=-1)
    return LampSlots(lights, weights, (*axes, lens, _mounted_on(geometry)[lights]))


def lamp_leaders(geometry: Geometry) -> NDArray[np.int64]:
    """Return for each light the first that is on the same part and points in the same direction, [L].

    The headlights of a vehicle share one map, seen from the middle between them. Lamps of the town have one each.
    """
    first: dict[tuple[float, ...], int] = {}
    rows = zip(geometry.light_parts.tolist(), geometry.light_rows[:, 3:6].tolist(), strict=True)
    keys = [(float(part), *aim) if part else (0.0, float(n)) for n, (part, aim) in enumerate(rows)]
    return np.array([first.setdefault(key, n) for n, key in enumerate(keys)], np.int64)


def shadow_column(slots: LampSlots, leaders: NDArray[np.int64]) -> Array:
    """Return the slot and the weight of each light, [..., L, 2]; `leaders` as from `lamp_leaders`."""
    count = len(leaders)
    shape = slots.weights.shape[:-1]
    numbers, weights = np.zeros((*shape, count)), np.zeros((*shape, count))
    # (Unused slots refer to light 0, which may have a slot of its own, so used slots are written last.)
    order = np.argsort(slots.weights, axis=-1, kind="stable")
    lights = np.take_along_axis(slots.lights, order, axis=-1)
    np.put_along_axis(numbers, lights, order.astype(np.float64), axis=-1)
    np.put_along_axis(weights, lights, np.take_along_axis(slots.weights, order, axis=-1), axis=-1)
    return np.stack([numbers, weights], axis=-1)[..., leaders, :]


def _middles(position: Array, leaders: NDArray[np.int64]) -> Array:
    """Return the middle of the lights of each leader at its place, [..., L, 3]."""
    total, count = np.zeros_like(position), np.zeros(len(leaders))
    for n, leader in enumerate(leaders.tolist()):
        total[..., leader, :] += position[..., n, :]
        count[leader] += 1.0
    middle: Array = total / np.maximum(count, 1.0)[:, None]
    return middle


def _nearest(distance: Array, members: NDArray[np.int64], slots: int, end: float) -> tuple[NDArray[np.int64], Array]:
    """Return the nearest of some lights, [..., slots], and their weights, which reach 0 at the distance of the next."""
    shape, count = distance.shape[:-1], min(slots, len(members))
    lights, weights = np.zeros((*shape, slots), np.int64), np.zeros((*shape, slots))
    if count:
        among = distance[..., members]
        order = np.argsort(among, axis=-1, kind="stable")[..., : slots + 1]
        near = np.take_along_axis(among, order, axis=-1)
        limit = np.minimum(near[..., slots:], end) if len(members) > slots else np.full((*shape, 1), end)
        lights[..., :count] = members[order[..., :count]]
        fade = (limit - near[..., :count]) / np.maximum(_FADE * limit, 1e-6)
        weights[..., :count] = np.minimum(np.maximum(fade, 0.0), 1.0)
    return lights, weights


def _no_slots(shape: tuple[int, ...]) -> LampSlots:
    columns = tuple(np.zeros((*shape, SLOTS, 2 if name == "own" else 4)) for name in MAP_NAMES)
    return LampSlots(np.zeros((*shape, SLOTS), np.int64), np.zeros((*shape, SLOTS)), columns)


def _mounted_on(geometry: Geometry) -> Array:
    """Return the first and last part of the object that each light is mounted on, [L, 2]; -1 and -2 for the town."""
    rows = np.tile([-1.0, -2.0], (len(geometry.lights), 1))
    for actor in geometry.actors:
        first = 1 + actor.first_part
        carried = (geometry.light_parts >= first) & (geometry.light_parts < first + actor.parts)
        rows[carried] = first, first + actor.parts - 1
    return rows


def _across(aim: Array) -> tuple[Array, Array]:
    """Return two unit vectors orthogonal to a direction [..., 3] and to each other, right and down."""
    x, y, z = aim[..., 0], aim[..., 1], aim[..., 2]
    flat = np.sqrt(x * x + y * y)
    level, one = flat > 1e-3, np.maximum(flat, 1e-3)
    ux, uy = np.where(level, -y / one, 1.0), np.where(level, x / one, 0.0)
    right = np.stack([ux, uy, np.zeros_like(ux)], axis=-1)
    return right, np.stack([-z * uy, z * ux, x * uy - y * ux], axis=-1)


def _along(axis: Array, point: Array) -> Array:
    product: Array = (axis[..., 0] * point[..., 0] + axis[..., 1] * point[..., 1]) + axis[..., 2] * point[..., 2]
    return product[..., None]
