"""From CARLA's left-handed frame to the right-handed frame of recipes.

CARLA: x forward, y right, z up; yaw turns from x to y, clockwise seen from above; positive pitch looks up. Recipes: x
forward, y left, z up; yaw counter-clockwise; positive pitch looks down. Positive roll tilts to the right in both. So y,
yaw and pitch change their sign. Metres and degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from recipe_compiler.ir import exact

Rows = tuple[tuple[float, float, float], ...]

WALKER_ORIGIN = 0.93
"""Height of the origin of CARLA's walkers, the middle of the body, above their feet; recipes have it at the feet."""


@dataclass(frozen=True)
class Pose:
    """A pose in the right-handed frame."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    @property
    def rows(self) -> Rows:
        """The rotation matrix: yaw about z, then pitch about the new y, then roll about the new x."""
        (sy, cy), (sp, cp), (sr, cr) = (exact.sin_cos_deg(a) for a in (self.yaw, self.pitch, self.roll))
        return (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )

    def of_carla(self) -> Pose:
        """The pose whose numbers are CARLA's, in the right-handed frame; angles from -180 to 180."""
        return Pose(self.x, -self.y + 0.0, self.z, turned(-self.yaw), turned(-self.pitch), turned(self.roll))

    def of(self, child: Pose) -> Pose:
        """The pose of a child that is given in the frame of this one."""
        rows = self.rows
        x, y, z = _applied(rows, (child.x, child.y, child.z))
        columns = list(zip(*child.rows, strict=True))
        turn = list(zip(*(_applied(rows, column) for column in columns), strict=True))
        return placed((self.x + x, self.y + y, self.z + z), tuple((a, b, c) for a, b, c in turn))


def placed(at: tuple[float, float, float], rows: Rows) -> Pose:
    """The pose with a position and a rotation matrix; the roll is 0 where it looks straight up or down."""
    (r00, r01, _), (r10, r11, _), (r20, r21, r22) = rows
    level = math.sqrt(r00 * r00 + r10 * r10)
    pitch = exact.atan2_deg(-r20, level)
    if level < 1e-9:
        return Pose(*at, yaw=exact.atan2_deg(-r01, r11), pitch=pitch)
    return Pose(*at, yaw=exact.atan2_deg(r10, r00), pitch=pitch, roll=exact.atan2_deg(r21, r22))


def board(patch: Pose, height: float) -> Pose:
    """The pose of a board that is equal to one of OSCAR's patches.

    A patch without rotation lies flat with its face up, the right of its image along x and the bottom towards its
    right side; its origin is its middle. A board faces its x axis, and its origin is the middle of its lower edge.

    Args:
        patch: the pose of the patch in the right-handed frame.
        height: its height, metres.
    """
    middle = patch.of(Pose(y=-height / 2))
    rows = tuple((row[2], row[0], row[1]) for row in patch.rows)
    return placed((middle.x, middle.y, middle.z), rows)


def turned(angle: float) -> float:
    """An angle from -180 (exclusive) to 180 degrees; equal for equal directions."""
    rest = math.fmod(angle, 360.0)
    rest -= 360.0 if rest > 180.0 else -360.0 if rest <= -180.0 else 0.0
    return rest + 0.0


def _applied(rows: Rows, v: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in rows)
    return x, y, z
