"""The light of one appearance on a frame's samples, and what later frames need to reuse it."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.buffers import LightBuffers, PixelLevels, RayBuffers, StaticLampLight, TileLists


@dataclass(eq=False)
class SampleLight:
    """One appearance's light on the samples of a frame; a later frame from the same pose overwrites it in place."""

    light: LightBuffers
    rays: RayBuffers
    pixels: PixelLevels
    lamps: StaticLampLight
    lists: TileLists
    clouds: tuple[float, float]  # the earlier frame's `Air.drift`
    cloud_shadows: tuple[float, float]  # the frame's `Air.shadow_drift`; light below other shadows is not reused
    kept: int  # samples below this index are cached for later frames
    sources: DeviceArray  # vec2i by kept sample, as `reflection_kernels.reflect` writes them
    quiet: DeviceArray  # uint8 by tile, as `temporal_kernels.collect_dirty` writes it
    leaf_step: int = 0  # `Air.leaf_step` of the frame
    ring_step: int = -1  # `Air.ring_step` of the frame
    # int32, the list of `collect_reflective`; it depends on materials only, so it is valid for all frames
    reflective: DeviceArray | None = None

    @staticmethod
    def empty(
        camera: CameraPlan,
        capacity: int,
        kept: int,
        lists: TileLists,
        clouds: tuple[float, float],
        cloud_shadows: tuple[float, float],
        wet: bool,
        night: bool,
        device: str,
    ) -> SampleLight:
        """Allocate the light of `capacity` samples, of which the first `kept` are cached for later frames."""
        return SampleLight(
            light=LightBuffers.empty(capacity, wet, device),
            rays=RayBuffers.empty(camera, device),
            pixels=PixelLevels.empty(camera.width * camera.height if kept else 1, device),
            lamps=StaticLampLight.empty(kept if kept and night else 1, device),
            lists=lists,
            clouds=clouds,
            cloud_shadows=cloud_shadows,
            kept=kept,
            sources=wp.full(max(kept, 1) if wet else 1, wp.vec2i(-2, -1), dtype=wp.vec2i, device=device),
            quiet=wp.zeros(lists.tiles, dtype=wp.uint8, device=device),
        )
