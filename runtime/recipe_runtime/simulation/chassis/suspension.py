"""Height, pitch and roll of a vehicle from the ground under its wheels."""

from __future__ import annotations

from collections.abc import Sequence

from recipe_compiler.ir import exact

from recipe_runtime.body.kinematics import IDENTITY, Quaternion, axis_rotation, compose
from recipe_runtime.simulation.terrain import Ground

_CLIMB = 1.2  # m/s, the highest vertical speed of a wheel at a kerb

Wheels = tuple[tuple[float, float], ...]  # position of each wheel from the origin: metres ahead and to the left


class Suspension:
    """A rigid chassis on its wheels, each of which follows the ground at a limited rate. Immutable."""

    def __init__(self, wheels: Wheels, heights: Sequence[float]) -> None:
        """Place a chassis.

        Args:
            wheels: Front left, front right, rear left, rear right; or front, rear.
            heights: Of the wheels' lowest points, metres.
        """
        self._wheels, self._heights = wheels, tuple(heights)
        self.height = sum(self._heights) / len(wheels)

    @classmethod
    def on_ground(
        cls, wheels: Wheels, ground: Ground, place: tuple[float, float], heading: tuple[float, float]
    ) -> Suspension:
        """Return a chassis that rests on the ground."""
        return cls(wheels, _ground_heights(wheels, ground, place, heading))

    def moved(
        self, ground: Ground, place: tuple[float, float], heading: tuple[float, float], seconds: float
    ) -> Suspension:
        """The chassis after it has moved to a place for some seconds."""
        targets = _ground_heights(self._wheels, ground, place, heading)
        if targets == self._heights:
            return self
        most = _CLIMB * seconds
        return Suspension(
            self._wheels, [h + max(-most, min(most, t - h)) for h, t in zip(self._heights, targets, strict=True)]
        )

    @property
    def tilt(self) -> Quaternion:
        """Rotation of the chassis from the level: its pitch and roll."""
        if min(self._heights) == max(self._heights):
            return IDENTITY
        rise, bank = self._slopes()
        pitch = axis_rotation("y", -exact.atan2_deg(rise, 1.0))
        return compose(pitch, axis_rotation("x", exact.atan2_deg(bank, 1.0)))

    def tilt_rates(self, before: Suspension, seconds: float) -> tuple[float, float]:
        """Return the rates of roll and pitch, rad/s about its own x and y, since an earlier state."""
        if before is self or seconds <= 0.0:
            return 0.0, 0.0
        (rise, bank), (rise_before, bank_before) = self._slopes(), before._slopes()
        return (bank - bank_before) / seconds, (rise_before - rise) / seconds

    def _slopes(self) -> tuple[float, float]:
        """Metres that the chassis rises per metre ahead, and per metre to the left."""
        w, h = self._wheels, self._heights
        if len(w) == 2:
            return (h[0] - h[1]) / (w[0][0] - w[1][0]), 0.0
        ahead, left = w[0][0] - w[2][0], w[0][1] - w[1][1]
        return (h[0] + h[1] - h[2] - h[3]) / (2.0 * ahead), (h[0] + h[2] - h[1] - h[3]) / (2.0 * left)


def _ground_heights(
    wheels: Wheels, ground: Ground, place: tuple[float, float], heading: tuple[float, float]
) -> tuple[float, ...]:
    (x, y), (hx, hy) = place, heading
    return tuple([ground.height(x + a * hx - b * hy, y + a * hy + b * hx) for a, b in wheels])
