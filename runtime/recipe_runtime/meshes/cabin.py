"""The interior of a vehicle as two numbers, which the uv of its glass carry to `render/texture/vehicle.py`."""

from __future__ import annotations

import math
from dataclasses import dataclass

PITCH = 0.85  # distance between rows of seats, metres
ROWS = (1, 2, 3, 8)


@dataclass(frozen=True)
class Cabin:
    """What one sees through the windows of a vehicle, in its frame; metres."""

    seat: float  # x of the backs of the front seats
    half: float  # half the width inside
    head: float  # height of a driver's eyes
    belt: float  # height of the lower edge of the windows
    roof: float  # height of the lining
    rows: int  # of seats, one of `ROWS`
    driver: bool

    def uv(self) -> tuple[float, float]:
        """Return the numbers: whole, and small enough that interpolation keeps them."""
        seat, half = _steps(self.seat, 0.02) + 256, _steps(self.half, 0.04)
        u = seat + 512 * half + 16384 * ROWS.index(self.rows) + 65536 * int(self.driver)
        v = _steps(self.head, 0.02) + 256 * _steps(self.belt, 0.02) + 65536 * _steps(self.roof - self.head, 0.2)
        return float(u), float(v)


def _steps(value: float, step: float) -> int:
    return math.floor(value / step + 0.5)
