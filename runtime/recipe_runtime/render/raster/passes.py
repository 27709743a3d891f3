"""The passes from vertices to labels that Observer and RecordedFrame both run, and `raster_binned` of the latter.

Arguments: `g` is the geometry of the scene, `transforms` float32 [1 + P, 12] lead from the world and each moving part
to view space, `tiles` int32 [N] are encoded as `label_kernels.pixel_at` reads them, `keys` uint64 [H * rows * W] are
the visibility keys of the samples. Outputs come last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.meshes.mesh import REFERENCE_FOCAL
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import bin_kernels, label_kernels, visibility_kernels
from recipe_runtime.render.raster.distortion import distortion_of
from recipe_runtime.render.scene.camera import pinhole_of
from recipe_runtime.render.scene.chunking import CHUNK
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.scene.pinhole import Pinhole

ACTORS_PER_WORD = 64  # one bit each in a 64-bit word
_FAR_AWAY = 1 << 30  # 1/256 pixels: the bounds of an empty box


class Labels(NamedTuple):
    """The labels of every observation: of a picture's pixels on the device, row by row."""

    depth: DeviceArray  # float32 [H * W], metres along the optical axis
    instance: DeviceArray  # uint16 [H * W]
    semantic: DeviceArray  # uint8 [H * W]

    @staticmethod
    def empty(camera: CameraPlan, device: str) -> Labels:
        """Allocate labels, uninitialised."""
        pixels = camera.width * camera.height
        return Labels(*(wp.empty(pixels, dtype=kind, device=device) for kind in LABEL_TYPES.values()))

    def clone(self) -> Labels:
        """Return a copy."""
        return Labels(*map(wp.clone, self))


LABEL_TYPES = dict(zip(Labels._fields, (wp.float32, wp.uint16, wp.uint8), strict=True))


@dataclass(frozen=True)
class BinBuffers:
    """The list of bins of large triangles; see `bin_kernels`."""

    bins: DeviceArray  # uint64 [capacity]
    count: DeviceArray  # int32 [1]


def empty_extents(g: Geometry, *shape: int) -> np.ndarray[Any, np.dtype[np.int32]]:
    """Return extents without a pixel, int32 [*shape, E, 5]: pixel count, and a box x0, y0, x1, y1.

    The rows are those of `Geometry.part_extent`, the actors' first; one if nothing moves.
    """
    rows = np.zeros((*shape, max(g.extent_rows, 1), 5), np.int32)
    rows[..., 1:3], rows[..., 3:5] = _FAR_AWAY, -_FAR_AWAY
    return rows


def transform_vertices(
    g: Geometry, transforms: DeviceArray, first_vertex: int, out_vertices: DeviceArray, device: str
) -> None:
    """Transform the vertices from `first_vertex` on."""
    if g.vertex_count > first_vertex:
        launch(
            visibility_kernels.transform_vertices,
            g.vertex_count - first_vertex,
            device,
            **fields_of(g, "vertices", "vertex_part", "vertex_skin", "skin_parts", "skin_weights", "part_origins"),
            transforms=transforms,
            first_vertex=first_vertex,
            out_vertices=out_vertices,
        )


def cull_chunks(
    g: Geometry, transforms: DeviceArray, camera: CameraPlan, focal: float, out_visible: DeviceArray, device: str
) -> None:
    """Find the chunks that may be visible; objects have the level of a picture whose focal length is `focal` pixels."""
    if g.chunk_count:
        nearer = REFERENCE_FOCAL / focal
        launch(
            visibility_kernels.cull_chunks,
            g.chunk_count,
            device,
            **fields_of(g, "chunks", "chunk_centres", "chunk_halves", "chunk_level", "levels"),
            nearer=nearer * nearer,
            transforms=transforms,
            pinhole=pinhole_of(camera, 1),
            out_visible=out_visible,
        )


def raster_binned(
    g: Geometry,
    vertices: DeviceArray,
    chunk_visible: DeviceArray,
    first_chunk: int,
    first_actor: int,
    pinhole: Pinhole,
    buffers: BinBuffers,
    out_keys: DeviceArray,
    device: str,
) -> None:
    """Clear and rasterise keys (`first_actor` is -1) or actor bits, large triangles by many threads."""
    out_keys.zero_()
    buffers.count.zero_()
    shared = {
        **fields_of(g, "triangles", "triangle_surface", "surface_actor"),
        "vertices": vertices,
        "first_actor": first_actor,
        "pinhole": pinhole,
        "out_keys": out_keys,
    }
    launch(
        bin_kernels.bin_triangles,
        (g.chunk_count - first_chunk) * CHUNK,
        device,
        chunks=g.chunks,
        chunk_visible=chunk_visible,
        first_chunk=first_chunk,
        out_bins=buffers.bins,
        out_bin_count=buffers.count,
        **shared,
    )
    threads = int(bin_kernels.BIN_GROUPS) * int(bin_kernels.BIN_THREADS)
    launch(bin_kernels.raster_bins, threads, device, bins=buffers.bins, bin_count=buffers.count, **shared)


def label_pixels(
    g: Geometry,
    tiles: DeviceArray,
    keys: DeviceArray,
    camera: CameraPlan,
    out_labels: Labels,
    out_extents: DeviceArray,
    device: str,
) -> None:
    """Label the tiles' pixels, and widen the actors' visible extents by them."""
    if tiles.size:
        launch(
            label_kernels.label_pixels,
            tiles.size * int(label_kernels.TILE_PIXELS),
            device,
            tile_corners=tiles,
            keys=keys,
            **fields_of(g, "triangle_surface", "surface_actor", "surface_instance", "surface_tag"),
            pinhole=pinhole_of(camera, 1),
            **fields_of(out_labels, *Labels._fields, prefix="out_"),
            out_extents=out_extents,
        )


def count_amodal(
    g: Geometry,
    tiles: DeviceArray,
    bits: DeviceArray,
    first_actor: int,
    camera: CameraPlan,
    out_extents: DeviceArray,
    device: str,
) -> None:
    """Widen the amodal extents of up to 64 actors by the tiles' pixels in which their bits are set."""
    launch(
        label_kernels.count_amodal,
        tiles.size * int(label_kernels.TILE_PIXELS),
        device,
        tile_corners=tiles,
        bits=bits,
        pinhole=pinhole_of(camera, 1),
        first_actor=first_actor,
        actor_count=min(ACTORS_PER_WORD, len(g.actors) - first_actor),
        out_extents=out_extents,
    )


def project_boxes(
    g: Geometry,
    vertices: DeviceArray,
    chunk_visible: DeviceArray,
    camera: CameraPlan,
    out_extents: DeviceArray,
    out_reach: DeviceArray,
    device: str,
) -> None:
    """Widen the moving bodies' unclipped boxes, and those of the points where the near plane cuts them.

    Both are in 1/256 pixels.
    """
    if g.chunk_count > g.static_chunks:
        launch(
            label_kernels.project_boxes,
            (g.chunk_count - g.static_chunks) * CHUNK,
            device,
            vertices=vertices,
            **fields_of(g, "triangles", "chunks", "part_extent"),
            chunk_visible=chunk_visible,
            first_chunk=g.static_chunks,
            pinhole=pinhole_of(camera, 1),
            distortion=distortion_of(camera),
            out_extents=out_extents,
            out_reach=out_reach,
        )
