"""Conversion of CARLA's left-handed poses to the right-handed frame of recipes.

CARLA: x forward, y right, z up; yaw turns from x to y, clockwise seen from above; positive pitch looks up. Recipes: x
forward, y left, z up; yaw counter-clockwise; positive pitch looks down. Positive roll tilts to the right in both. So y,
yaw and pitch change sign. Units are metres and degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from recipe_compiler.ir import exact

Rows = tuple[tuple[float, float, float], ...]

MIRRORED = ("y", "yaw", "pitch")
"""The numbers of a pose that change sign."""

WALKER_ORIGIN = 0.93
"""Height in metres of the origin of CARLA's walkers, the middle of the body, above their feet, the recipes' origin."""


@dataclass(frozen=True)
class Pose:
    """A pose in the right-handed frame: metres and degrees."""

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

    def to_right_handed(self) -> Pose:
        """Return the right-handed pose, if the numbers of this one are CARLA's; angles are from -180 to 180."""
        return Pose(
            self.x,
            -self.y + 0.0,
            self.z,
            normalize_angle(-self.yaw),
            normalize_angle(-self.pitch),
            normalize_angle(self.roll),
        )

    def compose(self, child: Pose) -> Pose:
        """Return the pose of a child, given in the frame of this pose, in the frame in which this pose is given."""
        rows = self.rows
        x, y, z = _applied(rows, (child.x, child.y, child.z))
        columns = list(zip(*child.rows, strict=True))
        turn = list(zip(*(_applied(rows, column) for column in columns), strict=True))
        return pose_from_matrix((self.x + x, self.y + y, self.z + z), tuple((a, b, c) for a, b, c in turn))


def pose_from_matrix(at: tuple[float, float, float], rows: Rows) -> Pose:
    """Return the pose with a position and a rotation matrix; the roll is 0 if it looks straight up or down."""
    (r00, r01, _), (r10, r11, _), (r20, r21, r22) = rows
    level = math.sqrt(r00 * r00 + r10 * r10)
    pitch = exact.atan2_deg(-r20, level)
    if level < 1e-9:
        return Pose(*at, yaw=exact.atan2_deg(-r01, r11), pitch=pitch)
    return Pose(*at, yaw=exact.atan2_deg(r10, r00), pitch=pitch, roll=exact.atan2_deg(r21, r22))


def board_pose(patch: Pose, height: float) -> Pose:
    """Return the pose of the board that covers the same rectangle as one of OSCAR's patches.

    An unrotated patch lies flat and faces up; the right of its image is along x, and the bottom towards its right side;
    its origin is its middle. A board faces along its x axis, and its origin is the middle of its lower edge.

    Args:
        patch: the pose of the patch in the right-handed frame.
        height: its height, metres.
    """
    middle = patch.compose(Pose(y=-height / 2))
    rows = tuple((row[2], row[0], row[1]) for row in patch.rows)
    return pose_from_matrix((middle.x, middle.y, middle.z), rows)


def normalize_angle(angle: float) -> float:
    """Return an angle normalized to -180 (exclusive) to 180 degrees."""
    rest = math.fmod(angle, 360.0)
    rest -= 360.0 if rest > 180.0 else -360.0 if rest <= -180.0 else 0.0
    return rest + 0.0


def normalize_range(low: float, high: float) -> tuple[float, float]:
    """Return a range of angles, moved by whole turns to the middle from -180 to 180 if it is not within one turn."""
    if low >= -360.0 and high <= 360.0:
        return low, high
    middle = (low + high) / 2
    turns = normalize_angle(middle) - middle
    return low + turns, high + turns


def _applied(rows: Rows, v: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in rows)
    return x, y, z
