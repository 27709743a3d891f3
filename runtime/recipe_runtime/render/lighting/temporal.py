"""Which samples a kernel's threads are for: all of them, or those of a list that a kernel before has made."""

from __future__ import annotations

from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.temporal_kernels import DirtySamples


class SampleList:
    """Memory for a list of samples. One list at a time: it lasts until the next is begun."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._samples = wp.empty(1, dtype=wp.int32, device=device)

    def begin(self, capacity: int) -> tuple[DeviceArray, DeviceArray]:
        """An empty list: its count int32 [1], and room for so many samples, int32 [capacity or more]."""
        if self._samples.size < capacity:
            self._samples = wp.empty(capacity, dtype=wp.int32, device=self._device)
        return wp.zeros(1, dtype=wp.int32, device=self._device), self._samples


def all_samples() -> DirtySamples:
    """The struct `DirtySamples` of no list: every sample is dirty."""
    return set_fields(DirtySamples(), listed=-1, fresh=0)


def listed_samples(count: DeviceArray, samples: DeviceArray, fresh: int) -> DirtySamples:
    """The struct `DirtySamples` of a list, and of all samples from `fresh` on."""
    return set_fields(DirtySamples(), listed=int(count.numpy()[0]), fresh=fresh, samples=samples)


def thread_count(dirty: DirtySamples, samples: int) -> int:
    """How many threads a kernel needs for the dirty ones of so many samples."""
    listed = int(dirty.listed)
    return samples if listed < 0 else listed + samples - int(dirty.fresh)
