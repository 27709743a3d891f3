"""From an Observation and an appearance to a picture: the host's side of shading, and the pipeline's second half.

Samples are placed and surveyed once for all appearances of a frame; then come shadows, nearby lamps and bodies,
shading, reflection on wet ground, rain and the camera. The light of an earlier frame of the same pose is left as it is
where it must be equal, so that remembering saves time and changes no byte.
"""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.plan import AppearancePlan, CameraPlan, CameraResponse

from recipe_runtime.render import camera, film, glow, nearby, rain, reflection, shade, shadow
from recipe_runtime.render.album import Albums
from recipe_runtime.render.atmosphere import Light, drift, light_of
from recipe_runtime.render.blur import Moment
from recipe_runtime.render.colours import looks_of
from recipe_runtime.render.device import launch, record, records, wp
from recipe_runtime.render.geometry import Geometry
from recipe_runtime.render.lamps import bodies_at, lamps_at, no_lamps
from recipe_runtime.render.observation import TILE
from recipe_runtime.render.observe import Observation, Observer, device_rows
from recipe_runtime.render.points import Points, Surveyor
from recipe_runtime.render.sunlight import Shadows, world_vertices
from recipe_runtime.render.timing import Timings
from recipe_runtime.render.view import lens_of, view_from_parts, world_from_parts, world_from_view
from recipe_runtime.transforms import Array

_EXPOSURE_TIME = 1.0 / 45.0  # seconds during which a drop leaves its streak
_DROPS = 32000  # at precipitation 100, in a cube
_RAIN_CUBE = 26.0  # metres along its side
_RAIN_DEPTH = 15.0  # metres from the camera within which drops are drawn
_LIGHTS_KEPT = 64
_LIGHTS_KEPT_BY_POSE = 16  # 20 MB each at 800 x 600


@dataclass(eq=False)
class Shaded:
    """One appearance's light on a base's samples."""

    light: tuple[Any, Any, Any]  # out, gleam and steady, as `shade.shade` writes them
    lists: tuple[Any, ...]  # lamps, bodies and glows by tile
    clouds: tuple[float, float]
    kept: int  # samples whose light stays for later frames
    levels: tuple[Any, Any]  # which pixels are stale, and what was developed of them before the noise
    rays: tuple[Any, Any, Any, Any]  # reach, asked, ways and renewed, as `reflection.march` writes them
    mirrored: tuple[Any, Any] | None = None  # sources and out, as `reflection.reflect` writes them, on wet ground
    moment: int = -1  # of the ripples there
    mirroring: NDArray[np.bool_] | None = None  # by kept sample; what a sample is made of decides, and that stays


class Painter:
    """Shades one scene's observations."""

    def __init__(
        self,
        geometry: Geometry,
        observer: Observer,
        albums: Albums,
        device: str,
        timings: Timings,
        keep_static: bool,
    ) -> None:
        self._albums = albums
        self._g, self._observer, self._device, self._timings = geometry, observer, device, timings
        self._shadows = Shadows(geometry, device)
        self._lights: dict[str, Light] = {}  # by the appearance's digest
        self._looks: dict[str, Any] = {}  # by the identity of the colours
        self._surveyor = Surveyor(geometry, observer, device, timings, keep_static)
        self._tables = film.Tables(device)

    def develop(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor: str,
        frame: int,
        time: float,
        moment: Moment | None = None,
    ) -> NDArray[np.uint8]:
        """8-bit sRGB [H, W, 3]; `moment` is a neighbouring frame, which motion blur takes."""
        response = appearance.responses.get(sensor) or CameraResponse()
        plate = film.plate_of(self._observer, obs, response.supersample)
        points = self._surveyor.points(plate, response.antialias)
        light = self._light_of(appearance, time)
        linear, shaded = self._shade(plate, points, appearance, sensor, light)
        with self._timings("rain"):
            drops = self._rain(plate, appearance.seed, light, time)
        with self._timings("develop"):
            r = film.response_of(response, light.exposure, keyed(appearance.seed, sensor, frame), obs.camera)
            streak = streak_of(light)
            inputs = [linear, points.starts, points.groups, points.weights, drops, streak, r]
            if film.needs_plate(obs.camera, response, moment):
                exposed = self._empty(plate.camera.width * plate.camera.height, wp.vec3f)
                launch(camera.expose, exposed.shape[0], [*inputs, exposed], self._device)
                told = [r, *self._tables.of(response)]
                out = film.finish(exposed, plate, obs, response, told, self._g, moment, self._device)
            else:
                out = wp.empty((r.width * r.height, 3), dtype=wp.uint8, device=self._device)
                inputs[-1] = record(r, self._device)
                inputs += [shaded.kept, *shaded.levels, *self._tables.straight(response, obs.camera)]
                launch(camera.develop, r.width * r.height, [*inputs, out], self._device)
            picture: NDArray[np.uint8] = out.numpy().reshape(r.height, r.width, 3)
        return picture

    def radiance(self, obs: Observation, appearance: AppearancePlan, time: float) -> NDArray[np.float32]:
        """Linear radiance at pixel centres, float32 [H, W, 3]."""
        points = self._surveyor.points(obs, antialias=False)
        linear, _ = self._shade(obs, points, appearance, "", self._light_of(appearance, time))
        values: NDArray[np.float32] = linear.numpy()[points.starts.numpy()]
        return values.reshape(obs.camera.height, obs.camera.width, 3)

    def _shade(
        self, obs: Observation, points: Points, appearance: AppearancePlan, sensor: str, light: Light
    ) -> tuple[Any, Shaded]:
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
            live = self._live(points, before, shaded.light[2])
            inputs = [*told[:3], beams, *told[3:], *lists, earlier]
            if live is None:
                launch(shade.shade, points.count, [*inputs, 0, points.starts, *shaded.light], self._device)
            else:
                launch(shade.shade, live.size, [*inputs, 1, live, *shaded.light], self._device)
        if light.air.wet <= 0.0:
            return shaded.light[0], shaded
        return self._reflect(obs, points, told[0], told[2], earlier, int(light.air.moment), shaded, live), shaded

    def _live(self, points: Points, before: Any, steady: Any) -> Any:
        """The samples whose light may change, where it is quicker to tell them than to ask all: on a CPU; else None."""
        base = points.base
        if self._device != "cpu" or base is None or before.known == 0:
            return None
        restless = steady.numpy()[: base.count] != int(shade.AT_REST)
        touched = (before.tiles.numpy() & int(shadow.UNTOUCHED)) == 0
        live = np.logical_or.reduceat(restless, base.firsts[:-1]) | touched
        counts = np.diff(base.firsts)[live]
        shifts = base.firsts[:-1][live] - (np.cumsum(counts) - counts)
        kept = np.repeat(shifts, counts) + np.arange(counts.sum())
        new = np.arange(base.count, points.count)
        return wp.array(np.concatenate([kept, new]).astype(np.int32), dtype=wp.int32, device=self._device)

    def _reflect(
        self, obs: Observation, points: Points, data: Any, air: Any, before: Any, moment: int, shaded: Shaded, live: Any
    ) -> Any:
        """The light of all samples, with what wet ground mirrors of it; `live` are those whose own light may change."""
        with self._timings("reflect"):
            (out, gleam, _), rays, lens = shaded.light, shaded.rays, lens_of(obs.camera, 1)
            if shaded.mirrored is None:
                shaded.mirrored = wp.full(out.size, -2, dtype=wp.int32, device=self._device), wp.empty_like(out)
            view = device_rows(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
            inputs = [data, gleam, self._depth(obs), points.starts, view, lens, before, self._moved(obs), *rays]
            launch(reflection.march, rays[0].size, inputs, self._device)
            inputs = [
                data,
                air,
                gleam,
                rays[0],
                points.starts,
                view,
                lens,
                before,
                shaded.moment,
                rays[3],
            ]
            shaded.moment = moment
            asked = None if live is None else self._mirroring(points, shaded, live)
            if asked is None:
                inputs += [0, points.starts, out, *shaded.mirrored]
                launch(reflection.reflect, points.count, inputs, self._device)
            else:
                inputs += [1, asked, out, *shaded.mirrored]
                launch(reflection.reflect, asked.size, inputs, self._device)
        return shaded.mirrored[1]

    def _mirroring(self, points: Points, shaded: Shaded, live: Any) -> Any:
        """The kept samples that mirror anything, and all `live` ones: the others' light is where it belongs already."""
        if shaded.mirroring is None:
            assert points.base is not None
            shaded.mirroring = shaded.light[1].numpy()[: points.base.count, 0] > 0.0
        asked, kept = live.numpy(), len(shaded.mirroring)
        told = np.zeros(kept, bool)
        told[asked[asked < kept]] = True
        rest = np.flatnonzero(shaded.mirroring & ~told)
        return wp.array(np.concatenate([rest, asked]).astype(np.int32), dtype=wp.int32, device=self._device)

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
        self, plan: CameraPlan, points: Points, name: str, light: Light, beams: Any, lamps: Any, lists: tuple[Any, ...]
    ) -> tuple[Shaded, Any]:
        """Where the light of all samples goes; as far as it is that of an earlier frame, it is there already."""
        before, base = shade.Before(), points.base
        clouds = float(light.air.drift[0]), float(light.air.drift[1])
        held: Shaded | None = base.lights.get(name) if base else None
        if held is not None and base is not None:
            tiles = lists[0].shape[0]
            before.tiles = self._empty(tiles, wp.int32)
            before.sky, before.known = int(held.clouds == clouds), base.count
            launch(nearby.compare, tiles, [lamps, *held.lists, *lists, before.tiles], self._device)
            needed = 1 + 2 * int(light.air.night > 0.0) + 4 * int(light.air.glow > 0.0)
            launch(shadow.calm, tiles, [*base.boxes, beams, needed, before.tiles], self._device)
            found, held.lists, held.clouds = held, lists, clouds
        else:
            room, keep = points.count, 0
            if base is not None:
                room = base.columns.room
                keep = base.count if len(base.lights) < _LIGHTS_KEPT_BY_POSE else 0
            found = self._room(plan, room, keep, lists, clouds)
        before.kept, before.stale = found.kept, found.levels[0]
        if base is not None and found.kept:
            base.lights[name] = found
        return found, before

    def _room(self, plan: CameraPlan, room: int, kept: int, lists: Any, clouds: tuple[float, float]) -> Shaded:
        """Room for the light of so many samples, of which the first so many are kept, and for what follows from it."""
        empty, blocks = self._empty, -(-plan.width // 2) * -(-plan.height // 2)
        light = empty(room, wp.vec3f), empty(room, wp.vec2f), empty(room, wp.uint8)
        pixels = plan.width * plan.height if kept else 1
        levels = wp.full(pixels, 1, dtype=wp.uint8, device=self._device), empty(pixels, wp.vec3f)
        rays = empty(blocks, wp.float32), wp.full(blocks, -1, dtype=wp.int32, device=self._device)
        return Shaded(light, lists, clouds, kept, levels, (*rays, empty(blocks, wp.uint32), empty(blocks, wp.uint8)))

    def _depth(self, obs: Observation) -> Any:
        """The observation's depth, on the device and row by row."""
        if "depth" not in obs.derived:
            obs.derived["depth"] = wp.array(obs.depth.reshape(-1), dtype=wp.float32, device=self._device, copy=False)
        return obs.derived["depth"]

    def _sunlit(self, obs: Observation, light: Light) -> Any:
        """The four shadow maps as kernels want them."""
        if light.sun[2] > 0.0 and float(light.sunlight.max()) > 0.0:
            eye, ahead = obs.world_from_sensor[:, 3], obs.world_from_sensor[:, 0]
            with self._timings("static shadows"):
                still = self._shadows.static(light.sun, eye)
            name = "moving shadows " + light.sun.tobytes().hex()  # weathers of one hour share them
            if name not in obs.derived:
                world = device_rows(world_from_parts(obs.parts), self._device)
                vertices = world_vertices(self._g, world, self._device)
                obs.derived[name] = self._shadows.moving(light.sun, vertices, world, eye, ahead)
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
            tile, most = int(TILE), int(nearby.MOST)
            tiles = -(-obs.camera.width // tile) * -(-obs.camera.height // tile)
            lists = [wp.zeros((tiles, most + 1), dtype=wp.int32, device=self._device) for _ in range(3)]
            view = device_rows(world_from_view(obs.world_from_sensor), self._device)
            told = [record(v, self._device) for v in (lamps, bodies)]
            inputs = [obs.keys, lens_of(obs.camera, 1), view, *told, *lists[:2]]
            launch(nearby.gather, tiles, inputs, self._device)
            view = device_rows(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
            launch(glow.gather, tiles, [lens_of(obs.camera, 1), view, told[0], lists[2]], self._device)
            obs.derived[name] = (lamps, bodies, *lists)
        found: tuple[Any, ...] = obs.derived[name]
        return found

    def _light_of(self, appearance: AppearancePlan, time: float) -> Light:
        name = appearance.digest
        if name not in self._lights:
            if len(self._lights) >= _LIGHTS_KEPT:
                self._lights.clear()
            self._lights[name] = light_of(appearance, self._device)
        drift(self._lights[name], time)
        return self._lights[name]

    def _looks_of(self, appearance: AppearancePlan) -> Any:
        name = appearance.colours
        if name not in self._looks:
            album = self._albums.of(appearance)
            self._looks = {name: looks_of(self._g, appearance.looks.root, album, self._device)}
        return self._looks[name]

    def _rain(self, obs: Observation, seed: int, light: Light, time: float) -> Any:
        cover = wp.zeros(obs.camera.width * obs.camera.height, dtype=wp.int32, device=self._device)
        if light.rain > 0.0:
            shower = shower_of(obs.world_from_sensor, light, time)
            shower.key = keyed(seed, "rain", 0)
            view = device_rows(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
            inputs = [record(shower, self._device), obs.keys, view, lens_of(obs.camera, 1), cover]
            launch(rain.streaks, shower.count, inputs, self._device)
        return cover

    def _empty(self, count: int, kind: Any) -> Any:
        return wp.empty(count, dtype=kind, device=self._device)


def shower_of(world_from_sensor: Array, light: Light, time: float) -> Any:
    """The rain about a camera: drops fall at 7 m/s, and the wind carries them along the world's x and y."""
    eye, ahead = world_from_sensor[:, 3], world_from_sensor[:, 0]
    fall = [3.0 * light.wind, 5.0 * light.wind, -7.0]
    rows = world_from_view(world_from_sensor)
    streak = [sum(float(rows[r, c]) * fall[r] for r in range(3)) * _EXPOSURE_TIME for c in range(3)]
    shower = rain.Shower()
    shower.count, shower.cube, shower.depth = int(_DROPS * light.rain), _RAIN_CUBE, _RAIN_DEPTH
    shower.low = wp.vec3d(*(float(e + (0.36 * a - 0.5) * _RAIN_CUBE) for e, a in zip(eye, ahead, strict=True)))
    shower.eye, shower.fall, shower.streak = wp.vec3d(*map(float, eye)), wp.vec3d(*fall), wp.vec3f(*streak)
    shower.time, shower.cover = time, 0.85
    return shower


def streak_of(light: Light) -> Any:
    """The radiance of a drop's streak."""
    return light.air.fog_colour * 1.15 + light.air.overhead * (0.25 + 0.8 * light.night)


def keyed(seed: int, name: str, frame: int) -> int:
    """A 32-bit key of a seed, a name and a frame."""
    digest = hashlib.sha256(f"{seed}/{name}/{frame}".encode()).digest()
    return int.from_bytes(digest[:4], "little")
