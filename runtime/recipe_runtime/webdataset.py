"""Decoder for the WebDataset shards that `recipe export` writes, for use in a `webdataset` pipeline.

    webdataset.WebDataset(shards).decode(recipe_runtime.webdataset.decode)

webdataset's own picture decoders convert to 8 bits: they turn the 16-bit instance pictures into 0 and 255. This one
returns the values of the dataset's files. It does not import webdataset, and can be pickled for DataLoader workers.
"""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.plan_types import MAX_PIXELS_A_SIDE

from recipe_runtime.core import documents
from recipe_runtime.core.codecs import metres_from_carla


def decode(key: str, data: bytes) -> Any:
    """The value of one file of a sample, by its key, such as `.instance.png`.

    Args:
        key: The file's ending, from the first dot of its name.
        data: The file's bytes.

    Returns:
        rgb.png: uint8 [H, W, 3], sRGB. instance.png: uint16 [H, W], CARLA tag * 1000 + number; 0 for town and sky.
        semantic.png: uint8 [H, W], CARLA tags. depth.png and depth.npy: float32 [H, W], metres along the optical axis;
        a PNG's are within half a step (0.03 mm) and end at 1000. json: variant, sensor, fps, frame, and objects. None
        for any other file, which webdataset then leaves to its other decoders.

    Raises:
        ValueError: The file is damaged, or its content does not match its name.
    """
    name, _, ending = key.lstrip(".").rpartition(".")
    if not name and ending == "json":
        return _document(key, data)
    if ending == "npy" and name == "depth":
        return _metres(data)
    if ending != "png" or name not in MODALITIES:
        return None
    pixels = _pixels(key, data)
    kind, axes = {"instance": ("uint16", 2), "semantic": ("uint8", 2)}.get(name, ("uint8", 3))
    if pixels.dtype.name != kind or pixels.ndim != axes or (axes == 3 and pixels.shape[2] != 3):
        raise ValueError(f"{key}: a picture of {pixels.dtype} {pixels.shape} is not one of this project")
    return metres_from_carla(pixels).astype(np.float32) if name == "depth" else pixels


def _document(key: str, data: bytes) -> Any:
    try:
        return documents.decode(data, dict[str, object])
    except ValueError as error:
        raise ValueError(f"{key}: is not the record of a frame: {error}") from None


def _pixels(key: str, data: bytes) -> NDArray[Any]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's about large pictures, which are refused below
            with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:  # reads the headers only
                width, height = picture.size
                if picture.mode == "P":
                    raise ValueError("it has a palette")
                if max(width, height) <= MAX_PIXELS_A_SIDE:
                    return np.array(picture)
    except Exception as error:  # Pillow raises errors of many types for damaged files
        raise ValueError(f"{key}: cannot be decoded: {error}") from None
    raise ValueError(f"{key}: a picture of {width} x {height} pixels is larger than {MAX_PIXELS_A_SIDE} a side")


def _metres(data: bytes) -> NDArray[np.float32]:
    try:
        metres: NDArray[np.float32] = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # so does NumPy
        raise ValueError(f".depth.npy: cannot be decoded: {error}") from None
    if not isinstance(metres, np.ndarray) or metres.dtype != np.float32 or metres.ndim != 2:
        raise ValueError(".depth.npy: is not a picture of float32 metres")
    if not np.isfinite(metres).all():
        raise ValueError(".depth.npy: has values that are not finite")
    return metres
