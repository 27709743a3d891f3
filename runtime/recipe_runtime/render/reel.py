"""A reel: many frames of one camera, drawn without a stop for the host to look at one.

What `observe` and `picture` do step by step, with sizes that are read back on the way, a lane does in one recorded
piece: every array has its place beforehand, every number that changes from frame to frame stands in one block of
memory, and a CUDA graph replays the kernels. Several lanes, each with a frame of its own, keep a GPU busy. On the CPU
a lane runs the same kernels one by one, which is how tests hold it to the bytes of `Renderer`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.plan import AppearancePlan, CameraPlan, CameraResponse, SensorPlan

from recipe_runtime.render import (
    bands,
    camera,
    film,
    glow,
    lamps,
    nearby,
    observation,
    rain,
    recall,
    reflection,
    samples,
    shade,
    shadow,
    slots,
    visibility,
)
from recipe_runtime.render.album import Albums
from recipe_runtime.render.atmosphere import Light, drift, light_of
from recipe_runtime.render.block import Block, span_of
from recipe_runtime.render.colours import looks_of
from recipe_runtime.render.device import launch, record, records, wp
from recipe_runtime.render.geometry import CHUNK, Geometry
from recipe_runtime.render.lens import curve_of
from recipe_runtime.render.observe import Observation, all_tiles, objects_of
from recipe_runtime.render.picture import every_sample, keyed, shower_of, streak_of
from recipe_runtime.render.sunlight import Shadows, Sheet, about
from recipe_runtime.render.view import lens_of, view_from_parts, world_from_parts, world_from_view
from recipe_runtime.transforms import Array

_CHUNK = 8  # frames whose numbers are made at once, while those of before are drawn
_BANDS = 1 << 17  # of large triangles that a list holds
_EDGES = 0.5  # samples at edges that there is room for at first, a pixel


@dataclass(frozen=True)
class Take:
    """What a reel is to show: frames by number, each with its time, the sensor's pose and the parts' transforms."""

    numbers: Sequence[int]
    times: Sequence[float]  # seconds
    poses: Array  # [F, 3, 4] world from sensor
    parts: Array  # [F, P, 3, 4] world from part


@dataclass(frozen=True)
class Print:
    """A frame of a reel: its observation, and a picture [H, W, 3] for every appearance.

    The arrays are the lane's: they hold until the next frame is asked for.
    """

    number: int
    observation: Observation
    pictures: tuple[NDArray[np.uint8], ...]


@dataclass(frozen=True)
class _Look:
    """An appearance, made ready for a camera."""

    plan: AppearancePlan
    light: Light
    looks: Any
    response: CameraResponse
    tables: tuple[Any, Any, Any]  # the lens's gains, the levels and the deviates
    sun: int  # place among the reel's suns; -1: none shines

    @property
    def lit(self) -> bool:
        """Whether lamps are seen to burn."""
        return float(self.light.air.night) > 0.0 or float(self.light.air.glow) > 0.0

    @property
    def wet(self) -> bool:
        return float(self.light.air.wet) > 0.0


class Reel:
    """Draws frames of one camera in some appearances that agree on antialiasing."""

    def __init__(
        self,
        geometry: Geometry,
        shadows: Shadows,
        albums: Albums,
        device: str,
        camera_plan: CameraPlan,
        sensor: str,
        appearances: Sequence[AppearancePlan],
        lanes: int = 16,
    ) -> None:
        self.g, self.device, self.camera, self.sensor = geometry, device, camera_plan, sensor
        self.shadows, self._albums = shadows, albums
        self._tables = film.Tables(device)
        self.suns: list[NDArray[np.float64]] = []
        self.looks = [self._look(plan) for plan in appearances]
        smooth = {look.response.antialias for look in self.looks} or {False}
        if len(smooth) != 1:
            raise ValueError("the appearances of a reel are antialiased all or none")
        self.side = 2 if smooth.pop() else 1
        self.dark = records([shadows.none()] * 4, device)
        self.pixels = camera_plan.width * camera_plan.height
        self.tiles = wp.array(all_tiles(camera_plan), dtype=wp.int32, device=device)
        self.room = self.pixels + (int(_EDGES * self.pixels) if self.side == 2 else 0)
        self.block = _layout(self)
        self._beams: list[Any] = []  # static shadow maps that frames under way may look into
        self._lanes = [Lane(self) for _ in range(lanes)]

    def frames(self, take: Take) -> Iterator[Print]:
        """The frames, in their order."""
        waiting: list[tuple[Lane, int]] = []
        for start in range(0, len(take.numbers), _CHUNK):
            stop = min(start + _CHUNK, len(take.numbers))
            rows = self._rows(take, start, stop)
            for index in range(start, stop):
                if len(waiting) == len(self._lanes):
                    yield self._ready(take, *waiting.pop(0))
                lane = self._lanes[index % len(self._lanes)]
                lane.start(rows[index - start])
                waiting.append((lane, index))
        for lane, index in waiting:
            yield self._ready(take, lane, index)

    def _ready(self, take: Take, lane: Lane, index: int) -> Print:
        """A lane's frame, once it is done; with more room, if it had too little."""
        lane.wait()
        if lane.wanted > lane.room:
            self.room = max(self.room, lane.wanted + lane.wanted // 8)
            lane.rebuild()
            lane.wait()
        return lane.print(take.numbers[index], take.poses[index], take.parts[index])

    def _look(self, plan: AppearancePlan) -> _Look:
        light, response = light_of(plan, self.device), plan.responses.get(self.sensor) or CameraResponse()
        sun = -1
        if light.sun[2] > 0.0 and float(light.sunlight.max()) > 0.0:
            known = [bool((light.sun == other).all()) for other in self.suns]
            if not any(known):
                self.suns.append(light.sun)
            sun = known.index(True) if any(known) else len(self.suns) - 1
        looks = record(looks_of(self.g, plan.looks.root, self._albums.of(plan), self.device), self.device)
        return _Look(plan, light, looks, response, self._tables.straight(response, self.camera), sun)

    def _rows(self, take: Take, start: int, stop: int) -> NDArray[np.uint8]:
        """The blocks of some frames, but for what is a lane's own."""
        poses, parts, put = take.poses[start:stop], take.parts[start:stop], self.block.put
        rows = self.block.rows(stop - start)
        world, eyes = world_from_parts(parts), poses[:, :, 3]
        put(rows, "view", view_from_parts(poses, parts))
        put(rows, "world", world)
        put(rows, "back", world_from_view(poses))
        for name, column in zip(lamps.LAMP_NAMES, lamps.lamp_columns(self.g, world, eyes), strict=True):
            put(rows, f"lamps {name}", column)
        for name, column in zip(lamps.BODY_NAMES, lamps.body_columns(self.g, parts), strict=True):
            put(rows, f"bodies {name}", column)
        put(rows, "samples", eyes, span_of(shade.Samples, "eye")[0])
        held: list[Any] = []
        for row, pose in zip(rows, poses, strict=True):
            for n, sun in enumerate(self.suns):
                still = self.shadows.static(sun, pose[:, 3])
                held += still
                moving = about(sun, pose[:, 3], pose[:, 0])
                self.block.put_records(row, f"beams {n}", [*still, *moving])
        for v, look in enumerate(self.looks):
            for row, pose, number, time in zip(
                rows, poses, take.numbers[start:stop], take.times[start:stop], strict=True
            ):
                drift(look.light, time)
                self.block.put_records(row, f"air {v}", [look.light.air])
                if look.light.rain > 0.0:
                    shower = shower_of(pose, look.light, time)
                    shower.key = keyed(look.plan.seed, "rain", 0)
                    self.block.put_records(row, f"shower {v}", [shower])
                self.block.put_records(row, f"response {v}", [self._response(look, number)])
        under_way = _CHUNK + len(self._lanes)
        self._beams = (self._beams + held)[-2 * under_way * max(len(self.suns), 1) :]
        if self.device != "cpu":
            wp.synchronize_stream(wp.get_stream(self.device))  # static shadows are drawn there
        return rows

    def _response(self, look: _Look, number: int) -> Any:
        key = keyed(look.plan.seed, self.sensor, number)
        return film.response_of(look.response, look.light.exposure, key, self.camera)


def _layout(reel: Reel) -> Block:
    """What changes from frame to frame, and where it stands."""
    parts, eye, none = 1 + reel.g.parts, np.zeros((1, 3)), np.zeros((1, reel.g.parts, 3, 4))
    block = Block()
    block.add("view", wp.float32, (parts, 12))
    block.add("world", wp.float32, (parts, 12))
    block.add("back", wp.float32, (1, 12))
    columns = lamps.lamp_columns(reel.g, np.zeros((1, parts, 3, 4)), eye)
    for name, kind, column in zip(lamps.LAMP_NAMES, lamps.LAMP_KINDS, columns, strict=True):
        block.add(f"lamps {name}", kind, (column.shape[1],))
    columns = lamps.body_columns(reel.g, none)
    for name, kind, column in zip(lamps.BODY_NAMES, lamps.BODY_KINDS, columns, strict=True):
        block.add(f"bodies {name}", kind, (column.shape[1],))
    block.add("samples", shade.Samples, (1,))
    for n in range(len(reel.suns)):
        block.add(f"beams {n}", shadow.Sunbeam, (4,))
    for v in range(len(reel.looks)):
        block.add(f"air {v}", type_of(reel.looks[v].light.air), (1,))
        block.add(f"shower {v}", rain.Shower, (1,))
        block.add(f"response {v}", camera.Response, (1,))
    return block


def type_of(value: Any) -> Any:
    """The kernel's type of a record."""
    return value._cls


class Lane:
    """Room for one frame, and the kernels that fill it."""

    def __init__(self, reel: Reel) -> None:
        self.reel, self.device, self.room = reel, reel.device, reel.room
        self._cuda = reel.device != "cpu"
        self._stream = wp.Stream(reel.device) if self._cuda else None
        self._done = wp.Event(reel.device) if self._cuda else None
        self._allocate()

    @property
    def wanted(self) -> int:
        """Slots that the last frame would have filled."""
        return self.reel.pixels + int(self._host["cursor"][0])

    def start(self, row: NDArray[np.uint8]) -> None:
        """Draw the frame of a block."""
        if self.room < self.reel.room:
            self._allocate()
        self._row = row
        self._run()

    def rebuild(self) -> None:
        """Draw the frame once more, with the room that the reel has now."""
        self._allocate()
        self._run()

    def wait(self) -> None:
        """Until the frame is in the host's memory."""
        if self._cuda:
            wp.synchronize_event(self._done)

    def print(self, number: int, pose: Array, parts: Array) -> Print:
        """The frame that is done."""
        h, shape = self._host, (self.reel.camera.height, self.reel.camera.width)
        depth, instance, semantic = (h[name].reshape(shape) for name in ("depth", "instance", "semantic"))
        visible, amodal, projected = h["extents"][:3]
        objects = objects_of(self.reel.g, visible, amodal, projected)
        seen = Observation(
            depth,
            instance,
            semantic,
            objects,
            self.reel.camera,
            pose,
            parts,
            None,
            None,
            None,
            b"",
            np.zeros(0, np.int32),
        )
        pictures = tuple(h[f"rgb {v}"].reshape(*shape, 3) for v in range(len(self.reel.looks)))
        return Print(number, seen, pictures)

    def _run(self) -> None:
        self._numbers[:] = self._row
        np.copyto(self._numbers, self._own, where=self._is_own)
        if self._cuda:
            with wp.ScopedStream(self._stream, sync_enter=False):
                wp.capture_launch(self._graph)
                wp.record_event(self._done)
        else:
            self._draw()

    def _allocate(self) -> None:
        """All arrays, and on a GPU the recording."""
        reel, device = self.reel, self.device
        if self._cuda:
            wp.synchronize_stream(self._stream)
        self.room, actors = reel.room, max(len(reel.g.actors), 1)
        self._pinned = wp.zeros(reel.block.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._numbers: NDArray[np.uint8] = self._pinned.numpy()
        self._block = wp.zeros(reel.block.size, dtype=wp.uint8, device=device)
        self._out_layout = Block()
        for name, kind, shape in _results(reel, actors):
            self._out_layout.add(name, kind, shape)
        self._out = wp.zeros(self._out_layout.size, dtype=wp.uint8, device=device)
        self._out_host = wp.zeros(self._out_layout.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._r = self._out_layout.arrays(self._out)
        self._host = self._out_layout.views(self._out_host.numpy())
        self._b = reel.block.arrays(self._block)
        self._room()
        self._records()
        extents = np.zeros((4, actors, 5), np.int32)
        extents[..., 1:3], extents[..., 3:5] = 1 << 30, -(1 << 30)
        self._no_extents = wp.array(extents, dtype=wp.int32, device=device)
        if self._cuda:
            self._record_graph()

    def _record_graph(self) -> None:
        with wp.ScopedStream(self._stream):
            wp.capture_begin(self.device, stream=self._stream)
            try:
                self._draw()
            finally:
                self._graph = wp.capture_end(self.device, stream=self._stream)
        wp.synchronize_stream(self._stream)

    def _room(self) -> None:
        reel, size, device = self.reel, self.reel.tiles.size * int(observation.TILE_PIXELS), self.device

        def zeros(count: int, kind: Any) -> Any:
            return wp.zeros(count, dtype=kind, device=device)

        self._vertices, self._world = zeros(reel.g.vertex_count, wp.vec3f), zeros(reel.g.vertex_count, wp.vec3f)
        self._coarse = zeros(reel.pixels, wp.uint64)
        self._fine = zeros(reel.pixels * 4, wp.uint64) if reel.side == 2 else self._coarse
        self._bits, self._bands, self._taken = (
            zeros(reel.pixels, wp.uint64),
            zeros(_BANDS, wp.uint64),
            zeros(1, wp.int32),
        )
        self._counts, self._firsts = zeros(size, wp.int32), zeros(size, wp.int32)
        self._wanted, self._stretches = zeros(reel.tiles.size, wp.int32), zeros(reel.tiles.size, wp.int32)
        self._groups, self._starts = zeros(reel.pixels, wp.int32), zeros(reel.pixels, wp.int32)
        room = self.room + 4
        self._keys, self._of_pixel, self._places = zeros(room, wp.uint64), zeros(room, wp.int32), zeros(room, wp.int32)
        self._weights, self._of_tile = zeros(room, wp.float32), zeros(room, wp.int32)
        self._surfaces, self._codes = zeros(room, wp.int32), zeros(room, wp.uint32)
        self._positions, self._normals = zeros(room, wp.vec3f), zeros(room, wp.vec3f)
        self._details = zeros(room, wp.vec4f)
        self._light, self._shown = zeros(room, wp.vec3f), zeros(room, wp.vec3f)
        self._gleam, self._known = zeros(room, wp.vec2f), zeros(room, wp.uint8)
        blocks = -(-reel.camera.width // 2) * -(-reel.camera.height // 2)
        self._reach, self._asked, self._ways = (zeros(blocks, kind) for kind in (wp.float32, wp.int32, wp.uint32))
        self._sources = zeros(1, wp.int32)
        self._nothing_moved = wp.zeros((1, 1), dtype=wp.int32, device=device)
        self._no_levels = 0, zeros(1, wp.uint8), zeros(1, wp.vec3f)
        self._cover, self._dry = zeros(reel.pixels, wp.int32), zeros(1, wp.int32)
        lists = (reel.tiles.size, int(nearby.MOST) + 1)
        kinds = {look.lit for look in reel.looks}
        self._lists = {lit: [wp.zeros(lists, dtype=wp.int32, device=device) for _ in range(3)] for lit in kinds}
        self._seen = zeros(max(reel.g.chunk_count, 1), wp.int32)
        here, ahead = np.zeros(3), np.array([1.0, 0.0, 0.0])
        self._maps = [
            [Sheet(beam, reel.g, device, zeros(beam.size * beam.size, wp.uint64)) for beam in about(sun, here, ahead)]
            for sun in reel.suns
        ]

    def _records(self) -> None:
        """What of the block and the records is this lane's own: addresses."""
        reel, b, g, device = self.reel, self._b, self.reel.g, self.device
        scene = samples.Scene()
        scene.view, scene.normals, scene.uvs = self._vertices, g.normals, g.uvs
        scene.vertex_part, scene.triangles, scene.face_normals = g.vertex_part, g.triangles, g.face_normals
        scene.triangle_surface, scene.surface_pattern = g.triangle_surface, g.surface_pattern
        scene.world_from_part, scene.world_from_view = b["world"], b["back"]
        self._scene = record(scene, device)
        self._nothing_still, self._nothing_before = record(samples.Still(), device), record(recall.Before(), device)
        self._all = record(every_sample(), device)
        lit = lamps.lamps_of(g, [b[f"lamps {name}"] for name in lamps.LAMP_NAMES], device)
        self._lamps = {True: record(lit, device), False: record(lamps.no_lamps(device), device)}
        columns = [b[f"bodies {name}"] for name in lamps.BODY_NAMES]
        self._bodies = record(lamps.bodies_of(columns, columns[0].size), device)
        data = shade.Samples()
        data.surfaces, data.positions, data.normals = self._surfaces, self._positions, self._normals
        data.details, data.codes, data.pixels = self._details, self._codes, self._of_pixel
        data.tiles = self._of_tile
        self._own, self._is_own = reel.block.rows(1)[0], np.zeros(reel.block.size, bool)
        reel.block.put_records(self._own, "samples", [data])
        reel.block.mark(self._is_own, "samples", 0, span_of(shade.Samples, "eye")[0])
        for n, maps in enumerate(self._maps):
            for k, room in enumerate(maps, start=2):
                reel.block.put_records(self._own, f"beams {n}", [room.beam], at=k)
                for name in ("depths", "bounds"):
                    reel.block.mark(self._is_own, f"beams {n}", *span_of(shadow.Sunbeam, name), at=k)

    def _draw(self) -> None:
        """All kernels of a frame, in order."""
        wp.copy(self._block, self._pinned)
        self._observe()
        if self.reel.looks:
            self._place()
            self._shadow()
            self._near()
            for v, look in enumerate(self.reel.looks):
                self._shade(v, look)
        wp.copy(self._out_host, self._out)

    def _observe(self) -> None:
        reel, g, r, lens = self.reel, self.reel.g, self._r, lens_of(self.reel.camera, 1)
        inputs = [g.vertices, g.vertex_part, self._b["view"], 0, self._vertices]
        launch(visibility.transform, g.vertex_count, inputs, self.device)
        boxes = [g.chunks, g.chunk_centres, g.chunk_halves]
        launch(visibility.cull, g.chunk_count, [*boxes, self._b["view"], lens, self._seen], self.device)
        self._raster(self._coarse, 1)
        wp.copy(r["extents"].flatten(), self._no_extents.flatten())
        tables = [g.triangle_surface, g.surface_actor, g.surface_instance, g.surface_tag]
        out = [r["depth"], r["instance"], r["semantic"], r["extents"][0]]
        size = reel.tiles.size * int(observation.TILE_PIXELS)
        launch(observation.label, size, [reel.tiles, self._coarse, *tables, lens, *out], self.device)
        first = g.static_triangles
        for start in range(0, len(g.actors), 64):
            self._raster(self._bits, 1, g.static_chunks, start)
            actors = min(64, len(g.actors) - start)
            inputs = [reel.tiles, self._bits, lens, start, actors, r["extents"][1]]
            launch(observation.amodal, size, inputs, self.device)
        if g.triangle_count > first:
            tables = [self._vertices, g.triangles, g.triangle_surface, g.surface_actor, first, lens]
            inputs = [*tables, curve_of(reel.camera), r["extents"][2], r["extents"][3]]
            launch(observation.project_box, g.triangle_count - first, inputs, self.device)

    def _raster(self, keys: Any, side: int, first: int = 0, actor: int = -1) -> None:
        g, lens = self.reel.g, lens_of(self.reel.camera, side)
        keys.zero_()
        self._taken.zero_()
        tables, lists = [g.triangle_surface, g.surface_actor, actor], [lens, keys, self._bands, self._taken]
        inputs = [self._vertices, g.triangles, g.chunks, self._seen, first, *tables, *lists]
        launch(bands.sort, (g.chunk_count - first) * CHUNK, inputs, self.device)
        threads = int(bands.CREWS) * int(bands.CREW)
        launch(bands.fill, threads, [self._vertices, g.triangles, *tables, *lists], self.device)

    def _place(self) -> None:
        """Samples, as `points` places and surveys them, but in slots."""
        reel, size = self.reel, self.reel.tiles.size * int(observation.TILE_PIXELS)
        lens, cursor = lens_of(reel.camera, reel.side), self._r["cursor"]
        if reel.side == 2:
            self._raster(self._fine, 2)
        keys = [self._coarse, self._fine]
        grouped = [lens, self._scene, self._nothing_still, self._groups, self._starts, self._counts]
        launch(samples.count, size, [reel.tiles, *keys, *grouped], self.device)
        self._wanted.zero_()
        cursor.zero_()
        launch(slots.rank, size, [self._counts, self._firsts, self._wanted], self.device)
        launch(slots.reserve, reel.tiles.size, [self._wanted, self._stretches, cursor], self.device)
        inputs = [reel.tiles, lens, self._stretches, self.room, self._counts, self._firsts]
        launch(slots.settle, size, inputs, self.device)
        self._of_pixel.fill_(-1)
        self._of_tile.fill_(-1)
        places = [lens, self._scene, self._groups, self._starts]
        out = [self._keys, self._of_pixel, self._places, self._weights, self._of_tile]
        launch(samples.place, size, [reel.tiles, *keys, self._counts, self._firsts, *places, *out], self.device)
        lens = lens_of(reel.camera, 1)
        inputs = [0, self._keys, self._of_pixel, self._places, lens, self._scene]
        out = [self._surfaces, self._positions, self._normals, self._details, self._codes]
        launch(samples.survey, self.room, [*inputs, *out], self.device)

    def _shadow(self) -> None:
        g = self.reel.g
        count = g.vertex_count - g.static_vertices
        if not self.reel.suns:
            return
        inputs = [g.vertices, g.vertex_part, self._b["world"], g.static_vertices, self._world]
        launch(visibility.transform, count, inputs, self.device)
        for n, maps in enumerate(self._maps):
            for k, sheet in enumerate(maps, start=2):
                beam, first = self._b[f"beams {n}"][k : k + 1], g.static_chunks
                sheet.clear()
                sheet.draw(beam, self._world, self._b["world"], first, g.chunk_count - first)

    def _near(self) -> None:
        reel, lens = self.reel, lens_of(self.reel.camera, 1)
        for lit, lists in self._lists.items():
            inputs = [self._coarse, lens, self._b["back"], self._lamps[lit], self._bodies, *lists[:2]]
            launch(nearby.gather, reel.tiles.size, inputs, self.device)
            inputs = [lens, self._b["view"], self._lamps[lit], lists[2]]
            launch(glow.gather, reel.tiles.size, inputs, self.device)

    def _shade(self, v: int, look: _Look) -> None:
        reel, b, lens = self.reel, self._b, lens_of(self.reel.camera, 1)
        data, air = b["samples"], b[f"air {v}"]
        beams = b[f"beams {look.sun}"] if look.sun >= 0 else reel.dark
        inputs = [data, look.looks, air, beams, self._lamps[look.lit], self._bodies, *self._lists[look.lit]]
        shown = self._shown if look.wet else self._light
        out = [self._light, self._gleam, self._known, shown]
        launch(shade.shade, self.room, [*inputs, self._nothing_before, self._all, *out], self.device)
        if look.wet:
            inputs = [data, self._gleam, self._r["depth"], self._starts, b["view"], lens, self._nothing_before]
            inputs += [self._nothing_moved, 1, self._reach, self._asked, self._ways]
            launch(reflection.march, self._reach.size, inputs, self.device)
            inputs = [data, air, self._gleam, self._reach, self._starts, b["view"], lens]
            inputs += [self._nothing_before, self._all, self._light, self._sources, shown]
            launch(reflection.reflect, self.room, inputs, self.device)
        cover = self._dry
        if look.light.rain > 0.0:
            cover = self._cover
            cover.zero_()
            count = int(shower_of(np.zeros((3, 4)), look.light, 0.0).count)
            inputs = [b[f"shower {v}"], self._r["depth"], b["view"], lens, cover]
            launch(rain.streaks, count, inputs, self.device)
        streak = streak_of(look.light)
        inputs = [shown, self._starts, self._groups, self._weights, cover, streak, b[f"response {v}"]]
        inputs += self._no_levels
        launch(camera.develop, reel.pixels, [*inputs, *look.tables, 1, self._r[f"rgb {v}"]], self.device)


def _results(reel: Reel, actors: int) -> list[tuple[str, Any, tuple[int, ...]]]:
    """What a frame leaves behind."""
    labels = [("depth", wp.float32), ("instance", wp.uint16), ("semantic", wp.uint8)]
    return [
        *((name, kind, (reel.pixels,)) for name, kind in labels),
        ("extents", wp.int32, (4, actors, 5)),
        ("cursor", wp.int32, (1,)),
        *((f"rgb {v}", wp.uint8, (reel.pixels * 3,)) for v in range(len(reel.looks))),
    ]


def takes(sensor: SensorPlan, appearances: Sequence[AppearancePlan]) -> bool:
    """Whether a reel can draw a sensor in these: its camera a plain one, which makes bytes of samples in one kernel."""
    responses = [plan.responses.get(sensor.name) or CameraResponse() for plan in appearances]
    plain = all(not film.needs_plate(sensor.camera, r, None) and r.motion_blur_intensity == 0.0 for r in responses)
    return plain and len({r.antialias for r in responses}) <= 1
