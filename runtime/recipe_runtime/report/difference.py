"""Two pictures that should be one: how many pixels differ, and pictures that show where."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from recipe_runtime import encode
from recipe_runtime.store import write_atomic

if TYPE_CHECKING:
    from recipe_runtime.shot import Shot


def differing_pixels(one: Path, other: Path) -> int | None:
    """The number of pixels in which two files differ; None if one cannot be read, or has another shape."""
    a, b = read_pixels(one), read_pixels(other)
    if a is None or b is None or a.shape != b.shape:
        return None
    return int(np.count_nonzero(_differs(a, b)))


def read_pixels(path: Path) -> NDArray[Any] | None:
    """The pixels of a PNG or `.npy` file; None if it cannot be read."""
    try:
        if path.suffix == ".npy":
            array: NDArray[Any] = np.load(path, allow_pickle=False)
            return array
        with Image.open(path) as picture:
            return np.asarray(picture)
    except (OSError, ValueError, SyntaxError, EOFError):
        return None


def write_difference(stem: Path, made: Shot, there: Path | None) -> list[Path]:
    """Write `STEM-actual.png`, and with a file to compare with, `-expected.png` and `-difference.png`: red differs."""
    actual = made.picture()
    pictures = {"actual": actual}
    expected = read_pixels(there) if there else None
    if expected is not None and expected.shape[:2] == actual.shape[:2]:
        as_carla = made.modality == "depth" and expected.ndim == 3
        pixels = encode.carla_depth(made.pixels) if as_carla else made.pixels
        faded = (actual // 3).astype(np.uint8)
        faded[_differs(pixels, expected)] = (255, 40, 40)
        shown = replace(made, pixels=encode.metres_from_carla(expected) if as_carla else expected).picture()
        pictures |= {"expected": shown, "difference": faded}
    paths = []
    for kind, picture in pictures.items():
        path = stem.with_name(f"{stem.name}-{kind}.png")
        write_atomic(path, encode.png(picture))
        paths.append(path)
    return paths


def _differs(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    different = np.asarray(a != b)
    return np.asarray(different.any(axis=-1)) if different.ndim == 3 else different
