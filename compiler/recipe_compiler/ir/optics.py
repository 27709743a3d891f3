"""Lens distortion in numbers: how a bent picture is cut from a straight one, and which bends are allowed.

With p the offset of a point of the picture from its centre, in half widths, and r its length, the lens shows at p what
a pinhole would show at

    f(r) p,  f(r) = 1 + lens_k r^2 + lens_kcube r^3.

A positive `lens_k` is a barrel's bulge, a negative one a pincushion's. The bent picture is cut from a straight one, the
plate, that is as much wider as f is large at most, and finer.
"""

from __future__ import annotations

import math
from typing import Protocol

from recipe_compiler.ir import exact

MOST_SAMPLES = 4096 * 4096  # of a plate
_LEAST_SLOPE, _MOST_SLOPE = 0.5, 6.0  # of f(r) r: beyond, the lens would blow up or squeeze what it shows
_WIDEST = 14.3  # tangent of half the widest sight, 172 degrees
_FINE = 2  # samples along a pixel's side at which a bent picture is cut from its plate, at least
_STEPS = 64


class Lens(Protocol):
    """What of a camera bends light: its picture's size and the two coefficients."""

    @property
    def width(self) -> int: ...  # noqa: D102
    @property
    def height(self) -> int: ...  # noqa: D102
    @property
    def fov(self) -> float: ...  # noqa: D102
    @property
    def lens_k(self) -> float: ...  # noqa: D102
    @property
    def lens_kcube(self) -> float: ...  # noqa: D102


def bends(camera: Lens) -> bool:
    """Whether the camera has a lens that is not a pinhole."""
    return camera.lens_k != 0.0 or camera.lens_kcube != 0.0


def corner(camera: Lens) -> float:
    """How far the picture's corners are from its centre, in half widths."""
    return math.sqrt(1.0 + (camera.height / camera.width) * (camera.height / camera.width))


def factor(camera: Lens, r: float) -> float:
    """f(r): what is seen r half widths from the centre is, for a pinhole, this much farther out."""
    return 1.0 + r * r * (camera.lens_k + camera.lens_kcube * r)


def slope(camera: Lens, r: float) -> float:
    """How fast f(r) r grows with r."""
    return 1.0 + r * r * (3.0 * camera.lens_k + 4.0 * camera.lens_kcube * r)


def _radii(camera: Lens) -> list[float]:
    edge = corner(camera)
    return [edge * step / _STEPS for step in range(_STEPS + 1)]


def plate_size(camera: Lens, supersample: int) -> tuple[int, int, int]:
    """Width and height of the plate in samples, both even, and the samples along a pixel's side at its centre."""
    if not bends(camera):
        return camera.width * supersample, camera.height * supersample, supersample
    fine = max(supersample, _FINE)
    wide = max(factor(camera, r) for r in _radii(camera)) * fine
    width, height = (2 * math.ceil(wide * size / 2.0) + 4 for size in (camera.width, camera.height))
    return width, height, fine


def fault(camera: Lens, supersample: int) -> str | None:
    """What is wrong with a lens and its supersampling, in words that follow the value; None if nothing is."""
    if bends(camera):
        slopes = [slope(camera, r) for r in _radii(camera)]
        if min(slopes) < _LEAST_SLOPE or max(slopes) > _MOST_SLOPE:
            return "bends the picture's corners too far; bring it nearer to 0"
        sine, cosine = exact.sin_cos_deg(camera.fov / 2.0)
        if sine / cosine * max(factor(camera, r) for r in _radii(camera)) > _WIDEST:
            return f"needs a view wider than 172 degrees at a fov of {camera.fov:g}; lower one of the two"
    width, height, _ = plate_size(camera, supersample)
    if width * height > MOST_SAMPLES:
        return f"asks for {width} x {height} samples a frame, above the most allowed, {MOST_SAMPLES}; lower it"
    return None
