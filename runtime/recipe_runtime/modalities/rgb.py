"""The picture of the camera. It depends on the appearance: `frames` renders it, not the observation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.core import codecs
from recipe_runtime.modalities.modality import Array, FileForm, Modality


def _photograph(stored: Array) -> bytes:
    return codecs.photograph(stored.astype(np.uint8, copy=False))


def _picture(pixels: Array) -> NDArray[np.uint8]:
    return pixels.astype(np.uint8, copy=False)


MODALITY = Modality(
    name="rgb",
    dtype="uint8",
    channels=3,
    files={"png": FileForm("uint8", "red|green|blue", _photograph)},
    picture=_picture,
)
