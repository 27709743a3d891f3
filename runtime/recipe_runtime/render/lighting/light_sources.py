"""The light sources of an observation: shadow maps by sun, lamps and bodies by tile.

All appearances of a frame share them.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from recipe_runtime.core.timings import Timings
from recipe_runtime.render.atmosphere.weather_light import WeatherLight
from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting import passes
from recipe_runtime.render.lighting.buffers import TileLists
from recipe_runtime.render.lighting.lights import bodies_at, lamp_columns, lamps_at, lit_surfaces, no_lamps
from recipe_runtime.render.lighting.tile_list_kernels import Lamps
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.scene.camera import upload_transforms, view_from_parts, world_from_parts, world_from_view
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.lamp_shadow_maps import LampShadowMaps
from recipe_runtime.render.shadows.shadow_maps import ShadowMaps, world_vertices


@dataclass(frozen=True)
class TiledLights:
    """Lamps and bodies near a camera, each a one-element struct array on the device, and their lists by tile."""

    lamps: DeviceArray
    bodies: DeviceArray
    lists: TileLists


@dataclass
class _Cached:
    """The light sources computed so far for one observation."""

    moving_beams: dict[bytes, list[object]] = field(default_factory=dict)  # by the sun's direction
    vertices: tuple[DeviceArray, DeviceArray] | None = None
    nearby: dict[bool, TiledLights] = field(default_factory=dict)  # by whether lamps burn


class LightSources:
    """Shadow maps and tile lists of one scene's observations."""

    def __init__(self, geometry: Geometry, device: str, timings: Timings) -> None:
        self._g, self._device, self._timings = geometry, device, timings
        self._maps, self._lamp_maps = ShadowMaps(geometry, device), LampShadowMaps(geometry, device)
        self._found: WeakKeyDictionary[Observation, _Cached] = WeakKeyDictionary()

    def beams(self, obs: Observation, light: WeatherLight) -> DeviceArray:
        """Return the four shadow maps of a sun, a struct array: static fine and coarse, moving fine and coarse."""
        if not light.sun_shines:
            return struct_array([self._maps.none()] * 4, self._device)
        eye, ahead = obs.world_from_sensor[:, 3], obs.world_from_sensor[:, 0]
        with self._timings("static shadows"):
            static = self._maps.static(light.sun, eye)
        moving, sun = self._of(obs).moving_beams, light.sun.tobytes()
        if sun not in moving:
            world, vertices = self._moving(obs)
            maps = self._maps.moving(light.sun, vertices, world, eye, ahead)
            moving[sun] = [shadow_map.beam for shadow_map in maps]
            weakref.finalize(obs, self._maps.give_back, maps).atexit = False
        return struct_array([*static, *moving[sun]], self._device)

    def nearby(self, obs: Observation, lit: bool) -> TiledLights:
        """Return the lamps (none unless `lit`) and the bodies near a camera, and their lists by tile."""
        nearby = self._of(obs).nearby
        if lit not in nearby:
            nearby[lit] = self._listed(obs, lit)
        return nearby[lit]

    def _listed(self, obs: Observation, lit: bool) -> TiledLights:
        device = self._device
        shown: DeviceArray = wp.array(lit_surfaces(self._g, obs.lamps), dtype=wp.float32, device=device)
        lamps = struct_array([self._lamps(obs, shown) if lit else no_lamps(shown, device)], device)
        bodies = struct_array([bodies_at(self._g, obs.parts, device)], device)
        tiles = -(-obs.camera.width // int(TILE)) * -(-obs.camera.height // int(TILE))
        lists = TileLists.empty(tiles, device)
        back = upload_transforms(world_from_view(obs.world_from_sensor), device)
        view = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], device)
        passes.list_lights(obs.keys, obs.camera, back, view, lamps, bodies, lists, device)
        return TiledLights(lamps, bodies, lists)

    def _lamps(self, obs: Observation, shown: DeviceArray) -> Lamps:
        """Return the lamps near a camera, with their shadow maps; `shown` are the lit surfaces of vehicles."""
        columns, slots = lamp_columns(self._g, world_from_parts(obs.parts), obs.world_from_sensor)
        with self._timings("lamp shadows"):
            maps, memory = self._lamp_maps.draw(slots, *self._moving(obs))
        weakref.finalize(obs, self._lamp_maps.give_back, memory).atexit = False
        return lamps_at(self._g, columns, maps, shown, self._device)

    def _moving(self, obs: Observation) -> tuple[DeviceArray, DeviceArray]:
        """Return the transforms from the parts to the world, and the moving vertices there."""
        found = self._of(obs)
        if found.vertices is None:
            world = upload_transforms(world_from_parts(obs.parts), self._device)
            found.vertices = world, world_vertices(self._g, world, self._device)
        return found.vertices

    def _of(self, obs: Observation) -> _Cached:
        return self._found.setdefault(obs, _Cached())
