"""Lens distortion: how a distorted image is resampled from an undistorted one, and which coefficients are valid.

Let p be the offset of an image point from the centre, in half widths, and r its length. The lens shows at p what a
pinhole camera shows at

    f(r) p,  f(r) = 1 + lens_k r^2 + lens_kcube r^3.

A positive `lens_k` gives barrel distortion, a negative one pincushion distortion. The undistorted image is
wider by the maximum of f, and has a higher resolution.
"""

from __future__ import annotations

import math
from typing import Protocol

from recipe_compiler.ir import exact

MAX_SAMPLES = 4096 * 4096  # of an undistorted image
_MIN_SLOPE = 0.5  # of f(r) r, the local magnification
_MAX_SLOPE = 6.0  # likewise
_MAX_TANGENT = 14.3  # of half the maximal field of view, 172 degrees
_MIN_SUPERSAMPLE = 2  # samples of an undistorted image along a pixel's side
_STEPS = 64


class Lens(Protocol):
    """The parameters of a camera that determine its distortion."""

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


def focal_length(camera: Lens) -> float:
    """Focal length of the camera without distortion, in pixels."""
    sine, cosine = exact.sin_cos_deg(camera.fov / 2.0)
    return camera.width / 2.0 * cosine / sine


def bends(camera: Lens) -> bool:
    """Whether the camera has lens distortion."""
    return camera.lens_k != 0.0 or camera.lens_kcube != 0.0


def corner(camera: Lens) -> float:
    """Distance of the image corners from the centre, in half widths."""
    return math.sqrt(1.0 + (camera.height / camera.width) * (camera.height / camera.width))


def factor(camera: Lens, r: float) -> float:
    """f(r): the ratio of the undistorted to the distorted radius, at r half widths from the centre."""
    return 1.0 + r * r * (camera.lens_k + camera.lens_kcube * r)


def slope(camera: Lens, r: float) -> float:
    """The derivative of f(r) r."""
    return 1.0 + r * r * (3.0 * camera.lens_k + 4.0 * camera.lens_kcube * r)


def _radii(camera: Lens) -> list[float]:
    edge = corner(camera)
    return [edge * step / _STEPS for step in range(_STEPS + 1)]


def undistorted_size(camera: Lens, supersample: int) -> tuple[int, int, int]:
    """Return the undistorted image's width and height in samples, both even, and its samples along a pixel's side."""
    if not bends(camera):
        return camera.width * supersample, camera.height * supersample, supersample
    fine = max(supersample, _MIN_SUPERSAMPLE)
    wide = max(factor(camera, r) for r in _radii(camera)) * fine
    width, height = (2 * math.ceil(wide * size / 2.0) + 4 for size in (camera.width, camera.height))
    return width, height, fine


def fault(camera: Lens, supersample: int) -> str | None:
    """What is invalid about a lens and its supersampling, in words that follow the value; None if it is valid."""
    if bends(camera):
        slopes = [slope(camera, r) for r in _radii(camera)]
        if min(slopes) < _MIN_SLOPE or max(slopes) > _MAX_SLOPE:
            return "bends the picture's corners too far; use a value nearer to 0"
        sine, cosine = exact.sin_cos_deg(camera.fov / 2.0)
        if sine / cosine * max(factor(camera, r) for r in _radii(camera)) > _MAX_TANGENT:
            return f"needs a view wider than 172 degrees at a fov of {camera.fov:g}; lower one of the two"
    width, height, _ = undistorted_size(camera, supersample)
    if width * height > MAX_SAMPLES:
        return f"asks for {width} x {height} samples a frame, above the most allowed, {MAX_SAMPLES}; lower it"
    return None
