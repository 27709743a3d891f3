"""From a pose to an Observation: the host's side of visibility and labels, and the pipeline's first half.

Vertices are moved into the camera's frame, drawn into one buffer of keys, and every label is read off that. What
stands still is drawn once for a camera that stands still; no appearance has a part in any of it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.plan import CameraPlan

from recipe_runtime.render import observation, visibility
from recipe_runtime.render.device import launch, wp
from recipe_runtime.render.geometry import Geometry
from recipe_runtime.render.timing import Timings
from recipe_runtime.render.view import lens_of, view_from_parts
from recipe_runtime.transforms import Array

Box = tuple[int, int, int, int]
_BATCH = 64  # actors whose lone silhouettes fit a 64-bit word


@dataclass(frozen=True)
class ObjectView:
    """An actor of which at least one pixel would be seen if nothing stood before it.

    Boxes are x0, y0, x1, y1 in pixels and end outside; `box` is None for an actor wholly hidden. `projected` is not
    clipped to the picture; it holds what lies beyond the near plane.
    """

    name: str
    instance: int
    visible: int  # pixels
    box: Box | None
    amodal: int  # pixels, rasterised alone, within the picture
    amodal_box: Box
    projected: tuple[float, float, float, float]


@dataclass(frozen=True)
class Observation:
    """All labels of one frame of one sensor, from one visibility buffer, and what shading starts from."""

    depth: NDArray[np.float32]  # [H, W] metres along the optical axis; the far limit for the sky
    instance: NDArray[np.uint16]  # [H, W] class * 1000 + instance, 0 for town and sky
    semantic: NDArray[np.uint8]  # [H, W] CARLA tags, 11 for the sky
    objects: tuple[ObjectView, ...]
    camera: CameraPlan
    world_from_sensor: Array  # [3, 4]
    parts: Array  # [P, 3, 4]
    keys: Any = field(repr=False)  # uint64 [H * W] visibility at pixel centres
    vertices: Any = field(repr=False)  # vec3f [V] in the camera's frame
    derived: dict[str, Any] = field(default_factory=dict, repr=False)  # what appearances share, made when first asked


def device_rows(transforms: Array, device: str) -> Any:
    """3x4 transforms as rows of twelve float32 on the device."""
    return wp.array(transforms.reshape(-1, 12).astype(np.float32), dtype=wp.float32, device=device)


class Observer:
    """Sees one scene's geometry. A camera that stands still draws what does not move once."""

    def __init__(self, geometry: Geometry, device: str, timings: Timings, keep_static: bool = True) -> None:
        self._g, self._device, self._timings = geometry, device, timings
        self._keep_static = keep_static
        self._static: dict[int, tuple[bytes, Any]] = {}  # samples a side -> pose and keys of the static geometry

    def observe(self, camera: CameraPlan, world_from_sensor: Array, parts: Array) -> Observation:
        """The observation of one frame; `parts` [P, 3, 4] are the actors' parts in the world."""
        if len(parts) != self._g.parts:
            raise ValueError(f"{len(parts)} transforms were given for {self._g.parts} moving parts")
        with self._timings("transform"):
            vertices = self._transform(world_from_sensor, parts)
        keys = self.visibility(camera, world_from_sensor, vertices, side=1)
        with self._timings("label"):
            depth, instance, semantic, visible = self._label(camera, keys)
        with self._timings("amodal"):
            amodal = self._amodal(camera, vertices)
            projected = self._projected(camera, vertices)
        objects = _objects(self._g, visible, amodal, projected)
        return Observation(depth, instance, semantic, objects, camera, world_from_sensor, parts, keys, vertices)

    def visibility(self, camera: CameraPlan, world_from_sensor: Array, vertices: Any, side: int) -> Any:
        """Keys of side x side samples a pixel, row by row."""
        with self._timings(f"visibility x{side}"):
            lens, g = lens_of(camera, side), self._g
            pose = world_from_sensor.tobytes() + camera.model_dump_json().encode()
            held = self._static.get(side)
            if held is None or held[0] != pose or not self._keep_static:
                keys = wp.zeros(camera.width * camera.height * side * side, dtype=wp.uint64, device=self._device)
                self._raster(vertices, 0, g.static_triangles, lens, keys)
                held = self._static[side] = (pose, keys)
            keys = wp.clone(held[1])
            self._raster(vertices, g.static_triangles, g.triangle_count - g.static_triangles, lens, keys)
            return keys

    def _transform(self, world_from_sensor: Array, parts: Array) -> Any:
        g = self._g
        matrices = device_rows(view_from_parts(world_from_sensor, parts), self._device)
        out = wp.empty(g.vertex_count, dtype=wp.vec3f, device=self._device)
        inputs = [g.vertices, g.vertex_part, matrices, 0, out]
        launch(visibility.transform, g.vertex_count, inputs, self._device)
        return out

    def _raster(self, vertices: Any, first: int, count: int, lens: Any, keys: Any) -> None:
        if count:
            launch(visibility.raster, count, [vertices, self._g.triangles, first, lens, keys], self._device)

    def _extents(self) -> Any:
        rows = np.zeros((max(len(self._g.actors), 1), 5), np.int32)
        rows[:, 1:3], rows[:, 3:5] = 1 << 30, -(1 << 30)
        return wp.array(rows, dtype=wp.int32, device=self._device)

    def _label(self, camera: CameraPlan, keys: Any) -> tuple[Any, Any, Any, NDArray[np.int32]]:
        g, shape = self._g, (camera.height, camera.width)
        depth = wp.empty(shape, dtype=wp.float32, device=self._device)
        instance = wp.empty(shape, dtype=wp.uint16, device=self._device)
        semantic = wp.empty(shape, dtype=wp.uint8, device=self._device)
        extents = self._extents()
        tables = [g.triangle_surface, g.surface_actor, g.surface_instance, g.surface_tag]
        inputs = [keys, *tables, lens_of(camera, 1), depth, instance, semantic, extents]
        launch(observation.label, shape, inputs, self._device)
        return depth.numpy(), instance.numpy(), semantic.numpy(), extents.numpy()

    def _amodal(self, camera: CameraPlan, vertices: Any) -> NDArray[np.int32]:
        g, pixels = self._g, camera.width * camera.height
        extents, first = self._extents(), g.static_triangles
        for start in range(0, len(g.actors), _BATCH):
            bits = wp.zeros(pixels, dtype=wp.uint64, device=self._device)
            inputs = [
                vertices,
                g.triangles,
                g.triangle_surface,
                g.surface_actor,
                first,
                start,
                lens_of(camera, 1),
                bits,
            ]
            launch(visibility.cover, g.triangle_count - first, inputs, self._device)
            count = min(_BATCH, len(g.actors) - start)
            launch(observation.amodal, pixels, [bits, camera.width, start, count, extents], self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows

    def _projected(self, camera: CameraPlan, vertices: Any) -> NDArray[np.int32]:
        g, extents = self._g, self._extents()
        first = g.static_triangles
        if g.triangle_count > first:
            tables = [vertices, g.triangles, g.triangle_surface, g.surface_actor, first, lens_of(camera, 1), extents]
            launch(observation.project_box, g.triangle_count - first, tables, self._device)
        rows: NDArray[np.int32] = extents.numpy()
        return rows


def _objects(
    geometry: Geometry, visible: NDArray[np.int32], amodal: NDArray[np.int32], projected: NDArray[np.int32]
) -> tuple[ObjectView, ...]:
    views = []
    for index, actor in enumerate(geometry.actors):
        if amodal[index, 0]:
            views.append(
                ObjectView(
                    actor.name,
                    actor.instance,
                    visible=int(visible[index, 0]),
                    box=_box(visible[index]) if visible[index, 0] else None,
                    amodal=int(amodal[index, 0]),
                    amodal_box=_box(amodal[index]),
                    projected=_fractions(projected[index]),
                )
            )
    return tuple(views)


def _box(row: NDArray[np.int32]) -> Box:
    return int(row[1]), int(row[2]), int(row[3]), int(row[4])


def _fractions(row: NDArray[np.int32]) -> tuple[float, float, float, float]:
    return int(row[1]) / 256.0, int(row[2]) / 256.0, int(row[3]) / 256.0, int(row[4]) / 256.0
