"""The passes from samples to light, each a launch of one kernel. ShadingPass and RecordedFrame both run these.

Arguments: `samples`, `air`, `lamps`, `bodies`, `previous` and `dirty` are one-element arrays of the structs `Samples`,
`Air`, `Lamps`, `Bodies`, `PreviousFrame` and `DirtySamples`, `beams` an array of four `Sunbeam`; `view_from_world` and
`world_from_view` are float32 [1, 12]. `threads` is the number of samples that a pass computes. Outputs come last.
"""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.lighting import (
    fog_glow_kernels,
    reflection_kernels,
    reflection_reuse_kernels,
    shading_kernels,
    temporal_kernels,
    tile_list_kernels,
)
from recipe_runtime.render.lighting.buffers import LightBuffers, RayBuffers, TileLists
from recipe_runtime.render.scene.camera import pinhole_of
from recipe_runtime.render.shadows import shadow_kernels


@dataclass(frozen=True)
class ShadingInputs:
    """The inputs of shading for one appearance, each a struct array on the device."""

    colours: DeviceArray  # SurfaceColours
    patches: DeviceArray  # PatchArrays
    air: DeviceArray
    beams: DeviceArray
    lamps: DeviceArray
    bodies: DeviceArray
    lists: TileLists

    def arguments(self) -> dict[str, DeviceArray]:
        """Return them under the names that kernels give them."""
        names = "colours", "patches", "air", "beams", "lamps", "bodies"
        lists = {"lamp_lists": self.lists.lamps, "body_lists": self.lists.bodies, "glow_lists": self.lists.glows}
        return {name: getattr(self, name) for name in names} | lists


@dataclass(frozen=True)
class ReflectionView:
    """The inputs of reflection: depth float32 [H * W], each pixel's first sample int32 [H * W], the camera."""

    camera: CameraPlan
    depth: DeviceArray
    starts: DeviceArray
    view_from_world: DeviceArray


def list_lights(
    keys: DeviceArray,
    camera: CameraPlan,
    world_from_view: DeviceArray,
    view_from_world: DeviceArray,
    lamps: DeviceArray,
    bodies: DeviceArray,
    out_lists: TileLists,
    device: str,
) -> None:
    """List the lamps, bodies and glows that affect each tile."""
    launch(
        tile_list_kernels.cull_lights,
        out_lists.tiles,
        device,
        keys=keys,
        pinhole=pinhole_of(camera, 1),
        world_from_view=world_from_view,
        lamps=lamps,
        bodies=bodies,
        out_lamp_lists=out_lists.lamps,
        out_body_lists=out_lists.bodies,
    )
    launch(
        fog_glow_kernels.cull_glows,
        out_lists.tiles,
        device,
        pinhole=pinhole_of(camera, 1),
        view_from_world=view_from_world,
        lamps=lamps,
        out_lists=out_lists.glows,
    )


def compare_tiles(
    lamps: DeviceArray,
    lists_before: TileLists,
    lists: TileLists,
    boxes: tuple[DeviceArray, DeviceArray],
    beams: DeviceArray,
    needed: int,
    out_bits: DeviceArray,
    device: str,
) -> None:
    """Find the tiles whose static light cannot have changed: see `compare_lists` and `mark_unshadowed` for the bits."""
    launch(
        tile_list_kernels.compare_lists,
        lists.tiles,
        device,
        lamps=lamps,
        lamps_before=lists_before.lamps,
        bodies_before=lists_before.bodies,
        glows_before=lists_before.glows,
        lamp_lists=lists.lamps,
        body_lists=lists.bodies,
        glow_lists=lists.glows,
        lows=boxes[0],
        highs=boxes[1],
        out_bits=out_bits,
    )
    launch(
        shadow_kernels.mark_unshadowed,
        lists.tiles,
        device,
        lows=boxes[0],
        highs=boxes[1],
        beams=beams,
        needed_bits=needed,
        out_bits=out_bits,
    )


def collect_dirty(
    firsts: DeviceArray,
    air: DeviceArray,
    previous: DeviceArray,
    reuse_class: DeviceArray,
    out_quiet: DeviceArray,
    out_count: DeviceArray,
    out_samples: DeviceArray,
    device: str,
) -> None:
    """List the static samples whose light may have changed."""
    launch(
        temporal_kernels.collect_dirty,
        firsts.size - 1,
        device,
        firsts=firsts,
        air=air,
        previous=previous,
        reuse_class=reuse_class,
        out_quiet=out_quiet,
        out_count=out_count,
        out_samples=out_samples,
    )


def shade_samples(
    threads: int,
    samples: DeviceArray,
    lights: ShadingInputs,
    previous: DeviceArray,
    dirty: DeviceArray,
    out_light: LightBuffers,
    device: str,
) -> None:
    """Shade the dirty samples."""
    launch(
        shading_kernels.shade_samples,
        threads,
        device,
        samples=samples,
        **lights.arguments(),
        previous=previous,
        dirty=dirty,
        out_radiance=out_light.radiance,
        out_mirror=out_light.mirror,
        out_reuse_class=out_light.reuse_class,
        out_shown=out_light.shown,
    )


def trace_rays(
    samples: DeviceArray,
    mirror: DeviceArray,
    view: ReflectionView,
    previous: DeviceArray,
    motion_sums: DeviceArray,
    out_rays: RayBuffers,
    device: str,
) -> None:
    """Trace the reflected ray of each block of 2 x 2 pixels."""
    rows, columns = -(-view.camera.height // 2), -(-view.camera.width // 2)
    blocks_per_thread = columns if device == "cpu" else 1  # a GPU has threads to spare
    launch(
        reflection_kernels.trace_rays,
        rows * -(-columns // blocks_per_thread),
        device,
        samples=samples,
        mirror=mirror,
        depth=view.depth,
        starts=view.starts,
        view_from_world=view.view_from_world,
        pinhole=pinhole_of(view.camera, 1),
        previous=previous,
        motion_sums=motion_sums,
        blocks_per_thread=blocks_per_thread,
        out_reach=out_rays.reach,
        out_origins=out_rays.origins,
        out_ways=out_rays.ways,
    )


def collect_reflective(
    samples: DeviceArray, mirror: DeviceArray, count: int, out_count: DeviceArray, out_samples: DeviceArray, device: str
) -> None:
    """List those of the first `count` samples that reflect anything."""
    launch(
        reflection_reuse_kernels.collect_reflective,
        count,
        device,
        samples=samples,
        mirror=mirror,
        out_count=out_count,
        out_samples=out_samples,
    )


def stale_reflections(
    samples: DeviceArray,
    air: DeviceArray,
    previous: DeviceArray,
    reflective: DeviceArray,
    previous_ring_step: int,
    sources: DeviceArray,
    out_count: DeviceArray,
    out_samples: DeviceArray,
    device: str,
) -> None:
    """List those of the reflective samples whose reflection may have changed."""
    launch(
        reflection_reuse_kernels.stale_reflections,
        reflective.size,
        device,
        samples=samples,
        air=air,
        previous=previous,
        reflective=reflective,
        previous_ring_step=previous_ring_step,
        sources=sources,
        out_count=out_count,
        out_samples=out_samples,
    )


def reflect(
    threads: int,
    samples: DeviceArray,
    air: DeviceArray,
    view: ReflectionView,
    rays: RayBuffers,
    previous: DeviceArray,
    dirty: DeviceArray,
    light: LightBuffers,
    out_sources: DeviceArray,
    device: str,
) -> None:
    """Add the reflection on wet ground to `light.shown`."""
    launch(
        reflection_kernels.reflect,
        threads,
        device,
        samples=samples,
        air=air,
        mirror=light.mirror,
        reach=rays.reach,
        depth=view.depth,
        starts=view.starts,
        view_from_world=view.view_from_world,
        pinhole=pinhole_of(view.camera, 1),
        previous=previous,
        dirty=dirty,
        radiance=light.radiance,
        out_sources=out_sources,
        out_shown=light.shown,
    )
