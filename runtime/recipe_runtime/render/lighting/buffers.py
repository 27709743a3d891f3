"""The arrays that lighting writes, by sample, by tile and by block of 2 x 2 pixels."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.tile_list_kernels import MAX_PER_TILE, STATIC_LAMPS


@dataclass(frozen=True)
class LightBuffers:
    """Light by sample, for `capacity` samples."""

    radiance: DeviceArray  # vec3f, without the reflection on wet ground
    mirror: DeviceArray  # vec2f, share and gloss of mirror reflection
    reuse_class: DeviceArray  # uint8, what the radiance depends on: a constant of `temporal_kernels`
    shown: DeviceArray  # vec3f, with the reflection on wet ground; `radiance` itself if nothing is wet

    @staticmethod
    def empty(capacity: int, wet: bool, device: str) -> LightBuffers:
        """Allocate buffers, uninitialised."""
        radiance = wp.empty(capacity, dtype=wp.vec3f, device=device)
        return LightBuffers(
            radiance,
            wp.empty(capacity, dtype=wp.vec2f, device=device),
            wp.empty(capacity, dtype=wp.uint8, device=device),
            wp.empty(capacity, dtype=wp.vec3f, device=device) if wet else radiance,
        )


@dataclass(frozen=True)
class RayBuffers:
    """Reflected rays, one for each block of 2 x 2 pixels."""

    reach: DeviceArray  # float32, metres to the hit, -1 for none
    origins: DeviceArray  # int32, sample whose ray is cached, -1: none, -2: the block reflects nothing
    ways: DeviceArray  # uint32, tiles that the ray crosses, as `packed_tiles`

    @staticmethod
    def empty(camera: CameraPlan, device: str) -> RayBuffers:
        """Allocate buffers in which no ray is cached."""
        blocks = -(-camera.width // 2) * -(-camera.height // 2)
        return RayBuffers(
            wp.empty(blocks, dtype=wp.float32, device=device),
            wp.full(blocks, -1, dtype=wp.int32, device=device),
            wp.empty(blocks, dtype=wp.uint32, device=device),
        )


@dataclass(frozen=True)
class TileLists:
    """What affects each tile, int32 [tiles, 1 + maximum]; the first entry of a row is the count."""

    lamps: DeviceArray  # with one more column, `STATIC_LAMPS`
    bodies: DeviceArray
    glows: DeviceArray

    @staticmethod
    def empty(tiles: int, device: str) -> TileLists:
        """Allocate empty lists."""
        columns = int(STATIC_LAMPS) + 1, int(MAX_PER_TILE) + 1, int(MAX_PER_TILE) + 1
        return TileLists(*(wp.zeros((tiles, size), dtype=wp.int32, device=device) for size in columns))

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return int(self.lamps.shape[0])


@dataclass(frozen=True)
class StaticLampLight:
    """The light of static lamps on cached samples; without lamps, of one sample. See `PreviousFrame`."""

    light: DeviceArray  # vec3f
    shine: DeviceArray  # vec3f
    known: DeviceArray  # uint8

    @staticmethod
    def empty(samples: int, device: str) -> StaticLampLight:
        """Allocate the light of cached samples, none of it known."""
        light, shine = (wp.empty(samples, dtype=wp.vec3f, device=device) for _ in range(2))
        return StaticLampLight(light, shine, wp.zeros(samples, dtype=wp.uint8, device=device))


@dataclass(frozen=True)
class PixelLevels:
    """Developed pixels that later frames may reuse."""

    stale: DeviceArray  # uint8 [H * W], not 0 where the light has changed since the pixel was developed
    levels: DeviceArray  # vec3f [H * W], before the noise

    @staticmethod
    def empty(pixels: int, device: str) -> PixelLevels:
        """Allocate levels, all stale."""
        stale = wp.full(pixels, 1, dtype=wp.uint8, device=device)
        return PixelLevels(stale, wp.empty(pixels, dtype=wp.vec3f, device=device))
