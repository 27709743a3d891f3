"""The light of one appearance on a frame's samples, and what of it later frames may use again."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.buffers import LightBuffers, PixelLevels, RayBuffers, TileLists


@dataclass(eq=False)
class SampleLight:
    """One appearance's light on the samples of a frame. Where any is kept, the next frame's goes into these arrays."""

    light: LightBuffers
    rays: RayBuffers
    pixels: PixelLevels
    lists: TileLists
    clouds: tuple[float, float]  # how far the wind has moved them
    kept: int  # samples whose light stays for later frames
    sources: DeviceArray  # vec2i by kept sample, as `reflection_kernels.reflect` writes them
    quiet: DeviceArray  # uint8 by tile, as `temporal_kernels.collect_dirty` writes it
    leaf_step: int = 0  # the time in which leaves moved
    ring_step: int = -1  # the time of the rings on wet ground
    reflective: DeviceArray | None = (
        None  # int32, what `collect_reflective` lists: it follows from materials, and so stays
    )

    @staticmethod
    def empty(
        camera: CameraPlan,
        capacity: int,
        kept: int,
        lists: TileLists,
        clouds: tuple[float, float],
        wet: bool,
        device: str,
    ) -> SampleLight:
        """Room for the light of so many samples, of which the first `kept` stay for later frames."""
        return SampleLight(
            light=LightBuffers.empty(capacity, wet, device),
            rays=RayBuffers.empty(camera, device),
            pixels=PixelLevels.empty(camera.width * camera.height if kept else 1, device),
            lists=lists,
            clouds=clouds,
            kept=kept,
            sources=wp.full(max(kept, 1) if wet else 1, wp.vec2i(-2, -1), dtype=wp.vec2i, device=device),
            quiet=wp.zeros(lists.tiles, dtype=wp.uint8, device=device),
        )
