"""People who walk along a line at given speeds, without a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.library import blueprints
from recipe_runtime.body import walk_cycle
from recipe_runtime.body.footsteps import Footsteps, Ground
from recipe_runtime.body.gait import Gait
from recipe_runtime.body.poses import Poses
from recipe_runtime.body.skeleton import Figure
from recipe_runtime.frames import portrait
from recipe_runtime.meshes import actor_body
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.skin import split_parts

from tests.runtime.actors import actor

PEOPLE = [b for b in blueprints.LIBRARY if b.category == "pedestrian"]
TICK = 1.0 / 30.0  # seconds between two samples


def level(_x: float, _y: float) -> float:
    """Return the height of flat ground."""
    return 0.0


def kerb(begin: float, end: float) -> Ground:
    """Return the height function of a sidewalk across the path, 15 cm high."""
    return lambda x, y: 0.15 if begin <= x <= end else 0.0


def body_of(blueprint: blueprints.Blueprint) -> Body:
    """Return the meshes of a person."""
    return actor_body(actor("it", blueprint))


@dataclass(frozen=True)
class Moment:
    """Feet, poses of the parts as matrices [P, 3, 4], and position along the line."""

    feet: Footsteps
    parts: NDArray[np.float64]
    x: float


def walk(
    figure: Figure,
    speed: Callable[[float], float],
    seconds: float,
    *,
    ground: Ground = level,
    turning: Callable[[float], float] = lambda _t: 0.0,
    phase: float = 0.3,
) -> list[Moment]:
    """Walk from the origin along x, and return every moment.

    Args:
        figure: Who walks.
        speed: m/s at a time.
        seconds: How long.
        ground: Height of the ground.
        turning: rad/s at a time.
        phase: At the start.
    """
    x = y = angle = 0.0
    heading = (1.0, 0.0)
    feet = Footsteps.steady(Gait(figure), phase, speed(0.0), (x, y), heading, ground)
    walkers, found = walk_cycle.Walkers([figure]), []
    for n in range(int(seconds / TICK)):
        poses = walkers.pose([walk_cycle.row(feet, (x, y), heading)], ground)
        found.append(Moment(feet, matrices(poses), x))
        v, w = speed((n + 1) * TICK), turning((n + 1) * TICK)
        angle += w * TICK
        heading = (math.cos(angle), math.sin(angle))
        x, y = x + v * heading[0] * TICK, y + v * heading[1] * TICK
        feet = feet.moved((x, y), heading, (v * heading[0], v * heading[1]), w, TICK, ground)
    return found


def matrices(poses: Poses) -> NDArray[np.float64]:
    """Return world-from-part transforms [P, 3, 4] of the first actor."""
    positions, rotations = poses.positions[:, :, 0].T.tolist(), poses.rotations[:, :, 0].T.tolist()
    return np.asarray(portrait.matrices([(tuple(p), tuple(q)) for p, q in zip(positions, rotations, strict=True)]))


def vertices(body: Body, moment: Moment, part: str) -> NDArray[np.float64]:
    """Return the vertices of a part in the world frame [V, 3]."""
    parts = split_parts(body.parts)
    index = [name for name, _ in parts].index(part)
    t = moment.parts[index]
    return np.asarray(parts[index][1].vertices.astype(np.float64) @ t[:, :3].T + t[:, 3])


def above_ground(points: NDArray[np.float64], ground: Ground) -> NDArray[np.float64]:
    """Return the height of points above the ground, which varies along x only."""
    return points[:, 2] - [ground(x, 0.0) for x in points[:, 0].tolist()]


def soles(body: Body, moment: Moment) -> Sequence[NDArray[np.float64]]:
    """Return the vertices of both feet."""
    return [vertices(body, moment, f"foot_{side}") for side in ("left", "right")]
