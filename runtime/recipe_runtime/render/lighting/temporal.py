"""Which samples a kernel's threads are for."""

from __future__ import annotations

from typing import Any

from recipe_runtime.render.lighting import temporal_kernels


def every_sample() -> Any:
    """No list: a kernel's threads are for all samples."""
    asked = temporal_kernels.Asked()
    asked.listed, asked.fresh = -1, 0
    return asked


def asked_for(count: Any, listed: Any, fresh: int) -> Any:
    """The samples of a list, and all from `fresh` on."""
    asked = temporal_kernels.Asked()
    asked.listed, asked.fresh, asked.samples = int(count.numpy()[0]), fresh, listed
    return asked


def threads(asked: Any, samples: int) -> int:
    """How many threads a kernel needs for what is asked of so many samples."""
    return samples if asked.listed < 0 else int(asked.listed) + samples - int(asked.fresh)
