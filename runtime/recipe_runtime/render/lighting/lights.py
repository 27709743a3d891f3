"""Lamps that are on, and bodies near the ground, collected on the host for one frame or many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core.interfaces import LampState
from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.tile_list_kernels import Bodies, Lamps
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.lamp_shadow_maps import no_maps, uploaded
from recipe_runtime.render.shadows.lamp_slots import LampSlots, assign_slots, lamp_leaders, shadow_column

_CANDELA = 1.0 / 11000.0  # light of one candela on a white surface at one metre, in the scale of `Air`
_SPILL = 1400.0  # candela above which the light near a lamp grows with the square root
_MAX_LAMPS = 256
_LIT_STREET = 3.1e-3  # the light of all lamps near a street that is lit
_UNLIT = 0.3  # the minimum that a street counts as, relative to that
_MAX_HEIGHT = 0.4  # metres above the ground at which a part no longer darkens it
_MAX_OCCLUSION = 0.72  # share of the sky's light that a wide body on the ground blocks
_STATE_OF_SLOT = {
    "brakelight": LampState.BRAKE,
    "indicator_left": LampState.LEFT,
    "indicator_right": LampState.RIGHT,
    "reverselight": LampState.REVERSE,
}
_TYPICAL_STREET = 1.0e-3  # the light of lamps on a typical street, as `weather_light` counts it
_METERED = 0.5  # weight of the road in the metering
_ROAD_AHEAD = (5.0, 6.5, 8.5, 11.0, 14.0)  # metres ahead of a vehicle's origin where a camera on it meters the road
_MOUNT_MARGIN = np.array([[1.0, 0.3, 0.3], [0.6, 0.3, 1.2]])  # metres behind and ahead of a vehicle, and so on
_NOWHERE = 1.0e9  # metres, a coordinate out of reach
LAMP_NAMES = ("position", "direction", "power", "cone", "reach", "shadow")
LAMP_KINDS = (wp.vec3f, wp.vec3f, wp.vec3f, wp.vec2f, wp.float32, wp.vec2f)
BODY_NAMES = ("centre", "axis", "half", "spread", "strength")
BODY_KINDS = (wp.vec3f, wp.vec2f, wp.vec2f, wp.float32, wp.float32)


def lamplight(geometry: Geometry, eye: Array, parts: Array) -> float:
    """Return the light to which a camera adapts, relative to a typical street.

    It is that of the static lamps near it, and of the headlights of the vehicle that carries it. A static lamp counts
    as if it were at least 10 m away, so that passing one changes little.

    Args:
        geometry: The scene.
        eye: The camera's place in the world, [3].
        parts: World from part, [P, 3, 4].
    """
    lights = geometry.light_rows[geometry.light_parts == 0]
    dx, dy, dz = (lights[:, axis] - float(eye[axis]) for axis in range(3))
    near = _power(lights[:, 9]) / (dx * dx + dy * dy + dz * dz + 100.0)
    total = float(np.add.accumulate(near)[-1]) if len(near) else 0.0  # sequential sum: the same on every CPU
    return min(max(total / _LIT_STREET, _UNLIT), 2.0) + headlight(geometry, eye, parts)


def headlight(geometry: Geometry, eye: Array, parts: Array) -> float:
    """Return the light of its own headlights on the road ahead of a camera on a vehicle, relative to a typical street.

    It is 0 for other cameras. `eye` [3] is the camera's place in the world, `parts` [P, 3, 4] are world from part.
    """
    for actor in geometry.actors:
        mounted = np.flatnonzero(geometry.light_parts == 1 + actor.first_part)
        if len(mounted) and _carries(parts[actor.first_part], geometry.part_bounds[actor.first_part], eye):
            rows = geometry.light_rows[mounted]
            sums = [_on_road(rows, distance) for distance in _ROAD_AHEAD]
            return round(sum(sums) / len(sums) * _METERED / _TYPICAL_STREET, 3)
    return 0.0


def _carries(world: Array, box: Array, eye: Array) -> bool:
    """Return whether an eye is in or on the base part of a vehicle."""
    away = eye - world[:, 3]
    own = (world[0] * away[0] + world[1] * away[1]) + world[2] * away[2]
    return bool((own[:3] > box[0] - _MOUNT_MARGIN[0]).all() and (own[:3] < box[1] + _MOUNT_MARGIN[1]).all())


def _on_road(rows: Array, distance: float) -> float:
    """Return the light of lamps on a vehicle on the road at a distance ahead of its origin, as `lamp_light` does."""
    x, y, z = distance - rows[:, 0], -rows[:, 1], -rows[:, 2]
    square = x * x + y * y + z * z
    reach = np.sqrt(square)
    within = (x * rows[:, 3] + y * rows[:, 4] + z * rows[:, 5]) / reach
    spot = np.minimum(np.maximum((within - rows[:, 10]) / (0.75 * (1.0 - rows[:, 10])), 0.0), 1.0)
    share = spot * spot * (3.0 - 2.0 * spot) * (rows[:, 2] / reach + 0.12) / 1.12 / (square + 0.15)
    return float(np.add.accumulate(_power(rows[:, 9]) * share)[-1])


def lamps_at(geometry: Geometry, columns: Sequence[Array], maps: DeviceArray, lit: DeviceArray, device: str) -> Lamps:
    """Return the struct of the lamps of `lamp_columns`, with their shadow maps; `lit` float32 [S] as `Lamps.lit`."""
    return lamps_of(geometry, uploaded(columns, LAMP_KINDS, device), maps, lit, device)


def lamps_of(geometry: Geometry, columns: Sequence[Any], maps: DeviceArray, lit: DeviceArray, device: str) -> Lamps:
    """Return the struct of lamps whose columns are on the device."""
    crowded = len(geometry.lights) > _MAX_LAMPS  # then the selected lamps may change from frame to frame
    moves = [int(crowded or mounted.part != 0) for mounted in geometry.lights[:_MAX_LAMPS]] or [1]
    return set_fields(
        Lamps(),
        **dict(zip(LAMP_NAMES, columns, strict=True)),
        moves=wp.array(np.array(moves, np.int32), dtype=wp.int32, device=device),
        maps=maps,
        lit=lit,
        count=min(len(geometry.lights), _MAX_LAMPS),
    )


def lamp_columns(geometry: Geometry, world: Array, pose: Array) -> tuple[tuple[Array, ...], LampSlots]:
    """Return the columns of the lamps nearest to the eye, by `LAMP_NAMES`, and the lamps that cast shadows.

    If there are no lamps, one of power 0 is returned. `world` [..., 1 + P, 3, 4] from parts, `pose` [..., 3, 4] of the
    sensor; columns [..., L, 3], the cone and the shadow [..., L, 2], the reach [..., L].
    """
    eye = pose[..., 3]
    if not geometry.lights:
        none = np.zeros((*eye.shape[:-1], 1, 3))
        slots = assign_slots(geometry, none, none, none[..., 0], pose)
        return (none, none, none, none[..., :2], none[..., 0], none[..., :2]), slots
    lights, carrier = geometry.light_rows, world[..., geometry.light_parts, :, :]
    candela, cone = lights[:, 9], lights[:, 10]
    power = _power(candela)[:, None] * lights[:, 6:9]
    shape = np.stack([cone, cone + (1.0 - cone) * 0.75, 3.0 + 0.6 * np.sqrt(candela)], axis=-1)
    to = _rotated(carrier, lights[:, 3:6])
    position = _rotated(carrier, lights[:, 0:3]) + carrier[..., 3]
    slots = assign_slots(geometry, position, to, shape[:, 2], pose)
    rest = np.broadcast_to(np.concatenate([power, shape], axis=-1), (*to.shape[:-1], 6))
    rows = np.concatenate([position, to, rest, shadow_column(slots, lamp_leaders(geometry))], axis=-1)
    if len(geometry.lights) > _MAX_LAMPS:
        away = rows[..., 0:3] - eye[..., None, :]
        gaps = (away[..., 0] * away[..., 0] + away[..., 1] * away[..., 1]) + away[..., 2] * away[..., 2]
        kept = np.sort(np.argsort(gaps, axis=-1, kind="stable")[..., :_MAX_LAMPS], axis=-1)
        rows = np.take_along_axis(rows, kept[..., None], axis=-2)
    columns = rows[..., 0:3], rows[..., 3:6], rows[..., 6:9], rows[..., 9:11], rows[..., 11], rows[..., 12:14]
    return columns, slots


def lit_surfaces(geometry: Geometry, states: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return which surfaces are lamps of vehicles that are lit: 1 or 0, [..., S].

    Head and tail lamps count as lit: the weather determines their radiance (`Air.running`).

    Args:
        geometry: The scene.
        states: A mask of `LampState` for each actor, [..., A].
    """
    lit = np.zeros((*states.shape[:-1], len(geometry.surfaces)), np.float32)
    for n in geometry.lamp_surfaces.tolist():
        key = geometry.surfaces[n]
        state = _STATE_OF_SLOT.get(key.slot)
        lit[..., n] = 1.0 if state is None else (states[..., key.actor] & int(state)) != 0
    return lit


def no_lamps(lit: DeviceArray, device: str) -> Lamps:
    """Return the struct of no lamps, for daylight, in which surfaces of vehicles may be lit."""
    columns = {name: wp.zeros(1, dtype=kind, device=device) for name, kind in zip(LAMP_NAMES, LAMP_KINDS, strict=True)}
    return set_fields(
        Lamps(),
        **columns,
        moves=wp.zeros(1, dtype=wp.int32, device=device),
        maps=no_maps(device),
        lit=lit,
        count=0,
    )


def bodies_at(geometry: Geometry, parts: Array, sky: DeviceArray, device: str) -> Bodies:
    """Return the moving parts within half a metre of the ground below their actor; `sky`: see `bodies_of`."""
    columns = body_columns(geometry, parts)
    near = columns[0][:, 2] < _NOWHERE
    kept = [column[near] if near.any() else column[:1] for column in columns]
    return bodies_of(uploaded(kept, BODY_KINDS, device), int(near.sum()), sky)


def bodies_of(columns: Sequence[Any], count: int, sky: DeviceArray) -> Bodies:
    """Return the struct of bodies whose columns are on the device; `sky` is that of `sky_grid`."""
    return set_fields(Bodies(), **dict(zip(BODY_NAMES, columns, strict=True)), count=count, sky=sky)


def body_columns(geometry: Geometry, parts: Array) -> tuple[Array, ...]:
    """Return centre, axis, half sizes, spread and strength of the footprint of every moving part, in the Trace's order.

    `parts` [..., P, 3, 4]. The footprint of a part that is not near the ground is placed out of reach.
    """
    if not geometry.parts:
        none = np.zeros((*parts.shape[:-3], 1, 3))
        return none + _NOWHERE, none[..., :2], none[..., :2], none[..., 0] + 1.0, none[..., 0]
    box = _footprint(parts, geometry.part_bounds)
    firsts = [actor.first_part for actor in geometry.actors]
    lowest = np.minimum.reduceat(box[..., 2], firsts, axis=-1)
    foot = np.repeat(lowest, [actor.parts for actor in geometry.actors], axis=-1)
    signals = np.full((*foot.shape[:-1], box.shape[-2] - foot.shape[-1]), -_NOWHERE)  # signals are not near the ground
    foot = np.concatenate([foot, signals], axis=-1)
    height, small = box[..., 2] - foot, np.minimum(box[..., 5], box[..., 6])
    # The share of the sky that a disc of the part's width hides, seen from the ground below its centre.
    lift = height / (small + 0.04)
    centre = np.stack([box[..., 0], box[..., 1], foot], axis=-1)
    centre = np.where((height < _MAX_HEIGHT)[..., None], centre, _NOWHERE)
    spread = 0.05 + 0.35 * small + 0.4 * height
    return centre, box[..., 3:5], box[..., 5:7], spread, _MAX_OCCLUSION / (1.0 + lift * lift)


def _power(candela: Array) -> Array:
    """Return the light on a white surface at a distance of one metre."""
    # The light near a strong lamp is the spill of a beam that is aimed far ahead.
    power: Array = candela * np.minimum(1.0, np.sqrt(_SPILL / candela)) * _CANDELA
    return power


def _rotated(world: Array, v: Array) -> Array:
    """Rotate vectors [L, 3] by transforms [..., L, 3, 4]."""
    turned: Array = (world[..., 0] * v[:, 0:1] + world[..., 1] * v[:, 1:2]) + world[..., 2] * v[:, 2:3]
    return turned


def _footprint(world: Array, boxes: NDArray[np.float64]) -> Array:
    """Return centre x, y, lowest z, horizontal axis and half sizes of the parts' boxes [P, 2, 3], as [..., P, 7]."""
    low, high = boxes[:, 0], boxes[:, 1]
    half = (high - low) / 2.0
    at = _rotated(world, (low + high) / 2.0) + world[..., 3]
    # The direction is that of the first axis if it is horizontal enough; boxes of limbs are nearly round.
    x, y = world[..., 0, 0], world[..., 1, 0]
    size = np.sqrt(x * x + y * y)
    level = size > 0.3
    one = np.where(level, size, 1.0)
    x, y = np.where(level, x / one, 1.0), np.where(level, y / one, 0.0)
    reach = _rotated(np.abs(world), half)
    h0 = np.where(level, _extent(world, half, x, y), reach[..., 0])
    h1 = np.where(level, _extent(world, half, -y, x), reach[..., 1])
    return np.stack([at[..., 0], at[..., 1], at[..., 2] - reach[..., 2], x, y, h0, h1], axis=-1)


def _extent(world: Array, half: NDArray[np.float64], x: Array, y: Array) -> Array:
    sides = [np.abs(world[..., 0, c] * x + world[..., 1, c] * y) * half[:, c] for c in range(3)]
    extent: Array = (sides[0] + sides[1]) + sides[2]
    return extent
