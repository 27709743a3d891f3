"""From a pose to an Observation: visibility and labels.

Vertices are transformed to view space and rasterised into one visibility buffer, from which all labels follow. For a
static camera the static scene is rasterised and labelled once, later only the tiles that moving objects may touch.
Appearance is not involved.
"""

from __future__ import annotations

import weakref
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.optics import bends, focal_length
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.timings import Timings
from recipe_runtime.core.transforms import Array
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import label_kernels, passes
from recipe_runtime.render.raster.distortion import apply_distortion, undistorted_camera
from recipe_runtime.render.raster.observation import Observation, objects_of
from recipe_runtime.render.raster.passes import Labels
from recipe_runtime.render.raster.surfaces import VisibleSurfaces
from recipe_runtime.render.raster.visibility_kernels import (
    raster_actor_bits,
    raster_keys,
    transform_visible_vertices,
)
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts
from recipe_runtime.render.scene.chunking import CHUNK
from recipe_runtime.render.scene.geometry import Geometry

_POSE_CACHE_SIZE = 4  # 10 MB each at 800 x 600
_VERTEX_POOL_SIZE = 3  # arrays of vertices kept for a pose


@dataclass(frozen=True)
class _StaticView:
    """The observation of the static scene from one pose, without moving objects."""

    vertices: DeviceArray
    keys: DeviceArray
    labels: Labels
    spare: list[Any] = field(
        default_factory=list
    )  # vertex arrays of released observations; their static vertices are valid

    def give_back(self, vertices: DeviceArray) -> None:
        """Keep the vertex array of an observation for reuse."""
        if len(self.spare) < _VERTEX_POOL_SIZE:
            self.spare.append(vertices)


def all_tiles(camera: CameraPlan) -> NDArray[np.int32]:
    """Return every tile of a picture, int32: the column of its first pixel, and the row in the bits from 16 on."""
    tile = int(label_kernels.TILE)
    rows, columns = np.arange(0, camera.height, tile, dtype=np.int32), np.arange(0, camera.width, tile, dtype=np.int32)
    corners: NDArray[np.int32] = ((rows[:, None] << 16) | columns[None, :]).reshape(-1)
    return corners


class Observer:
    """Observes one scene. For a static camera it rasterises the static scene once."""

    def __init__(self, geometry: Geometry, device: str, timings: Timings, reuse: TemporalReuse) -> None:
        self._g, self._device, self._timings = geometry, device, timings
        self._reuse = reuse.visibility
        self._poses: OrderedDict[bytes, _StaticView | None] = (
            OrderedDict()
        )  # None: observed once, so the camera may be moving

    def observe(
        self,
        camera: CameraPlan,
        world_from_sensor: Array,
        parts: Array,
        lamps: NDArray[np.int32] | None = None,
        focal: float | None = None,
    ) -> Observation:
        """Return the observation of one frame.

        Args:
            camera: The camera.
            world_from_sensor: Its pose, [3, 4].
            parts: World transforms of the moving parts, [P, 3, 4].
            lamps: A mask of `LampState` for each actor, [A]; None: none of them is lit.
            focal: Focal length, in pixels, for which the objects' levels are chosen; None: that of the camera.
        """
        focal = focal or focal_length(camera)
        if len(parts) != self._g.parts:
            raise ValueError(f"{len(parts)} transforms were given for {self._g.parts} moving parts")
        pose = world_from_sensor.tobytes() + f"{camera.model_dump_json()} {focal!r}".encode()
        still = self._still(pose, camera, focal, world_from_sensor, parts)
        with self._timings("transform"):
            matrices = upload_transforms(view_from_parts(world_from_sensor, parts), self._device)
            chunks = self._chunks(undistorted_camera(camera), focal, matrices)
            vertices = self._transform(matrices, chunks, still)
            projected, reach = self._projected(camera, vertices, chunks)
            # Lens distortion bends edges beyond the box of their ends, so this shortcut is valid for pinholes only.
            touched = all_tiles(camera) if bends(camera) else _tiles_within(camera, projected, reach)
        if still is None:
            straight = self.visibility(undistorted_camera(camera), vertices, chunks, rows=1)
            keys, labels = apply_distortion(straight, camera, self._device), Labels.empty(camera, self._device)
        else:
            keys, labels = wp.clone(still.keys), still.labels.clone()
            self.draw_moving(camera, vertices, chunks, 1, keys)
        with self._timings("label"):
            visible = self._label(camera, keys, all_tiles(camera) if still is None else touched, labels)
            shape = camera.height, camera.width
            depth, instance, semantic = (a.numpy().reshape(shape) for a in labels)
        with self._timings("amodal"):
            amodal = self._amodal(camera, vertices, chunks, touched)
        made = Observation(
            depth,
            instance,
            semantic,
            objects_of(self._g, visible, amodal, projected),
            camera,
            world_from_sensor,
            parts,
            keys,
            vertices,
            seen=chunks,
            pose=pose,
            touched=touched,
            surfaces=VisibleSurfaces(self._g, camera, keys, vertices, matrices, self._device),
            lamps=np.zeros(len(self._g.actors), np.int32) if lamps is None else lamps,
        )
        if still is not None:
            weakref.finalize(made, still.give_back, vertices).atexit = False
        return made

    def visibility(
        self,
        camera: CameraPlan,
        vertices: DeviceArray,
        seen: DeviceArray,
        *,
        rows: int,
        still: bool = False,
        out: DeviceArray | None = None,
    ) -> DeviceArray:
        """Return visibility keys, `rows` samples per pixel, row by row; of the static scene only if `still`."""
        with self._timings(f"visibility x{rows}"):
            size = camera.width * camera.height * rows
            if out is not None and out.size == size:
                keys = out
                keys.zero_()
            else:
                keys = wp.zeros(size, dtype=wp.uint64, device=self._device)
            count = self._g.static_chunks if still else self._g.chunk_count
            self._raster(camera, vertices, seen, range(count), rows, keys)
            return keys

    def draw_moving(
        self, camera: CameraPlan, vertices: DeviceArray, seen: DeviceArray, rows: int, keys: DeviceArray
    ) -> None:
        """Rasterise the moving parts into keys of the static scene."""
        with self._timings(f"visibility x{rows}"):
            moving = range(self._g.static_chunks, self._g.chunk_count)
            self._raster(camera, vertices, seen, moving, rows, keys)

    def _raster(
        self,
        camera: CameraPlan,
        vertices: DeviceArray,
        seen: DeviceArray,
        chunks: range,
        rows: int,
        keys: DeviceArray,
    ) -> None:
        """Rasterise a range of chunks into the keys."""
        launch(
            raster_keys,
            len(chunks) * CHUNK,
            self._device,
            **fields_of(self._g, "triangles", "chunks"),
            vertices=vertices,
            chunk_visible=seen,
            first_chunk=chunks.start,
            pinhole=pinhole_of(camera, rows),
            out_keys=keys,
        )

    def _still(
        self, pose: bytes, camera: CameraPlan, focal: float, world_from_sensor: Array, parts: Array
    ) -> _StaticView | None:
        """Return the static view of a pose; None at the first frame from a pose, which may not occur again."""
        if not self._reuse or bends(camera):
            return None
        known = pose in self._poses
        still = self._poses.pop(pose, None)
        if known and still is None:
            matrices = upload_transforms(view_from_parts(world_from_sensor, parts), self._device)
            chunks, labels = self._chunks(camera, focal, matrices), Labels.empty(camera, self._device)
            vertices = self._transform(matrices, chunks, None)
            keys = self.visibility(camera, vertices, chunks, rows=1, still=True)
            with self._timings("label"):
                self._label(camera, keys, all_tiles(camera), labels)
            still = _StaticView(vertices, keys, labels)
        self._poses[pose] = still
        if len(self._poses) > _POSE_CACHE_SIZE:
            self._poses.popitem(last=False)
        return still

    def _chunks(self, camera: CameraPlan, focal: float, transforms: DeviceArray) -> DeviceArray:
        """Return which chunks of triangles may be visible, int32 [C]: `triangles.IN_VIEW`."""
        visible = wp.empty(max(self._g.chunk_count, 1), dtype=wp.int32, device=self._device)
        passes.cull_chunks(self._g, transforms, camera, focal, visible, self._device)
        return visible

    def _transform(self, transforms: DeviceArray, chunks: DeviceArray, still: _StaticView | None) -> DeviceArray:
        """Return all vertices in view space; on a CPU, static ones only where their chunk may be visible.

        From a known pose, static vertices are copied, or are already in an array that an earlier observation gave back.
        """
        g = self._g
        out: DeviceArray
        if still is not None and still.spare:
            out, first = still.spare.pop(), g.static_vertices
        elif still is not None:
            out, first = wp.clone(still.vertices), g.static_vertices
        else:
            out, first = wp.empty(g.vertex_count, dtype=wp.vec3f, device=self._device), 0
        if still is None and self._device == "cpu" and g.static_vertices:
            first = g.static_vertices
            launch(
                transform_visible_vertices,
                g.static_chunks,
                self._device,
                **fields_of(g, "vertices", "chunks", "chunk_vertices"),
                chunk_visible=chunks,
                transforms=transforms,
                out_vertices=out,
            )
        passes.transform_vertices(g, transforms, first, out, self._device)
        return out

    def _label(
        self, camera: CameraPlan, keys: DeviceArray, tiles: NDArray[np.int32], labels: Labels
    ) -> NDArray[np.int32]:
        """Label the tiles' pixels; return the visible extents of the actors within them, [E, 5]."""
        extents = self._extents()
        passes.label_pixels(self._g, self._tiles(tiles), keys, camera, labels, extents, self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows

    def _amodal(
        self, camera: CameraPlan, vertices: DeviceArray, seen: DeviceArray, tiles: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """Return the extents of the actors within the tiles, each without occlusion, [E, 5]."""
        g, undistorted, extents = self._g, undistorted_camera(camera), self._extents()
        for first in range(0, len(g.actors) if len(tiles) else 0, passes.ACTORS_PER_WORD):
            bits = wp.zeros(undistorted.width * undistorted.height, dtype=wp.uint64, device=self._device)
            launch(
                raster_actor_bits,
                (g.chunk_count - g.static_chunks) * CHUNK,
                self._device,
                **fields_of(g, "triangles", "triangle_surface", "surface_actor", "chunks"),
                vertices=vertices,
                chunk_visible=seen,
                first_chunk=g.static_chunks,
                first_actor=first,
                pinhole=pinhole_of(undistorted, 1),
                out_bits=bits,
            )
            bits = apply_distortion(bits, camera, self._device)
            passes.count_amodal(g, self._tiles(tiles), bits, first, camera, extents, self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows

    def _projected(
        self, camera: CameraPlan, vertices: DeviceArray, seen: DeviceArray
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the moving bodies' unclipped boxes, and those of their cuts by the near plane, each [E, 5]."""
        extents, reach = self._extents(), self._extents()
        passes.project_boxes(self._g, vertices, seen, camera, extents, reach, self._device)
        return extents.numpy(), reach.numpy()

    def _extents(self) -> DeviceArray:
        return wp.array(passes.empty_extents(self._g), dtype=wp.int32, device=self._device)

    def _tiles(self, tiles: NDArray[np.int32]) -> DeviceArray:
        return wp.array(tiles, dtype=wp.int32, device=self._device)


def _tiles_within(camera: CameraPlan, *boxes: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the tiles that the moving bodies' boxes (1/256 pixels, widened by one pixel) overlap."""
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
