"""Distance along the optical axis, float32 [H, W] in metres; the camera's far limit for the sky."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.modalities import form_of
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import codecs
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.modalities.colormaps import logarithmic_grey
from recipe_runtime.modalities.modality import Array, FileForm, Modality, Screen

NAME = "depth"
_CARLA_FAR = 1000.0  # metres; CARLA's depth pictures end there
_STEPS = float((1 << 24) - 1)
_METRES = _CARLA_FAR / _STEPS  # of one step
_NEAR, _FAR = 1.0, 200.0  # metres; range of the picture for people


def _seen(observed: Observed) -> Array:
    return observed.depth


def _float32(metres: Array) -> NDArray[np.float32]:
    return metres.astype(np.float32, copy=False)


def to_carla(metres: Array) -> NDArray[np.uint8]:
    """Convert metres [H, W] to CARLA's 24-bit depth [H, W, 3]: round(d / 1000 * (2^24 - 1)), R the lowest byte.

    Distances are clipped to 1000 m. The sky is at the camera's far limit, so at 1000 m if that is no nearer.
    """
    steps = _float32(metres).astype(np.float64)  # in place: at this size allocation costs as much as the arithmetic
    np.clip(steps, 0.0, _CARLA_FAR, out=steps)
    np.divide(steps, _CARLA_FAR, out=steps)
    np.multiply(steps, _STEPS, out=steps)
    np.rint(steps, out=steps)
    parts = steps.astype("<u4").view(np.uint8).reshape(*metres.shape, 4)
    pixels = np.empty((*metres.shape, 3), np.uint8)
    for channel in range(3):
        pixels[..., channel] = parts[..., channel]
    return pixels


def from_carla(pixels: Array) -> NDArray[np.float32]:
    """The inverse of `to_carla`, within half a step of 1000 / (2^24 - 1) m."""
    steps = pixels[..., 0].astype(np.int64) + (pixels[..., 1].astype(np.int64) << 8)
    steps += pixels[..., 2].astype(np.int64) << 16
    metres: NDArray[np.float64] = _CARLA_FAR * steps.astype(np.float64) / _STEPS
    return metres.astype(np.float32)


def _tiff(metres: Array) -> bytes:
    return codecs.tiff(_float32(metres))


def _picture(metres: Array) -> NDArray[np.uint8]:
    """Map depth [H, W] in metres logarithmically to grey: white at 1 m, black from 200 m on."""
    return logarithmic_grey(np.nan_to_num(_float32(metres)), _NEAR, _FAR)


_CARD = {
    "carla": "PNG in CARLA's 24-bit form: metres = 1000 * (R + 256 G + 65536 B) / 16777215, at most 1000 m. Within "
    "0.03 mm of the float32 metres that are hashed.",
    "npy": "`.npy`, float32 metres: the values that are hashed. With kwcoco, the same as TIFF beside each.",
}


def _card(dataset: DatasetPlan) -> str:
    """Return the line on depth and sky."""
    sensors = [sensor for variant in dataset.variants for sensor in variant.rig.sensors if NAME in sensor.capture]
    form = form_of(NAME, dataset.forms).name
    limit = _CARLA_FAR if form == "carla" else math.inf
    sky = sorted({min(sensor.camera.far, limit) for sensor in sensors})
    where = f"The sky is at {sky[0]:g} m" if len(sky) == 1 else "The sky is at the far limit of the camera"
    at_most = f", at most {_CARLA_FAR:g} m" if len(sky) > 1 and limit in sky else ""
    return f"- depth: {_CARD[form]} {where}{at_most}."


MODALITY = Modality(
    name=NAME,
    dtype="float32",
    files={
        "png": FileForm(
            "uint8", "depth_low|depth_middle|depth_high", store=to_carla, load=from_carla, tolerance=6.1e-5
        ),
        "npy": FileForm("float32", "depth", codecs.npy, store=_float32),
        "tif": FileForm("float32", "depth", _tiff, store=_float32),
    },
    picture=_picture,
    screen=Screen("value", weights=(_METRES, 256 * _METRES, 65536 * _METRES), unit="m"),
    card=_card,
    seen=_seen,
)
