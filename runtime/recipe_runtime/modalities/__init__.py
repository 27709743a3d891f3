"""The modalities: one module each, found by the names in the registry `recipe_compiler.ir.modalities`."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib import import_module

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest_array

from recipe_runtime.core.interfaces import LabelPass, Observed
from recipe_runtime.modalities.modality import Modality


@cache
def declared(name: str) -> Modality:
    """Return the modality of a name in the registry."""
    found: Modality = import_module(f"{__name__}.{name}").MODALITY
    return found


def pixel_digest(name: str, array: NDArray[np.generic]) -> str:
    """Identity of a frame's pixels; an array is hashed as it is rendered, whatever form it has on disk."""
    return digest_array(f"pixels/{name}/1", array)


def label_array(seen: Observed, name: str) -> NDArray[np.generic]:
    """Return a label modality of an observation."""
    return declared(name).label(seen)


def label_passes(names: Iterable[str]) -> tuple[LabelPass, ...]:
    """Return the passes that compute those of the modalities that not every observation has."""
    return tuple(found for name in names if (found := declared(name).label_pass) is not None)
