"""Compares two pictures that should be equal: counts and draws the pixels that differ.

`recorded` is the picture in a dataset, `rendered` the one that this host renders. Either may be wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core import codecs
from recipe_runtime.core.files import host_errors, read_inside, write_atomic
from recipe_runtime.core.outputs import unused_names
from recipe_runtime.modalities import declared
from recipe_runtime.modalities.reading import stored_array

_MAX_SIDE = 4096

if TYPE_CHECKING:
    from recipe_runtime.frames.shot import Shot


@dataclass(frozen=True)
class PixelDifference:
    """The number of pixels that differ, and the position and values of the first of them, row by row."""

    count: int
    x: int = 0
    y: int = 0
    recorded: str = ""
    rendered: str = ""

    def __str__(self) -> str:
        how = "1 pixel differs:" if self.count == 1 else f"{self.count:,} pixels differ, the first"
        return f"{how} ({self.x}, {self.y}) is {self.recorded} as recorded, {self.rendered} as rendered"


def first_difference(recorded: Path, rendered: Path) -> PixelDifference | None:
    """Compare the pixels of two pictures; None if one cannot be read, or they differ in form, size or type."""
    b = read_pixels(rendered) if recorded.suffix == rendered.suffix else None
    a = None if b is None else read_pixels(recorded, b.shape)
    if a is None or b is None or not _alike(a, b):
        return None
    places = np.argwhere(_differs(a, b))
    if not len(places):
        return PixelDifference(0)
    y, x = (int(v) for v in places[0])
    was, made = (" ".join(str(v) for v in np.atleast_1d(pixels[y, x]).tolist()) for pixels in (a, b))
    return PixelDifference(len(places), x, y, was, made)


def read_pixels(path: Path, shape: tuple[int, ...] = (_MAX_SIDE, _MAX_SIDE)) -> NDArray[Any] | None:
    """Return the pixels of a PNG, `.npy` or `.tif` file; None if it is not one that this project writes.

    The file is not trusted: a link is not followed, and neither its size nor a header makes this take more memory or
    time than a picture needs.

    Args:
        path: the file.
        shape: height and width, which the picture must not exceed.
    """
    height, width = shape[:2]
    try:
        content = read_inside(path.parent, path.name, codecs.largest_file(width, height))
        return stored_array(content, path.suffix[1:], shape)
    except (OSError, ValueError):
        return None


def write_difference(stem: Path, made: Shot, there: Path | None) -> list[Path]:
    """Write `STEM-rendered.png` and, if there is a recorded file, `-recorded.png` and `-difference.png` (red: differs).

    No file is overwritten: if another picture has one of the names, they are `STEM.2-rendered.png` and so on.

    Raises:
        RunError: the folder cannot be written.
    """
    rendered = made.picture()
    pictures = {"rendered": rendered}
    recorded = read_pixels(there, made.pixels.shape) if there else None
    if there and recorded is not None:
        form = declared(made.modality).files.get(there.suffix[1:])
        pixels = made.pixels if form is None else form.store(made.pixels)
        if form is not None and _alike(pixels, recorded):
            faded = (rendered // 3).astype(np.uint8)
            faded[_differs(pixels, recorded)] = (255, 40, 40)
            pictures |= {"recorded": replace(made, pixels=form.load(recorded)).picture(), "difference": faded}
    with host_errors(str(stem.parent), "choose another folder for pictures"):
        bodies = {kind: codecs.png(picture) for kind, picture in pictures.items()}
        files = unused_names(
            lambda suffix: {stem.with_name(f"{stem.name}{suffix}-{k}.png"): body for k, body in bodies.items()}
        )
        for path, body in files.items():
            write_atomic(path, body)
    return list(files)


def _alike(a: NDArray[np.generic], b: NDArray[np.generic]) -> bool:
    return a.shape == b.shape and a.dtype == b.dtype


def _differs(a: NDArray[np.generic], b: NDArray[np.generic]) -> NDArray[np.bool_]:
    different = np.asarray(a != b)
    return np.asarray(different.any(axis=-1)) if different.ndim == 3 else different
