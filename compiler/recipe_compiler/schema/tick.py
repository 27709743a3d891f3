"""The time between two pictures of a sensor, as a number of frames."""

from __future__ import annotations

MAX_TICK = 86_400.0  # seconds
_TOLERANCE = 1e-6  # seconds: decimals such as 0.033333 mean a fraction


def interval_of(tick: float, fps: int) -> int:
    """Return the frames from one picture to the next; at least 1.

    Args:
        tick: seconds; 0 for every frame.
        fps: frames per second.
    """
    return max(1, round(tick * fps))


def nearest_ticks(tick: float, fps: int) -> list[float]:
    """Return the nearest valid values, in seconds, of a tick that is none; nothing if it is valid."""
    if tick == 0.0 or abs(tick - interval_of(tick, fps) / fps) <= _TOLERANCE:
        return []
    below = int(tick * fps)
    return [frames / fps for frames in (below, below + 1) if frames > 0]
