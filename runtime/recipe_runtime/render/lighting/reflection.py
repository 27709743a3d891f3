"""Reflection on wet ground, host side: which rays are traced again, and which samples reflect something else."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting import passes
from recipe_runtime.render.lighting.reflection_reuse_kernels import collect_reflective, stale_reflections
from recipe_runtime.render.lighting.sample_light import SampleLight
from recipe_runtime.render.lighting.temporal import SampleList, all_samples, listed_samples, thread_count
from recipe_runtime.render.lighting.temporal_kernels import DirtySamples, PreviousFrame
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.sampling.sampler import FrameSamples
from recipe_runtime.render.scene.camera import upload_transforms, view_from_parts


class ReflectionPass:
    """Adds the reflection on wet ground to the light of a frame's samples."""

    def __init__(self, device: str, reuse: TemporalReuse, sample_list: SampleList) -> None:
        self._device, self._reuse, self._list = device, reuse.reflections, sample_list
        self._motion_sums: WeakKeyDictionary[Observation, DeviceArray] = WeakKeyDictionary()

    def reflect(
        self,
        obs: Observation,
        points: FrameSamples,
        samples: DeviceArray,
        air: DeviceArray,
        previous: DeviceArray,
        shared_count: int,
        found: SampleLight,
    ) -> None:
        """Write `found.light.shown`: the radiance with the reflection on wet ground.

        Args:
            obs: The frame's observation.
            points: Its samples.
            samples: The samples, a one-element array of `Samples`.
            air: The light and weather, a one-element array of `Air`.
            previous: What changed since the earlier frame, a one-element array of `PreviousFrame`.
            shared_count: Samples below this index are those of the earlier frame.
            found: The light of the samples.
        """
        view_from_world = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
        view = passes.ReflectionView(obs.camera, obs.device_depth, points.starts, view_from_world)
        rays_previous = previous if self._reuse else struct_array([PreviousFrame()], self._device)
        sums = self._sums(obs)
        passes.trace_rays(samples, found.light.mirror, view, rays_previous, sums, found.rays, self._device)
        dirty = self._stale(samples, air, previous, found) if shared_count and self._reuse else all_samples()
        threads, dirty_record = thread_count(dirty, points.count), struct_array([dirty], self._device)
        passes.reflect(
            threads, samples, air, view, found.rays, previous, dirty_record, found.light, found.sources, self._device
        )

    def _stale(self, samples: DeviceArray, air: DeviceArray, previous: DeviceArray, found: SampleLight) -> DirtySamples:
        """Return the samples whose reflection may have changed since the earlier frame."""
        if found.reflective is None:
            count, listed = self._list.begin(found.kept)
            out = {"out_count": count, "out_samples": listed}
            launch(collect_reflective, found.kept, self._device, samples=samples, mirror=found.light.mirror, **out)
            found.reflective = wp.clone(listed[: int(count.numpy()[0])])
        count, listed = self._list.begin(found.kept)
        launch(
            stale_reflections,
            found.reflective.size,
            self._device,
            samples=samples,
            air=air,
            previous=previous,
            reflective=found.reflective,
            previous_ring_step=found.ring_step,
            sources=found.sources,
            out_count=count,
            out_samples=listed,
        )
        return listed_samples(count, listed, found.kept)

    def _sums(self, obs: Observation) -> DeviceArray:
        """Return the summed-area table, int32 [rows + 1, columns + 1], of the tiles that moving objects may affect."""
        if obs not in self._motion_sums:
            tile = int(TILE)
            counts = np.zeros((-(-obs.camera.height // tile) + 1, -(-obs.camera.width // tile) + 1), np.int32)
            counts[(obs.touched >> 16) // tile + 1, (obs.touched & 65535) // tile + 1] = 1
            sums = counts.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
            self._motion_sums[obs] = wp.array(sums, dtype=wp.int32, device=self._device)
        return self._motion_sums[obs]
