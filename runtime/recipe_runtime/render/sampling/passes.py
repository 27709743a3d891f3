"""The passes from keys to samples that Sampler and RecordedFrame both run, and `assign_slots` of the latter.

Arguments: `tiles` int32 [N] are indices of tiles, `coarse` and `fine` are the keys of pixels and of their samples,
`scene` is a one-element array of `SceneArrays`; `groups` and `starts` int32 [H * W] are, by pixel, how its samples
group and the index of its first one. `rows` is ROWS with antialiasing and 1 without. Outputs come last.
"""

from __future__ import annotations

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.raster.label_kernels import TILE_PIXELS
from recipe_runtime.render.sampling import sample_kernels, slot_kernels
from recipe_runtime.render.sampling.buffers import EVALUATED, SampleColumns
from recipe_runtime.render.scene.camera import pinhole_of


def count_samples(
    tiles: DeviceArray,
    coarse: DeviceArray,
    fine: DeviceArray,
    camera: CameraPlan,
    rows: int,
    scene: DeviceArray,
    static_samples: DeviceArray,
    out_groups: DeviceArray,
    out_starts: DeviceArray,
    out_counts: DeviceArray,
    device: str,
) -> None:
    """Count the new samples of each of the tiles' pixels, and group its coverage."""
    if tiles.size:
        span = _pixels_per_thread(device)
        launch(
            sample_kernels.count_samples,
            tiles.size * int(TILE_PIXELS) // span,
            device,
            tile_corners=tiles,
            coarse=coarse,
            fine=fine,
            pinhole=pinhole_of(camera, rows),
            scene=scene,
            static_samples=static_samples,
            pixels_per_thread=span,
            out_groups=out_groups,
            out_starts=out_starts,
            out_counts=out_counts,
        )


def _pixels_per_thread(device: str) -> int:
    """Return a tile's pixels on a CPU, where starting a thread takes longer than such a pixel, and 1 on a GPU."""
    return int(TILE_PIXELS) if device == "cpu" else 1


def assign_slots(
    tiles: DeviceArray,
    camera: CameraPlan,
    rows: int,
    capacity: int,
    counts: DeviceArray,
    wanted: DeviceArray,
    stretches: DeviceArray,
    out_cursor: DeviceArray,
    out_firsts: DeviceArray,
    device: str,
) -> None:
    """Assign the slots of every pixel's samples without reading a count back; see `slot_kernels`.

    `wanted` and `stretches` int32 by tile are scratch space. `out_cursor` counts the requested slots at edges; a pixel
    without room loses its samples (`counts` becomes 0), and the frame must be redrawn.
    """
    size = tiles.size * int(TILE_PIXELS)
    wanted.zero_()
    out_cursor.zero_()
    launch(slot_kernels.rank_in_tile, size, device, counts=counts, out_firsts=out_firsts, out_wanted=wanted)
    launch(
        slot_kernels.reserve_slots,
        tiles.size,
        device,
        wanted=wanted,
        out_stretches=stretches,
        out_cursor=out_cursor,
    )
    launch(
        slot_kernels.assign_slots,
        size,
        device,
        tile_corners=tiles,
        pinhole=pinhole_of(camera, rows),
        stretches=stretches,
        capacity=capacity,
        out_counts=counts,
        out_firsts=out_firsts,
    )


def emit_samples(
    tiles: DeviceArray,
    coarse: DeviceArray,
    fine: DeviceArray,
    counts: DeviceArray,
    firsts: DeviceArray,
    camera: CameraPlan,
    rows: int,
    scene: DeviceArray,
    groups: DeviceArray,
    out_starts: DeviceArray,
    out_columns: SampleColumns,
    device: str,
) -> None:
    """Write key, pixel, place, weight and tile of every new sample."""
    span = _pixels_per_thread(device)
    launch(
        sample_kernels.emit_samples,
        tiles.size * int(TILE_PIXELS) // span,
        device,
        tile_corners=tiles,
        coarse=coarse,
        fine=fine,
        counts=counts,
        firsts=firsts,
        pinhole=pinhole_of(camera, rows),
        scene=scene,
        groups=groups,
        pixels_per_thread=span,
        out_starts=out_starts,
        **fields_of(out_columns, "keys", "pixels", "places", "weights", "tiles", prefix="out_"),
    )


def evaluate_samples(
    first_sample: int, count: int, camera: CameraPlan, scene: DeviceArray, columns: SampleColumns, device: str
) -> None:
    """Evaluate surface, position, normal and pattern of `count` samples from `first_sample` on."""
    if count:
        launch(
            sample_kernels.evaluate_samples,
            count,
            device,
            first_sample=first_sample,
            pinhole=pinhole_of(camera, 1),
            scene=scene,
            **fields_of(columns, "keys", "pixels", "places"),
            **fields_of(columns, *EVALUATED, prefix="out_"),
        )
