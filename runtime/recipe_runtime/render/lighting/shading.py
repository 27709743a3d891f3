"""The light of a frame's samples in one appearance: shadows, nearby lamps and bodies, shading, reflection.

For a static camera, samples whose light cannot have changed keep the radiance of an earlier frame (temporal reuse). The
caches and buffers of it are:

- `StaticSamples` (in `sampling`): the samples of the static scene, which frames from the same pose share;
- `SampleLight`, by pose, appearance and sensor: the radiances of the shared samples, overwritten in place, with the
  reuse class of each;
- `PreviousFrame`: what changed since the frame that wrote a `SampleLight`;
- `DirtySamples`: the samples that are shaded again; all others are not read.
"""

from __future__ import annotations

from recipe_compiler.ir.plan import AppearancePlan, CameraPlan

from recipe_runtime.core.timings import Timings
from recipe_runtime.render.atmosphere import weather_light
from recipe_runtime.render.atmosphere.weather_light import WeatherLight
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting import passes
from recipe_runtime.render.lighting.buffers import TileLists
from recipe_runtime.render.lighting.light_sources import LightSources
from recipe_runtime.render.lighting.passes import ShadingInputs
from recipe_runtime.render.lighting.reflection import ReflectionPass
from recipe_runtime.render.lighting.sample_light import SampleLight
from recipe_runtime.render.lighting.temporal import SampleList, all_samples, listed_samples, thread_count
from recipe_runtime.render.lighting.temporal_kernels import DirtySamples, PreviousFrame, collect_dirty
from recipe_runtime.render.lighting.tile_list_kernels import UNSHADOWED, compare_lists
from recipe_runtime.render.patches.patch_arrays import no_patches, patch_structs, texture_of
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.sampling.sampler import FrameSamples, StaticBase
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.shadow_kernels import mark_unshadowed
from recipe_runtime.render.texture.images import SurfaceColours
from recipe_runtime.render.texture.mipmaps import ImageAtlases
from recipe_runtime.render.texture.surface_colours import surface_colours

_LIGHT_CACHE_SIZE = 64
_SAMPLE_LIGHT_CACHE_SIZE = 16  # by pose; 20 MB each at 800 x 600


class ShadingPass:
    """Shades the samples of one scene's observations."""

    def __init__(
        self, geometry: Geometry, atlases: ImageAtlases, device: str, timings: Timings, reuse: TemporalReuse
    ) -> None:
        self._g, self._atlases, self._device, self._timings = geometry, atlases, device, timings
        self._reuse, self._list = reuse.light, SampleList(device)
        self._sources = LightSources(geometry, device, timings)
        self._reflection = ReflectionPass(device, reuse, self._list)
        self._lights: dict[str, WeatherLight] = {}  # by the appearance's digest
        self._colours: tuple[tuple[str, ...], SurfaceColours, DeviceArray] | None = None  # the last, by their identity
        self._no_patches = no_patches(device)

    def weather_light(self, appearance: AppearancePlan, time: float) -> WeatherLight:
        """Return the light of an appearance at a time in seconds since frame 0."""
        name = appearance.digest
        if name not in self._lights:
            if len(self._lights) >= _LIGHT_CACHE_SIZE:
                self._lights.clear()
            self._lights[name] = weather_light.initial_light(appearance, self._device)
        self._lights[name] = weather_light.light_at_time(self._lights[name], time)
        return self._lights[name]

    def shade(
        self,
        obs: Observation,
        points: FrameSamples,
        appearance: AppearancePlan,
        sensor: str,
        light: WeatherLight,
        frame: int,
    ) -> SampleLight:
        """Return the light of all samples of a frame in an appearance; `sensor` is the name of the camera."""
        lights = self.inputs(obs, appearance, light, frame)
        with self._timings("shade"):
            samples, air = struct_array([points.data], self._device), lights.air
            name = "" if any(patch.changes for patch in appearance.patches) else f"{appearance.digest} {sensor}"
            found, before = self._prepare(obs.camera, points, name, light, lights)
            previous = struct_array([before], self._device)
            dirty = self._dirty(points, previous, air, found) if before.shared_count else all_samples()
            threads = thread_count(dirty, points.count)
            passes.shade_samples(
                threads, samples, lights, previous, struct_array([dirty], self._device), found.light, self._device
            )
        if light.wet:
            with self._timings("reflect"):
                self._reflection.reflect(obs, points, samples, air, previous, int(before.shared_count), found)
            found.ring_step = int(light.air.ring_step)
        return found

    def inputs(self, obs: Observation, appearance: AppearancePlan, light: WeatherLight, frame: int) -> ShadingInputs:
        """Return what shading reads besides the samples of an observation."""
        with self._timings("shadows"):
            beams = self._sources.beams(obs, light)
        with self._timings("cull lights"):
            nearby = self._sources.nearby(obs, light.lamps_burn)
        with self._timings("shade"):
            surface_colours, patches = self._colours_of(appearance, frame)
            air, colours = (struct_array([v], self._device) for v in (light.air, surface_colours))
        return ShadingInputs(colours, patches, air, beams, nearby.lamps, nearby.bodies, nearby.lists)

    def _dirty(self, points: FrameSamples, previous: DeviceArray, air: DeviceArray, found: SampleLight) -> DirtySamples:
        """Return the samples whose light may have changed since the earlier frame."""
        assert points.base is not None
        count, listed = self._list.begin(points.base.count)
        launch(
            collect_dirty,
            points.base.firsts.size - 1,
            self._device,
            firsts=points.base.firsts,
            air=air,
            previous=previous,
            reuse_class=found.light.reuse_class,
            out_quiet=found.quiet,
            out_count=count,
            out_samples=listed,
        )
        return listed_samples(count, listed, points.base.count)

    def _prepare(
        self, camera: CameraPlan, points: FrameSamples, name: str, light: WeatherLight, lights: ShadingInputs
    ) -> tuple[SampleLight, PreviousFrame]:
        """Return the buffers for the light, and what changed since the frame whose light they contain.

        `name` is equal for frames of equal colours; empty: no other frame has these.
        """
        before, base = PreviousFrame(), points.base
        clouds = float(light.air.drift[0]), float(light.air.drift[1])
        shadows = float(light.air.shadow_drift[0]), float(light.air.shadow_drift[1])
        cached = base.lights.get(name) if base is not None else None
        if cached is not None and base is not None and cached.cloud_shadows != shadows:
            del base.lights[name]
            cached = None
        if cached is not None and base is not None:
            before.tiles = self._compared_tiles(cached.lists, base, light, lights)
            set_fields(before, sky=int(cached.clouds == clouds), shared_count=base.count, leaf_step=cached.leaf_step)
            found, cached.lists, cached.clouds = cached, lights.lists, clouds
        else:
            capacity, kept = points.count, 0
            if base is not None:
                # (On a GPU it is quicker to shade all samples than to find the dirty ones.)
                capacity, room = base.columns.capacity, len(base.lights) < _SAMPLE_LIGHT_CACHE_SIZE
                kept = base.count if room and name and self._device == "cpu" and self._reuse else 0
            found = SampleLight.empty(
                camera,
                capacity,
                kept,
                lights.lists,
                clouds,
                shadows,
                light.wet,
                float(light.air.night) > 0.0,
                self._device,
            )
        found.leaf_step = int(light.air.leaf_step)
        set_fields(before, kept_count=found.kept, stale=found.pixels.stale)
        lamps = {"lamp_light": found.lamps.light, "lamp_shine": found.lamps.shine, "lamp_known": found.lamps.known}
        set_fields(before, **lamps)
        if base is not None and found.kept:
            base.lights[name] = found
        return found, before

    def _compared_tiles(
        self, lists_before: TileLists, base: StaticBase, light: WeatherLight, lights: ShadingInputs
    ) -> DeviceArray:
        """Return by tile which static light cannot have changed: the bits of `compare_lists` and `mark_unshadowed`."""
        lists, (lows, highs) = lights.lists, base.boxes
        bits = wp.empty(lists.tiles, dtype=wp.int32, device=self._device)
        boxes = {"lows": lows, "highs": highs, "out_bits": bits}
        launch(
            compare_lists,
            lists.tiles,
            self._device,
            lamps=lights.lamps,
            lamps_before=lists_before.lamps,
            bodies_before=lists_before.bodies,
            glows_before=lists_before.glows,
            lamp_lists=lists.lamps,
            body_lists=lists.bodies,
            glow_lists=lists.glows,
            **boxes,
        )
        needed = 1 + (2 + int(UNSHADOWED)) * int(light.air.night > 0.0) + 4 * int(light.air.glow_share > 0.0)
        launch(mark_unshadowed, lists.tiles, self._device, beams=lights.beams, needed_bits=needed, **boxes)
        return bits

    def patches_of(self, appearance: AppearancePlan, frame: int) -> DeviceArray:
        """The patches of an appearance in a frame, a record of `PatchArrays`."""
        return self._colours_of(appearance, frame)[1]

    def _colours_of(self, appearance: AppearancePlan, frame: int) -> tuple[SurfaceColours, DeviceArray]:
        shown = [texture for patch in appearance.patches if (texture := texture_of(patch, frame)) is not None]
        name = appearance.colours, *(texture.file.sha256 for texture in shown)
        if self._colours is None or name != self._colours[0]:
            atlas, device = self._atlases.of(appearance, shown), self._device
            colours = surface_colours(self._g, appearance.looks.root, atlas.images, device)
            patches = self._no_patches
            if appearance.patches:
                patches = patch_structs(self._g, appearance.patches, atlas.numbers, frame, device)
            self._colours = name, colours, patches
        return self._colours[1:]
