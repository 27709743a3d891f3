"""From an Observation and an appearance to a picture: the host's side of shading, and the pipeline's second half.

Samples are placed and surveyed once for all appearances of a frame; then come shadows, nearby lamps and bodies,
shading, reflection on wet ground, rain and the camera. The light of an earlier frame of the same pose is left as it is
where it must be equal, so that remembering saves time and changes no byte.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan

from recipe_runtime.render.device.arrays import record, records
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.device.timings import Timings
from recipe_runtime.render.lighting import (
    fog_glow_kernels,
    reflection_kernels,
    reflection_reuse_kernels,
    shading_kernels,
    shadow_kernels,
    temporal_kernels,
    tile_list_kernels,
    weather_light,
)
from recipe_runtime.render.lighting.lights import bodies_at, lamps_at, no_lamps
from recipe_runtime.render.lighting.shadow_maps import ShadowMaps, world_vertices
from recipe_runtime.render.lighting.temporal import all_samples, listed_samples, thread_count
from recipe_runtime.render.lighting.weather_light import Light, drift
from recipe_runtime.render.raster.label_kernels import TILE
from recipe_runtime.render.raster.observation import Observation, depth_on
from recipe_runtime.render.sampling.sampler import FrameSamples
from recipe_runtime.render.scene.camera import (
    pinhole_of,
    upload_transforms,
    view_from_parts,
    world_from_parts,
    world_from_view,
)
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.texture.mipmaps import ImageAtlases
from recipe_runtime.render.texture.surface_colours import surface_colours

_LIGHT_CACHE_SIZE = 64
_SAMPLE_LIGHT_CACHE_SIZE = 16  # 20 MB each at 800 x 600


@dataclass(eq=False)
class SampleLight:
    """One appearance's light on a base's samples."""

    light: tuple[Any, Any, Any]  # out, gleam and known, as `shade.shade` writes them
    lists: tuple[Any, ...]  # lamps, bodies and glows by tile
    clouds: tuple[float, float]
    kept: int  # samples whose light stays for later frames
    levels: tuple[Any, Any]  # which pixels are stale, and what was developed of them before the noise
    rays: tuple[Any, Any, Any]  # reach, asked and ways, as `reflection.march` writes them
    shown: Any  # the light with what wet ground mirrors; out itself where nothing is wet
    sources: Any  # by kept sample, as `reflection.reflect` writes them
    quiet: Any  # by tile, as `recall.enlist` writes it
    stirs: int = 0  # in which leaves stirred
    moment: int = -1  # of the ripples there
    mirrors: Any = None  # what `reflection.pools` lists: what a sample is made of decides, and that stays


class ShadingPass:
    """Shades one scene's observations."""

    def __init__(
        self,
        geometry: Geometry,
        albums: ImageAtlases,
        device: str,
        timings: Timings,
        reuse: TemporalReuse,
    ) -> None:
        self._albums = albums
        self._g, self._device, self._timings = geometry, device, timings
        self._shadows = ShadowMaps(geometry, device)
        self._lights: dict[str, Light] = {}  # by the appearance's digest
        self._looks: dict[str, Any] = {}  # by the identity of the colours
        self._reuse = reuse
        self._listed = wp.empty(1, dtype=wp.int32, device=device)

    def shade(
        self, obs: Observation, points: FrameSamples, appearance: AppearancePlan, sensor: str, light: Light
    ) -> tuple[Any, SampleLight]:
        """The light of all samples, and what is kept of it."""
        with self._timings("shadows"):
            beams = self._sunlit(obs, light)
        with self._timings("nearby"):
            lamps, bodies, *found = self._nearby(obs, light.air.night > 0.0 or light.air.glow > 0.0)
        with self._timings("shade"):
            looks = self._looks_of(appearance)
            told = [record(v, self._device) for v in (points.data, looks, light.air, lamps, bodies)]
            lists = tuple(found)
            name = f"{appearance.digest} {sensor}"
            shaded, before = self._begun(obs.camera, points, name, light, beams, told[3], lists)
            earlier = record(before, self._device)
            asked = self._live(points, earlier, told[2], shaded) if before.known else all_samples()
            inputs = [*told[:3], beams, *told[3:], *lists, earlier, record(asked, self._device)]
            launch(
                shading_kernels.shade_samples,
                thread_count(asked, points.count),
                [*inputs, *shaded.light, shaded.shown],
                self._device,
            )
        if light.air.wet > 0.0:
            with self._timings("reflect"):
                self._reflect(obs, points, told[0], told[2], earlier, int(light.air.moment), shaded)
        return shaded.shown, shaded

    def _live(self, points: FrameSamples, before: Any, air: Any, shaded: SampleLight) -> Any:
        """The samples whose light may be another than in the frame before."""
        base = points.base
        assert base is not None
        count, listed = self._list(base.count)
        inputs = [base.firsts, air, before, shaded.light[2], shaded.quiet, count, listed]
        launch(temporal_kernels.collect_dirty, base.firsts.size - 1, inputs, self._device)
        return listed_samples(count, listed, base.count)

    def _reflect(
        self, obs: Observation, points: FrameSamples, data: Any, air: Any, before: Any, moment: int, shaded: SampleLight
    ) -> None:
        """Put what wet ground mirrors into what is shown."""
        (out, gleam, _), rays, lens = shaded.light, shaded.rays, pinhole_of(obs.camera, 1)
        view = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
        rows, columns = -(-obs.camera.height // 2), -(-obs.camera.width // 2)
        span = columns if self._device == "cpu" else 1  # a GPU has threads to spare
        known = before if self._reuse.reflections else record(temporal_kernels.PreviousFrame(), self._device)
        inputs = [
            data,
            gleam,
            depth_on(obs, self._device),
            points.starts,
            view,
            lens,
            known,
            self._moved(obs),
            span,
            *rays,
        ]
        launch(reflection_kernels.trace_rays, rows * -(-columns // span), inputs, self._device)
        asked = all_samples()
        if before.told_of[0].known and self._reuse.reflections:
            asked = self._due(data, air, before, shaded)
        shaded.moment = moment
        inputs = [
            data,
            air,
            gleam,
            rays[0],
            depth_on(obs, self._device),
            points.starts,
            view,
            lens,
            before,
            record(asked, self._device),
        ]
        inputs += [out, shaded.sources, shaded.shown]
        launch(reflection_kernels.reflect, thread_count(asked, points.count), inputs, self._device)

    def _due(self, data: Any, air: Any, before: Any, shaded: SampleLight) -> Any:
        """The samples that mirror something else than in the frame before."""
        if shaded.mirrors is None:
            count, listed = self._list(shaded.kept)
            launch(
                reflection_reuse_kernels.collect_reflective,
                shaded.kept,
                [data, shaded.light[1], count, listed],
                self._device,
            )
            shaded.mirrors = wp.clone(listed[: int(count.numpy()[0])])
        count, listed = self._list(shaded.kept)
        inputs = [data, air, before, shaded.mirrors, shaded.moment, shaded.sources, count, listed]
        launch(reflection_reuse_kernels.stale_reflections, shaded.mirrors.size, inputs, self._device)
        return listed_samples(count, listed, shaded.kept)

    def _list(self, room: int) -> tuple[Any, Any]:
        """An empty list, which lasts until the next is asked for: its count, and room for so many samples."""
        if self._listed.size < room:
            self._listed = self._empty(room, wp.int32)
        return wp.zeros(1, dtype=wp.int32, device=self._device), self._listed

    def _moved(self, obs: Observation) -> Any:
        """How many tiles that something moving may touch lie above and to the left of each tile's corner."""
        if "moved" not in obs.derived:
            tile = int(TILE)
            counts = np.zeros((-(-obs.camera.height // tile) + 1, -(-obs.camera.width // tile) + 1), np.int32)
            counts[(obs.touched >> 16) // tile + 1, (obs.touched & 65535) // tile + 1] = 1
            sums = counts.cumsum(axis=0, dtype=np.int32).cumsum(axis=1, dtype=np.int32)
            obs.derived["moved"] = wp.array(sums, dtype=wp.int32, device=self._device)
        return obs.derived["moved"]

    def _begun(
        self,
        plan: CameraPlan,
        points: FrameSamples,
        name: str,
        light: Light,
        beams: Any,
        lamps: Any,
        lists: tuple[Any, ...],
    ) -> tuple[SampleLight, Any]:
        """Where the light of all samples goes; as far as it is that of an earlier frame, it is there already."""
        before, base = temporal_kernels.PreviousFrame(), points.base
        clouds = float(light.air.drift[0]), float(light.air.drift[1])
        held: SampleLight | None = base.lights.get(name) if base else None
        if held is not None and base is not None:
            tiles = lists[0].shape[0]
            before.tiles = self._empty(tiles, wp.int32)
            before.sky, before.known = int(held.clouds == clouds), base.count
            launch(tile_list_kernels.compare_lists, tiles, [lamps, *held.lists, *lists, before.tiles], self._device)
            needed = 1 + 2 * int(light.air.night > 0.0) + 4 * int(light.air.glow > 0.0)
            launch(shadow_kernels.mark_unshadowed, tiles, [*base.boxes, beams, needed, before.tiles], self._device)
            before.stirs = held.stirs
            found, held.lists, held.clouds = held, lists, clouds
        else:
            room, keep = points.count, 0
            if base is not None:
                room = base.columns.room
                # (A GPU is quicker to shade all anew than to tell what it need not.)
                few = len(base.lights) < _SAMPLE_LIGHT_CACHE_SIZE
                keep = base.count if few and self._device == "cpu" and self._reuse.light else 0
            found = self._room(plan, room, keep, lists, clouds, light.air.wet > 0.0)
        found.stirs = int(light.air.stirs)
        before.kept, before.stale = found.kept, found.levels[0]
        if base is not None and found.kept:
            base.lights[name] = found
        return found, before

    def _room(
        self, plan: CameraPlan, room: int, kept: int, lists: Any, clouds: tuple[float, float], wet: bool
    ) -> SampleLight:
        """Room for the light of so many samples, of which the first so many are kept, and for what follows from it."""
        empty, blocks = self._empty, -(-plan.width // 2) * -(-plan.height // 2)
        light = empty(room, wp.vec3f), empty(room, wp.vec2f), empty(room, wp.uint8)
        pixels = plan.width * plan.height if kept else 1
        levels = wp.full(pixels, 1, dtype=wp.uint8, device=self._device), empty(pixels, wp.vec3f)
        asked = wp.full(blocks, -1, dtype=wp.int32, device=self._device)
        rays = empty(blocks, wp.float32), asked, empty(blocks, wp.uint32)
        shown = empty(room, wp.vec3f) if wet else light[0]
        sources = wp.full(max(kept, 1) if wet else 1, wp.vec2i(-2, -1), dtype=wp.vec2i, device=self._device)
        quiet = wp.zeros(lists[0].shape[0], dtype=wp.uint8, device=self._device)
        return SampleLight(light, lists, clouds, kept, levels, rays, shown, sources, quiet)

    def _sunlit(self, obs: Observation, light: Light) -> Any:
        """The four shadow maps as kernels want them."""
        if light.sun[2] > 0.0 and float(light.sunlight.max()) > 0.0:
            eye, ahead = obs.world_from_sensor[:, 3], obs.world_from_sensor[:, 0]
            with self._timings("static shadows"):
                still = self._shadows.static(light.sun, eye)
            name = "moving shadows " + light.sun.tobytes().hex()  # weathers of one hour share them
            if name not in obs.derived:
                world = upload_transforms(world_from_parts(obs.parts), self._device)
                vertices = world_vertices(self._g, world, self._device)
                sheets = self._shadows.moving(light.sun, vertices, world, eye, ahead)
                obs.derived[name] = [sheet.beam for sheet in sheets]
                weakref.finalize(obs, self._shadows.give_back, sheets).atexit = False
            beams = [*still, *obs.derived[name]]
        else:
            beams = [self._shadows.none()] * 4
        return records(beams, self._device)

    def _nearby(self, obs: Observation, lit: bool) -> tuple[Any, ...]:
        """Lamps, if `lit`, and bodies, and their lists by tile; the same for all appearances that are lit alike."""
        name = "nearby by night" if lit else "nearby by day"
        if name not in obs.derived:
            world = world_from_parts(obs.parts)
            eye = obs.world_from_sensor[:, 3]
            lamps = lamps_at(self._g, world, eye, self._device) if lit else no_lamps(self._device)
            bodies = bodies_at(self._g, obs.parts, self._device)
            tile, most = int(TILE), int(tile_list_kernels.MAX_PER_TILE)
            tiles = -(-obs.camera.width // tile) * -(-obs.camera.height // tile)
            lists = [wp.zeros((tiles, most + 1), dtype=wp.int32, device=self._device) for _ in range(3)]
            view = upload_transforms(world_from_view(obs.world_from_sensor), self._device)
            told = [record(v, self._device) for v in (lamps, bodies)]
            inputs = [obs.keys, pinhole_of(obs.camera, 1), view, *told, *lists[:2]]
            launch(tile_list_kernels.cull_lights, tiles, inputs, self._device)
            view = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
            launch(
                fog_glow_kernels.cull_glows, tiles, [pinhole_of(obs.camera, 1), view, told[0], lists[2]], self._device
            )
            obs.derived[name] = (lamps, bodies, *lists)
        found: tuple[Any, ...] = obs.derived[name]
        return found

    def light_of(self, appearance: AppearancePlan, time: float) -> Light:
        """The light of an appearance at a time in seconds."""
        name = appearance.digest
        if name not in self._lights:
            if len(self._lights) >= _LIGHT_CACHE_SIZE:
                self._lights.clear()
            self._lights[name] = weather_light.light_of(appearance, self._device)
        drift(self._lights[name], time)
        return self._lights[name]

    def _looks_of(self, appearance: AppearancePlan) -> Any:
        name = appearance.colours
        if name not in self._looks:
            album = self._albums.of(appearance)
            self._looks = {name: surface_colours(self._g, appearance.looks.root, album, self._device)}
        return self._looks[name]

    def _empty(self, count: int, kind: Any) -> Any:
        return wp.empty(count, dtype=kind, device=self._device)
