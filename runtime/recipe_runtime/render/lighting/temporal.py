"""The samples that a kernel's threads compute: all of them, or those of a list that an earlier kernel has written."""

from __future__ import annotations

from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.temporal_kernels import DirtySamples


class SampleList:
    """Memory for one list of samples, which is valid until the next list is begun."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._samples = wp.empty(1, dtype=wp.int32, device=device)

    def begin(self, capacity: int) -> tuple[DeviceArray, DeviceArray]:
        """Return an empty list: its count, int32 [1], and its samples, int32 [at least `capacity`]."""
        if self._samples.size < capacity:
            self._samples = wp.empty(capacity, dtype=wp.int32, device=self._device)
        return wp.zeros(1, dtype=wp.int32, device=self._device), self._samples


def all_samples() -> DirtySamples:
    """Return the struct `DirtySamples` of all samples."""
    return set_fields(DirtySamples(), listed=-1, fresh=0)


def listed_samples(count: DeviceArray, samples: DeviceArray, fresh: int) -> DirtySamples:
    """Return the struct `DirtySamples` of a list, and of all samples from index `fresh` on."""
    return set_fields(DirtySamples(), listed=int(count.numpy()[0]), fresh=fresh, samples=samples)


def thread_count(dirty: DirtySamples, samples: int) -> int:
    """Return the number of threads for the dirty ones of `samples` samples."""
    listed = int(dirty.listed)
    return samples if listed < 0 else listed + samples - int(dirty.fresh)
