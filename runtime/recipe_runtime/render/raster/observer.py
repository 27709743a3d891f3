"""From a pose to an Observation: the host's side of visibility and labels, and the pipeline's first half.

Vertices are moved into the camera's frame, drawn into one buffer of keys, and every label is read off that. What
stands still is drawn and labelled once for a camera that stands still, and then again only in the tiles that something
moving may touch; no appearance has a part in any of it.
"""

from __future__ import annotations

import weakref
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.optics import bends
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.device.timings import Timings
from recipe_runtime.render.raster import label_kernels, visibility_kernels
from recipe_runtime.render.raster.distortion import apply_distortion, distortion_of, plate_of
from recipe_runtime.render.raster.observation import Observation, objects_of
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts
from recipe_runtime.render.scene.geometry import CHUNK, Geometry

_ACTORS_PER_WORD = 64  # actors whose lone silhouettes fit a 64-bit word
_POSE_CACHE_SIZE = 4  # 10 MB each at 800 x 600
_VERTEX_POOL_SIZE = 3  # arrays of vertices kept for a pose


@dataclass(frozen=True)
class _StaticView:
    """What stands still, seen from one pose as if nothing else were there."""

    vertices: Any
    keys: Any
    labels: tuple[Any, Any, Any]  # depth, instance, semantic, row by row
    spare: list[Any] = field(default_factory=list)  # vertices of observations that are gone; what stands still is right

    def give_back(self, vertices: Any) -> None:
        """Keep an observation's vertices for the next."""
        if len(self.spare) < _VERTEX_POOL_SIZE:
            self.spare.append(vertices)


def all_tiles(camera: CameraPlan) -> NDArray[np.int32]:
    """Every tile of a picture, as kernels take them: the first pixel's column, and its row in the bits from 16 on."""
    tile = int(label_kernels.TILE)
    rows, columns = np.arange(0, camera.height, tile, dtype=np.int32), np.arange(0, camera.width, tile, dtype=np.int32)
    corners: NDArray[np.int32] = ((rows[:, None] << 16) | columns[None, :]).reshape(-1)
    return corners


class Observer:
    """Sees one scene's geometry. A camera that stands still draws what does not move once."""

    def __init__(self, geometry: Geometry, device: str, timings: Timings, reuse: TemporalReuse) -> None:
        self._g, self._device, self._timings = geometry, device, timings
        self._reuse = reuse.visibility
        self._poses: OrderedDict[bytes, _StaticView | None] = OrderedDict()  # None: seen once, and so perhaps moving

    def observe(self, camera: CameraPlan, world_from_sensor: Array, parts: Array) -> Observation:
        """The observation of one frame; `parts` [P, 3, 4] are the actors' parts in the world."""
        if len(parts) != self._g.parts:
            raise ValueError(f"{len(parts)} transforms were given for {self._g.parts} moving parts")
        pose = world_from_sensor.tobytes() + camera.model_dump_json().encode()
        still = self._still(pose, camera, world_from_sensor, parts)
        with self._timings("transform"):
            matrices = upload_transforms(view_from_parts(world_from_sensor, parts), self._device)
            chunks = self._chunks(plate_of(camera), matrices)
            vertices = self._transform(matrices, chunks, still)
            projected, reach = self._projected(camera, vertices)
            # A lens bows edges out of the box of their ends, so the short cut is a pinhole's.
            touched = all_tiles(camera) if bends(camera) else _tiles_within(camera, projected, reach)
        if still is None:
            straight = self.visibility(plate_of(camera), vertices, chunks, side=1)
            keys, labels = apply_distortion(straight, camera, self._device), self._no_labels(camera)
        else:
            keys, labels = wp.clone(still.keys), tuple(wp.clone(a) for a in still.labels)
            self.draw_moving(camera, vertices, chunks, 1, keys)
        with self._timings("label"):
            visible = self._label(camera, keys, all_tiles(camera) if still is None else touched, labels)
            shape = camera.height, camera.width
            depth, instance, semantic = (a.numpy().reshape(shape) for a in labels)
        with self._timings("amodal"):
            amodal = self._amodal(camera, vertices, chunks, touched)
        objects = objects_of(self._g, visible, amodal, projected)
        seen = camera, world_from_sensor, parts, keys, vertices, chunks, pose, touched
        made = Observation(depth, instance, semantic, objects, *seen)
        if still is not None:
            weakref.finalize(made, still.give_back, vertices).atexit = False
        return made

    def visibility(self, camera: CameraPlan, vertices: Any, seen: Any, *, side: int, still: bool = False) -> Any:
        """Keys of side x side samples a pixel, row by row; of what stands still alone, if `still`."""
        with self._timings(f"visibility x{side}"):
            keys = wp.zeros(camera.width * camera.height * side * side, dtype=wp.uint64, device=self._device)
            count = self._g.static_chunks if still else self._g.chunk_count
            self._raster(vertices, seen, 0, count, pinhole_of(camera, side), keys)
            return keys

    def draw_moving(self, camera: CameraPlan, vertices: Any, seen: Any, side: int, keys: Any) -> None:
        """Draw what moves into the keys of what stands still."""
        with self._timings(f"visibility x{side}"):
            first = self._g.static_chunks
            self._raster(vertices, seen, first, self._g.chunk_count - first, pinhole_of(camera, side), keys)

    def _still(self, pose: bytes, camera: CameraPlan, world_from_sensor: Array, parts: Array) -> _StaticView | None:
        """What stands still from a pose; None for a pose not seen before, which may not come again."""
        if not self._reuse or bends(camera):
            return None
        known = pose in self._poses
        still = self._poses.pop(pose, None)
        if known and still is None:
            matrices = upload_transforms(view_from_parts(world_from_sensor, parts), self._device)
            chunks, labels = self._chunks(plate_of(camera), matrices), self._no_labels(camera)
            vertices = self._transform(matrices, chunks, None)
            keys = self.visibility(camera, vertices, chunks, side=1, still=True)
            with self._timings("label"):
                self._label(camera, keys, all_tiles(camera), labels)
            still = _StaticView(vertices, keys, labels)
        self._poses[pose] = still
        if len(self._poses) > _POSE_CACHE_SIZE:
            self._poses.popitem(last=False)
        return still

    def _chunks(self, camera: CameraPlan, matrices: Any) -> Any:
        """Which chunks of triangles may be in the view."""
        g, seen = self._g, wp.empty(max(self._g.chunk_count, 1), dtype=wp.int32, device=self._device)
        if g.chunk_count:
            boxes = [g.chunks, g.chunk_centres, g.chunk_halves]
            launch(
                visibility_kernels.cull_chunks,
                g.chunk_count,
                [*boxes, matrices, pinhole_of(camera, 1), seen],
                self._device,
            )
        return seen

    def _transform(self, matrices: Any, chunks: Any, still: _StaticView | None) -> Any:
        """All vertices in the camera's frame; of what stands still, on a CPU, only those in chunks that may be seen.

        From a pose that is known they are those of before, and an observation's that is gone, if there is one.
        """
        g = self._g
        if still is not None and still.spare:
            out, first = still.spare.pop(), g.static_vertices
        elif still is not None:
            out, first = wp.clone(still.vertices), g.static_vertices
        else:
            out, first = wp.empty(g.vertex_count, dtype=wp.vec3f, device=self._device), 0
        if still is None and self._device == "cpu" and g.static_vertices:
            first = g.static_vertices
            inputs = [g.vertices, g.chunks, g.chunk_vertices, chunks, matrices, out]
            launch(visibility_kernels.transform_visible_vertices, g.static_chunks, inputs, self._device)
        if g.vertex_count > first:
            inputs = [g.vertices, g.vertex_part, matrices, first, out]
            launch(visibility_kernels.transform_vertices, g.vertex_count - first, inputs, self._device)
        return out

    def _raster(self, vertices: Any, seen: Any, first: int, count: int, lens: Any, keys: Any) -> None:
        if count:
            inputs = [vertices, self._g.triangles, self._g.chunks, seen, first, lens, keys]
            launch(visibility_kernels.raster_keys, count * CHUNK, inputs, self._device)

    def _extents(self) -> Any:
        rows = np.zeros((max(len(self._g.actors), 1), 5), np.int32)
        rows[:, 1:3], rows[:, 3:5] = 1 << 30, -(1 << 30)
        return wp.array(rows, dtype=wp.int32, device=self._device)

    def _no_labels(self, camera: CameraPlan) -> tuple[Any, ...]:
        """Room for depth, instance and semantic."""
        kinds = (wp.float32, wp.uint16, wp.uint8)
        return tuple(wp.empty(camera.width * camera.height, dtype=kind, device=self._device) for kind in kinds)

    def _label(
        self, camera: CameraPlan, keys: Any, tiles: NDArray[np.int32], labels: tuple[Any, ...]
    ) -> NDArray[np.int32]:
        """Label the tiles' pixels; the actors' visible extents within them."""
        g, extents = self._g, self._extents()
        if len(tiles):
            tables = [g.triangle_surface, g.surface_actor, g.surface_instance, g.surface_tag]
            inputs = [self._tiles(tiles), keys, *tables, pinhole_of(camera, 1), *labels, extents]
            launch(label_kernels.label_pixels, len(tiles) * int(label_kernels.TILE_PIXELS), inputs, self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows

    def _amodal(self, camera: CameraPlan, vertices: Any, seen: Any, tiles: NDArray[np.int32]) -> NDArray[np.int32]:
        g, plate, lens = self._g, plate_of(camera), pinhole_of(camera, 1)
        extents, first = self._extents(), g.static_chunks
        for start in range(0, len(g.actors) if len(tiles) else 0, _ACTORS_PER_WORD):
            bits = wp.zeros(plate.width * plate.height, dtype=wp.uint64, device=self._device)
            tables = [vertices, g.triangles, g.triangle_surface, g.surface_actor, g.chunks, seen]
            count = (g.chunk_count - first) * CHUNK
            launch(
                visibility_kernels.raster_actor_bits,
                count,
                [*tables, first, start, pinhole_of(plate, 1), bits],
                self._device,
            )
            bits = apply_distortion(bits, camera, self._device)
            inputs = [self._tiles(tiles), bits, lens, start, min(_ACTORS_PER_WORD, len(g.actors) - start), extents]
            launch(label_kernels.count_amodal, len(tiles) * int(label_kernels.TILE_PIXELS), inputs, self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows

    def _projected(self, camera: CameraPlan, vertices: Any) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """The actors' unclipped boxes, and those of the points where the near plane cuts them."""
        g, extents, reach = self._g, self._extents(), self._extents()
        first = g.static_triangles
        if g.triangle_count > first:
            tables = [vertices, g.triangles, g.triangle_surface, g.surface_actor, first, pinhole_of(camera, 1)]
            tables += [distortion_of(camera), extents, reach]
            launch(label_kernels.project_boxes, g.triangle_count - first, tables, self._device)
        return extents.numpy(), reach.numpy()

    def _tiles(self, tiles: NDArray[np.int32]) -> Any:
        return wp.array(tiles, dtype=wp.int32, device=self._device)


def _tiles_within(camera: CameraPlan, *boxes: NDArray[np.int32]) -> NDArray[np.int32]:
    """The tiles that the actors' boxes (1/256 pixels; both together, a pixel wider) meet, as kernels take them."""
    low = np.minimum(boxes[0][:, 1:3], boxes[1][:, 1:3]) // 256 - 1
    high = np.maximum(boxes[0][:, 3:5], boxes[1][:, 3:5]) // 256 + 1
    tile = int(label_kernels.TILE)
    mask = np.zeros((-(-camera.height // tile), -(-camera.width // tile)), bool)
    end = np.array([camera.width, camera.height])
    for (x0, y0), (x1, y1) in zip(np.maximum(low, 0), np.minimum(high, end - 1), strict=True):
        if x0 <= x1 and y0 <= y1:
            mask[y0 // tile : y1 // tile + 1, x0 // tile : x1 // tile + 1] = True
    corners: NDArray[np.int32] = all_tiles(camera)[mask.reshape(-1)]
    return corners
