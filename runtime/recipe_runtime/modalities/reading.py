"""Reads the arrays that files of modalities store. The files are not trusted."""

from __future__ import annotations

import io
import warnings

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.plan_types import MAX_PIXELS_A_SIDE

from recipe_runtime.core import codecs

_MODES = ("RGB", "L", "I;16")  # the modes in which Pillow opens what `codecs.png` writes, except 16-bit RGB
_LARGEST = MAX_PIXELS_A_SIDE, MAX_PIXELS_A_SIDE


def stored_array(content: bytes, ending: str, shape: tuple[int, ...] = _LARGEST) -> NDArray[np.generic]:
    """Return the array that a PNG, `.npy` or TIFF file of this project stores.

    Args:
        content: The file. Neither its length nor its headers make this take more memory than a picture needs.
        ending: `png`, `npy` or `tif`.
        shape: The largest height and width.

    Raises:
        ValueError: The file is damaged, larger, or not one that this project writes.
    """
    height, width = shape[:2]
    try:
        if len(content) > codecs.largest_file(width, height):
            raise ValueError(f"it has {len(content):,} bytes")
        if ending == "npy":
            array = np.load(io.BytesIO(content), allow_pickle=False)
        elif ending == "tif":
            array = codecs.metres_of_tiff(content, shape)
        else:
            wide = codecs.wide_rgb(content, shape)
            array = _png(content, width, height) if wide is None else wide
    except Exception as error:  # NumPy and Pillow raise errors of a dozen types for damaged files
        raise ValueError(f"cannot be decoded: {error}") from None
    if not isinstance(array, np.ndarray) or array.ndim not in (2, 3) or array.dtype.kind not in "fu":
        raise ValueError("is not a picture")
    if array.shape[0] > height or array.shape[1] > width:
        raise ValueError(f"is not a picture of at most {width} x {height} pixels")
    return array


def _png(content: bytes, width: int, height: int) -> NDArray[np.generic]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's about large pictures, which are refused below
        with Image.open(io.BytesIO(content), formats=["PNG"]) as picture:  # reads the headers only
            if picture.mode not in _MODES or picture.width > width or picture.height > height:
                raise ValueError(f"a {picture.mode} picture of {picture.width} x {picture.height} pixels")
            return np.array(picture)
