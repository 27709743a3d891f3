"""The modalities of a frame, as arrays with a digest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest_array

from recipe_runtime.core.interfaces import Observed


def pixel_digest(modality: str, array: NDArray[np.generic]) -> str:
    """Identity of a frame's pixels; depth is hashed as float32 metres, whatever form it has on disk."""
    return digest_array(f"pixels/{modality}/1", array)


def label_array(seen: Observed, modality: str) -> NDArray[np.generic]:
    """A label modality of an observation."""
    array: NDArray[np.generic] = getattr(seen, modality)
    return array
