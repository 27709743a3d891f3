"""Shadow maps: made for a sun's place over the whole town once, and for what moves every frame."""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render import shadow, visibility
from recipe_runtime.render.device import launch, wp
from recipe_runtime.render.geometry import Geometry
from recipe_runtime.render.shadow import TILE, Sunbeam
from recipe_runtime.render.visibility import Lens
from recipe_runtime.transforms import Array

_STATIC_SIZE = 4096
_MOVING_SIZE = 1024
_MOVING_TEXELS = (0.022, 0.09)  # metres: about 22 m across, and 92 m
_KEPT = 4  # suns whose static map is kept
_REACH = 400.0  # metres along the sun's rays that a moving map spans


@dataclass(frozen=True)
class ShadowMap:
    """A map on the device."""

    beam: Any
    depths: Any  # float32
    used: Any  # int32 by tile


class Shadows:
    """The shadow maps of one scene."""

    def __init__(self, geometry: Geometry, device: str) -> None:
        self._g, self._device = geometry, device
        self._static: OrderedDict[bytes, ShadowMap] = OrderedDict()

    def static(self, sun: NDArray[np.float64]) -> ShadowMap:
        """The map of what stands still, for a sun above the horizon."""
        name = sun.tobytes()
        if name not in self._static:
            if len(self._static) >= _KEPT:
                self._static.popitem(last=False)
            self._static[name] = self._draw_static(sun)
        self._static.move_to_end(name)
        return self._static[name]

    def none(self) -> ShadowMap:
        """A map that shadows nothing."""
        beam = Sunbeam()
        beam.size, beam.depth = 0, 1.0
        empty = wp.zeros(1, dtype=wp.float32, device=self._device)
        return ShadowMap(beam, empty, wp.zeros(1, dtype=wp.int32, device=self._device))

    def moving(self, sun: NDArray[np.float64], world: Any, eye: Array, ahead: Array) -> tuple[ShadowMap, ShadowMap]:
        """The fine and the coarse map of the moving parts; `world` holds all vertices in the world frame."""
        maps = []
        for texel in _MOVING_TEXELS:
            centre = eye + ahead * (texel * _MOVING_SIZE * 0.42)
            maps.append(self._draw_moving(sun, world, centre, texel))
        return maps[0], maps[1]

    def _draw_static(self, sun: NDArray[np.float64]) -> ShadowMap:
        low, high = self._g.bounds
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
        axes = _axes(sun)
        spans = [_along(axis, corners) for axis in axes]
        start = [float(s.min()) for s in spans]
        extent = [max(float(s.max()) - float(s.min()), 1.0) for s in spans]
        scale = [(_STATIC_SIZE - 16) / extent[0], (_STATIC_SIZE - 16) / extent[1], 0.98 / extent[2]]
        offset = [8.0 - start[0] * scale[0], 8.0 - start[1] * scale[1], 0.01 - start[2] * scale[2]]
        beam = _beam(axes, scale, offset, _STATIC_SIZE)
        return self._draw(beam, self._g.vertices, 0, self._g.static_triangles)

    def _draw_moving(self, sun: NDArray[np.float64], world: Any, centre: Array, texel: float) -> ShadowMap:
        axes = _axes(sun)
        half = _MOVING_SIZE / 2.0
        at = [float(_along(axis, centre[None])[0]) for axis in axes]
        # Whole texels, so that the map's grid stays where it is in the world as the camera moves.
        offset = [half - float(np.floor(at[0] / texel)), half - float(np.floor(at[1] / texel)), 0.5 - at[2] / _REACH]
        beam = _beam(axes, [1.0 / texel, 1.0 / texel, 1.0 / _REACH], offset, _MOVING_SIZE)
        first = self._g.static_triangles
        return self._draw(beam, world, first, self._g.triangle_count - first)

    def _draw(self, beam: Any, vertices: Any, first: int, count: int) -> ShadowMap:
        size = beam.size
        keys = wp.zeros(size * size, dtype=wp.uint64, device=self._device)
        used = wp.zeros((size // TILE) * (size // TILE), dtype=wp.int32, device=self._device)
        lens = Lens()
        lens.near, lens.far, lens.width, lens.height, lens.side = 1.0, 1.0e9, size, size, 1
        if count:
            inputs = [vertices, self._g.triangles, self._g.casts, first, beam, lens, keys, used]
            launch(shadow.cast, count, inputs, self._device)
        depths = wp.empty(size * size, dtype=wp.float32, device=self._device)
        launch(shadow.nearness, size * size, [keys, depths], self._device)
        return ShadowMap(beam, depths, used)


def world_vertices(geometry: Geometry, world_from_part: Any, device: str) -> Any:
    """All vertices in the world; what stands still is there already and is left out."""
    out = wp.empty(geometry.vertex_count, dtype=wp.vec3f, device=device)
    count = geometry.vertex_count - geometry.static_vertices
    if count:
        inputs = [geometry.vertices, geometry.vertex_part, world_from_part, geometry.static_vertices, out]
        launch(visibility.transform, count, inputs, device)
    return out


def _axes(sun: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Unit vectors across the rays (level), across them (upward), and towards the sun."""
    flat = float(np.sqrt(sun[0] * sun[0] + sun[1] * sun[1]))
    u = np.array([-sun[1] / flat, sun[0] / flat, 0.0]) if flat > 1e-6 else np.array([1.0, 0.0, 0.0])
    v = np.array(
        [sun[1] * u[2] - sun[2] * u[1], sun[2] * u[0] - sun[0] * u[2], sun[0] * u[1] - sun[1] * u[0]]
    )
    return [u, v, sun]


def _along(axis: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    product: NDArray[np.float64] = points[:, 0] * axis[0] + points[:, 1] * axis[1] + points[:, 2] * axis[2]
    return product


def _beam(axes: list[NDArray[np.float64]], scale: list[float], offset: list[float], size: int) -> Any:
    beam = Sunbeam()
    rows = [wp.vec4f(*(float(c) * s for c in axis), o) for axis, s, o in zip(axes, scale, offset, strict=True)]
    beam.u, beam.v, beam.q = rows
    beam.size = size
    beam.texel = max(1.0 / scale[0], 1.0 / scale[1])
    beam.depth = 1.0 / scale[2]
    return beam
