"""Which samples a kernel's threads are for."""

from __future__ import annotations

from typing import Any

from recipe_runtime.render.lighting import temporal_kernels


def all_samples() -> Any:
    """No list: a kernel's threads are for all samples."""
    asked = temporal_kernels.DirtySamples()
    asked.listed, asked.fresh = -1, 0
    return asked


def listed_samples(count: Any, listed: Any, fresh: int) -> Any:
    """The samples of a list, and all from `fresh` on."""
    asked = temporal_kernels.DirtySamples()
    asked.listed, asked.fresh, asked.samples = int(count.numpy()[0]), fresh, listed
    return asked


def thread_count(asked: Any, samples: int) -> int:
    """How many threads a kernel needs for what is asked of so many samples."""
    return samples if asked.listed < 0 else int(asked.listed) + samples - int(asked.fresh)
