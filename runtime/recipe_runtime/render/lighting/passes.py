"""The passes from samples to light that the CPU path and RecordedFrame both run, each a launch of one kernel or two.

Arguments: `samples`, `air`, `lamps`, `bodies`, `previous` and `dirty` are one-element arrays of the structs `Samples`,
`Air`, `Lamps`, `Bodies`, `PreviousFrame` and `DirtySamples`, `beams` an array of four `Sunbeam`; `view_from_world` and
`world_from_view` are float32 [1, 12]. `threads` is the number of samples that a pass computes. Outputs come last.
"""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.lighting import (
    fog_glow_kernels,
    reflection_kernels,
    shading_kernels,
    tile_list_kernels,
)
from recipe_runtime.render.lighting.buffers import LightBuffers, RayBuffers, TileLists
from recipe_runtime.render.scene.camera import pinhole_of


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
        lists = {"lamp_lists": self.lists.lamps, "body_lists": self.lists.bodies, "glow_lists": self.lists.glows}
        return fields_of(self, "colours", "patches", "air", "beams", "lamps", "bodies") | lists


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
        **fields_of(out_light, "radiance", "mirror", "reuse_class", "shown", prefix="out_"),
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
        **fields_of(view, "starts", "view_from_world"),
        pinhole=pinhole_of(view.camera, 1),
        previous=previous,
        motion_sums=motion_sums,
        blocks_per_thread=blocks_per_thread,
        **fields_of(out_rays, "reach", "origins", "ways", prefix="out_"),
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
        **fields_of(view, "starts", "view_from_world"),
        pinhole=pinhole_of(view.camera, 1),
        previous=previous,
        dirty=dirty,
        radiance=light.radiance,
        out_sources=out_sources,
        out_shown=light.shown,
    )
