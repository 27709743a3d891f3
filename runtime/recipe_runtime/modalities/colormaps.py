"""Colour maps that use libm: for pictures that no digest covers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def logarithmic_grey(values: NDArray[np.float32], low: float, high: float) -> NDArray[np.uint8]:
    """Map values [H, W] logarithmically to grey, uint8 [H, W, 3]: white up to `low`, black from `high` on."""
    share = np.log(np.clip(values, low, high) / low) / np.log(high / low)
    grey = (255.0 * (1.0 - share)).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=-1)
