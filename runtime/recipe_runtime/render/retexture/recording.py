"""The recording of a frame's patched samples: their light, their positions on patches, and reflections of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.camera.camera_pass import ExposedFrame
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.passes import ShadingInputs
from recipe_runtime.render.lighting.shading_kernels import SurfaceLight
from recipe_runtime.render.lighting.temporal_kernels import PreviousFrame
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.retexture.record_kernels import count_points, record_light, record_mirrors, record_points
from recipe_runtime.render.retexture.relight_kernels import PixelSamples, Recorded
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts

Numbers = NDArray[np.int32]
_KINDS: dict[str, Any] = {  # of fields of `Recorded` that kernels write
    "albedo": wp.vec3f,
    "glow": wp.vec3f,
    "light": SurfaceLight,
    "patches": wp.int32,
    "coverages": wp.float32,
    "places": wp.vec4f,
    "codes": wp.uint32,
}


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Slots of wet ground that reflect a patch or are patched; all arrays have one element per slot."""

    slots: Numbers
    shares: NDArray[np.float32]  # weight of the reflection, 0 to 1
    sources: Numbers  # slot whose radiance is reflected; -1: `limits` is the reflected radiance
    limits: NDArray[np.float32]  # [*, 3] maximum of the reflected radiance


@dataclass(frozen=True, eq=False)
class Recording:
    """The patched samples of a frame. The Q pixels that change have N samples, which slots 0 to N - 1 number.

    `recorded` and `listed` are one-element arrays of `Recorded` and `PixelSamples`.
    """

    recorded: DeviceArray
    listed: DeviceArray
    slots: Numbers  # [K] of the patched samples
    firsts: Numbers  # [K + 1] index of each one's first position on a patch
    patches: Numbers  # patch of each position
    mirrors: Mirrors
    radiance: NDArray[np.float32]  # [N, 3] by slot, without reflections in wet ground
    shown: NDArray[np.float32]  # [N, 3] by slot, with them
    pixels: Numbers  # [Q] index in the picture, or in its HDR image
    first_slots: Numbers  # [Q]
    counts: Numbers  # [Q] slots of each pixel
    weights: NDArray[np.float32]  # [N]
    rain: Numbers  # [Q]


def record(obs: Observation, taken: ExposedFrame, inputs: ShadingInputs, device: str) -> Recording:
    """Record the patched samples of a frame.

    Args:
        obs: The observation by the undistorted camera.
        taken: The shaded frame before development.
        inputs: The inputs of its shading.
        device: The Warp device.
    """
    samples = struct_array([taken.points.data], device)
    used, pixel_of = _used_samples(taken)
    counts = wp.empty(max(len(used), 1), dtype=wp.int32, device=device)
    on_device = _numbers(used, device)
    launch(
        count_points, len(used), device, listed=on_device, samples=samples, patches=inputs.patches, out_counts=counts
    )
    covered = counts.numpy()[: len(used)]
    patched = used[covered > 0]
    firsts = np.cumsum([0, *covered[covered > 0]]).astype(np.int32)
    mirrors = _mirrors(obs, taken, inputs, samples, used, patched, device)
    touched = np.zeros(taken.points.count, np.bool_)
    touched[patched] = True
    touched[mirrors.slots] = True
    pixels = np.unique(pixel_of[touched[used]])
    first_samples, groups = taken.points.starts.numpy()[pixels], taken.points.groups.numpy()[pixels] & 7
    kept = _ranges(first_samples, groups)
    slot_of = np.full(taken.points.count, -1, np.int32)
    slot_of[kept] = np.arange(len(kept), dtype=np.int32)
    sources = np.where(mirrors.sources >= 0, slot_of[mirrors.sources], -1)
    mirrors = Mirrors(slot_of[mirrors.slots], mirrors.shares, sources, mirrors.limits)
    recorded = _recorded(taken, inputs, samples, patched, slot_of[patched], firsts, device)
    cover = taken.exposed.cover.numpy()
    rain = cover[pixels] if cover.size > 1 else np.zeros(len(pixels), np.int32)
    first_slots, weights = np.cumsum([0, *groups])[:-1].astype(np.int32), taken.points.weights.numpy()[kept]
    listed = set_fields(
        PixelSamples(),
        **{
            name: _numbers(v, device)
            for name, v in (("pixels", pixels), ("firsts", first_slots), ("counts", groups), ("rain", rain))
        },
        streak=taken.exposed.streak,
        weights=wp.array(weights, dtype=wp.float32, device=device),
    )
    return Recording(
        recorded=struct_array([recorded], device),
        listed=struct_array([listed], device),
        slots=slot_of[patched],
        firsts=firsts,
        patches=recorded.patches.numpy(),
        mirrors=mirrors,
        radiance=taken.found.light.radiance.numpy()[kept],
        shown=taken.found.light.shown.numpy()[kept],
        pixels=pixels.astype(np.int32),
        first_slots=first_slots,
        counts=groups.astype(np.int32),
        weights=weights,
        rain=rain.astype(np.int32),
    )


def _used_samples(taken: ExposedFrame) -> tuple[Numbers, Numbers]:
    """Return the samples that pixels show, and the pixel of each."""
    starts, counts = taken.points.starts.numpy(), taken.points.groups.numpy() & 7
    return _ranges(starts, counts), np.repeat(np.arange(len(starts), dtype=np.int32), counts)


def _ranges(starts: Numbers, counts: Numbers) -> Numbers:
    """Return the concatenation of the ranges start .. start + count - 1."""
    before = np.cumsum(counts) - counts
    numbers: Numbers = (np.repeat(starts - before, counts) + np.arange(int(counts.sum()))).astype(np.int32)
    return numbers


def _numbers(values: Numbers, device: str) -> DeviceArray:
    array: DeviceArray = wp.array(np.ascontiguousarray(values, np.int32), dtype=wp.int32, device=device)
    return array


def _recorded(
    taken: ExposedFrame,
    inputs: ShadingInputs,
    samples: DeviceArray,
    patched: Numbers,
    slots: Numbers,
    firsts: Numbers,
    device: str,
) -> Recorded:
    """Return the light of the patched samples, and their positions on patches."""
    count, points, listed = len(patched), int(firsts[-1]), _numbers(patched, device)
    lit, shown = Recorded(), {"listed": listed, "samples": samples}
    for name in ("albedo", "glow", "light"):
        setattr(lit, name, wp.empty(count, dtype=_KINDS[name], device=device))
    for name in ("patches", "coverages", "places", "codes"):
        setattr(lit, name, wp.empty(points, dtype=_KINDS[name], device=device))
    set_fields(lit, slots=_numbers(slots, device), firsts=_numbers(firsts, device))
    if count:
        out = fields_of(lit, "patches", "coverages", "places", "codes", prefix="out_")
        launch(record_points, count, device, **shown, firsts=lit.firsts, patches=inputs.patches, **out)
        previous, out = (
            struct_array([PreviousFrame()], device),
            fields_of(lit, "albedo", "glow", "light", prefix="out_"),
        )
        launch(record_light, count, device, **shown, **inputs.arguments(), previous=previous, **out)
    return lit


def _mirrors(
    obs: Observation,
    taken: ExposedFrame,
    inputs: ShadingInputs,
    samples: DeviceArray,
    used: Numbers,
    patched: Numbers,
    device: str,
) -> Mirrors:
    """Return the samples of wet ground that are patched or reflect a patched sample, by sample instead of by slot."""
    wet = used[taken.found.light.mirror.numpy()[used, 0] > 0.0] if taken.light.wet else used[:0]
    sources, limits = np.full(len(wet), -1, np.int32), np.zeros((len(wet), 3), np.float32)
    light = taken.found.light
    if len(wet):
        view_from_world = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], device)
        out_sources = wp.empty(len(wet), dtype=wp.int32, device=device)
        out_limits = wp.empty(len(wet), dtype=wp.vec3f, device=device)
        launch(
            record_mirrors,
            len(wet),
            device,
            listed=_numbers(wet, device),
            samples=samples,
            air=inputs.air,
            mirror=light.mirror,
            reach=taken.found.rays.reach,
            depth=obs.device_depth,
            starts=taken.points.starts,
            view_from_world=view_from_world,
            pinhole=pinhole_of(obs.camera, 1),
            out_sources=out_sources,
            out_limits=out_limits,
        )
        sources, limits = out_sources.numpy().copy(), out_limits.numpy().copy()
    is_patched = np.zeros(taken.points.count, np.bool_)
    is_patched[patched] = True
    found = (sources >= 0) & is_patched[sources]
    # Radiance that does not depend on a texture is a constant.
    fixed = (sources >= 0) & ~found
    limits[fixed] = np.minimum(light.radiance.numpy()[sources[fixed]], limits[fixed])
    sources[fixed] = -1
    kept = found | is_patched[wet]
    return Mirrors(wet[kept], light.mirror.numpy()[wet[kept], 0], sources[kept], limits[kept])
