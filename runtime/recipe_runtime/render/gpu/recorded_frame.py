"""A lane: room for one frame of a reel, and the kernels that fill it, one after the other.

What `observe` and `picture` do step by step, with sizes that are read back on the way, a lane does in one recorded
piece: every array has its place beforehand, every number that changes from frame to frame stands in one block of
memory, and on a GPU a CUDA graph replays the kernels. On the CPU it runs the same kernels one by one, which is how
tests hold it to the bytes of `Renderer`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.camera import develop_kernels, rain_kernels
from recipe_runtime.render.camera.rain import rain_at, streak_radiance
from recipe_runtime.render.device.arrays import record
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.memory_layout import MemoryLayout, span_of
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting import (
    fog_glow_kernels,
    lights,
    reflection_kernels,
    shading_kernels,
    shadow_kernels,
    temporal_kernels,
    tile_list_kernels,
)
from recipe_runtime.render.lighting.shadow_maps import ShadowMap, moving_beams
from recipe_runtime.render.lighting.temporal import all_samples
from recipe_runtime.render.lighting.weather_light import Light
from recipe_runtime.render.raster import bin_kernels, label_kernels, visibility_kernels
from recipe_runtime.render.raster.distortion import distortion_of
from recipe_runtime.render.raster.observation import Observation, objects_of
from recipe_runtime.render.sampling import sample_kernels, slot_kernels
from recipe_runtime.render.scene.camera import pinhole_of
from recipe_runtime.render.scene.geometry import CHUNK, Geometry

_BIN_CAPACITY = 1 << 17  # of large triangles that a list holds


@dataclass(frozen=True)
class ShadedAppearance:
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
        """Whether ground mirrors anything."""
        return float(self.light.air.wet) > 0.0


@dataclass
class StreamSetup:
    """What all lanes of a reel share."""

    g: Geometry
    device: str
    camera: CameraPlan
    side: int  # samples along a pixel's side
    suns: list[NDArray[np.float64]]
    looks: list[ShadedAppearance]
    tiles: Any  # as kernels take them
    dark: Any  # shadow maps for where no sun shines
    block: MemoryLayout  # what changes from frame to frame
    room: int  # samples that a lane has room for; more, once a frame wanted more

    @property
    def pixels(self) -> int:
        """Of the picture."""
        return self.camera.width * self.camera.height


@dataclass(frozen=True)
class RenderedFrame:
    """A frame of a reel: its observation, and a picture [H, W, 3] for every appearance.

    The arrays are the lane's: they hold until the next frame is asked for.
    """

    number: int
    observation: Observation
    pictures: tuple[NDArray[np.uint8], ...]


class RecordedFrame:
    """Room for one frame, and the kernels that fill it."""

    def __init__(self, stage: StreamSetup) -> None:
        self.stage, self.device, self.room = stage, stage.device, stage.room
        self._cuda = stage.device != "cpu"
        self._stream = wp.Stream(stage.device) if self._cuda else None
        self._done = wp.Event(stage.device) if self._cuda else None
        self._allocate()

    @property
    def wanted(self) -> int:
        """Slots that the last frame would have filled."""
        return self.stage.pixels + int(self._host["cursor"][0])

    def start(self, row: NDArray[np.uint8]) -> None:
        """Draw the frame of a block."""
        if self.room < self.stage.room:
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

    def print(self, number: int, pose: Array, parts: Array) -> RenderedFrame:
        """The frame that is done."""
        h, shape = self._host, (self.stage.camera.height, self.stage.camera.width)
        depth, instance, semantic = (h[name].reshape(shape) for name in ("depth", "instance", "semantic"))
        visible, amodal, projected = h["extents"][:3]
        objects = objects_of(self.stage.g, visible, amodal, projected)
        seen = Observation(
            depth,
            instance,
            semantic,
            objects,
            self.stage.camera,
            pose,
            parts,
            None,
            None,
            None,
            b"",
            np.zeros(0, np.int32),
        )
        pictures = tuple(h[f"rgb {v}"].reshape(*shape, 3) for v in range(len(self.stage.looks)))
        return RenderedFrame(number, seen, pictures)

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
        stage, device = self.stage, self.device
        if self._cuda:
            wp.synchronize_stream(self._stream)
        self.room, actors = stage.room, max(len(stage.g.actors), 1)
        self._pinned = wp.zeros(stage.block.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._numbers: NDArray[np.uint8] = self._pinned.numpy()
        self._block = wp.zeros(stage.block.size, dtype=wp.uint8, device=device)
        self._out_layout = MemoryLayout()
        for name, kind, shape in _results(stage, actors):
            self._out_layout.add(name, kind, shape)
        self._out = wp.zeros(self._out_layout.size, dtype=wp.uint8, device=device)
        self._out_host = wp.zeros(self._out_layout.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._r = self._out_layout.arrays(self._out)
        self._host = self._out_layout.views(self._out_host.numpy())
        self._b = stage.block.arrays(self._block)
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
        stage, size, device = self.stage, self.stage.tiles.size * int(label_kernels.TILE_PIXELS), self.device

        def zeros(count: int, kind: Any) -> Any:
            return wp.zeros(count, dtype=kind, device=device)

        self._vertices, self._world = zeros(stage.g.vertex_count, wp.vec3f), zeros(stage.g.vertex_count, wp.vec3f)
        self._coarse = zeros(stage.pixels, wp.uint64)
        self._fine = zeros(stage.pixels * 4, wp.uint64) if stage.side == 2 else self._coarse
        self._bits, self._bands, self._taken = (
            zeros(stage.pixels, wp.uint64),
            zeros(_BIN_CAPACITY, wp.uint64),
            zeros(1, wp.int32),
        )
        self._counts, self._firsts = zeros(size, wp.int32), zeros(size, wp.int32)
        self._wanted, self._stretches = zeros(stage.tiles.size, wp.int32), zeros(stage.tiles.size, wp.int32)
        self._groups, self._starts = zeros(stage.pixels, wp.int32), zeros(stage.pixels, wp.int32)
        room = self.room + 4
        self._keys, self._of_pixel, self._places = zeros(room, wp.uint64), zeros(room, wp.int32), zeros(room, wp.int32)
        self._weights, self._of_tile = zeros(room, wp.float32), zeros(room, wp.int32)
        self._surfaces, self._codes = zeros(room, wp.int32), zeros(room, wp.uint32)
        self._positions, self._normals = zeros(room, wp.vec3f), zeros(room, wp.vec3f)
        self._details = zeros(room, wp.vec4f)
        self._light, self._shown = zeros(room, wp.vec3f), zeros(room, wp.vec3f)
        self._gleam, self._known = zeros(room, wp.vec2f), zeros(room, wp.uint8)
        blocks = -(-stage.camera.width // 2) * -(-stage.camera.height // 2)
        self._reach, self._asked, self._ways = (zeros(blocks, kind) for kind in (wp.float32, wp.int32, wp.uint32))
        self._sources = zeros(1, wp.vec2i)
        self._nothing_moved = wp.zeros((1, 1), dtype=wp.int32, device=device)
        self._no_levels = 0, zeros(1, wp.uint8), zeros(1, wp.vec3f)
        self._cover, self._dry = zeros(stage.pixels, wp.int32), zeros(1, wp.int32)
        lists = (stage.tiles.size, int(tile_list_kernels.MAX_PER_TILE) + 1)
        kinds = {look.lit for look in stage.looks}
        self._lists = {lit: [wp.zeros(lists, dtype=wp.int32, device=device) for _ in range(3)] for lit in kinds}
        self._seen = zeros(max(stage.g.chunk_count, 1), wp.int32)
        here, ahead = np.zeros(3), np.array([1.0, 0.0, 0.0])
        self._maps = [
            [
                ShadowMap(beam, stage.g, device, zeros(beam.size * beam.size, wp.uint64))
                for beam in moving_beams(sun, here, ahead)
            ]
            for sun in stage.suns
        ]

    def _records(self) -> None:
        """What of the block and the records is this lane's own: addresses."""
        stage, b, g, device = self.stage, self._b, self.stage.g, self.device
        scene = sample_kernels.SceneArrays()
        scene.view, scene.normals, scene.uvs = self._vertices, g.normals, g.uvs
        scene.vertex_part, scene.triangles, scene.face_normals = g.vertex_part, g.triangles, g.face_normals
        scene.triangle_surface, scene.surface_pattern = g.triangle_surface, g.surface_pattern
        scene.world_from_part, scene.world_from_view = b["world"], b["back"]
        self._scene = record(scene, device)
        self._nothing_still, self._nothing_before = (
            record(sample_kernels.StaticSamples(), device),
            record(temporal_kernels.PreviousFrame(), device),
        )
        self._all = record(all_samples(), device)
        lit = lights.lamps_of(g, [b[f"lamps {name}"] for name in lights.LAMP_NAMES], device)
        self._lamps = {True: record(lit, device), False: record(lights.no_lamps(device), device)}
        columns = [b[f"bodies {name}"] for name in lights.BODY_NAMES]
        self._bodies = record(lights.bodies_of(columns, columns[0].size), device)
        data = sample_kernels.Samples()
        data.surfaces, data.positions, data.normals = self._surfaces, self._positions, self._normals
        data.details, data.codes, data.pixels = self._details, self._codes, self._of_pixel
        data.tiles = self._of_tile
        self._own, self._is_own = stage.block.rows(1)[0], np.zeros(stage.block.size, bool)
        stage.block.put_records(self._own, "samples", [data])
        stage.block.mark(self._is_own, "samples", 0, span_of(sample_kernels.Samples, "eye")[0])
        for n, maps in enumerate(self._maps):
            for k, room in enumerate(maps, start=2):
                stage.block.put_records(self._own, f"beams {n}", [room.beam], at=k)
                for name in ("depths", "bounds"):
                    stage.block.mark(self._is_own, f"beams {n}", *span_of(shadow_kernels.Sunbeam, name), at=k)

    def _draw(self) -> None:
        """All kernels of a frame, in order."""
        wp.copy(self._block, self._pinned)
        self._observe()
        if self.stage.looks:
            self._place()
            self._shadow()
            self._near()
            for v, look in enumerate(self.stage.looks):
                self._shade(v, look)
        wp.copy(self._out_host, self._out)

    def _observe(self) -> None:
        stage, g, r, lens = self.stage, self.stage.g, self._r, pinhole_of(self.stage.camera, 1)
        inputs = [g.vertices, g.vertex_part, self._b["view"], 0, self._vertices]
        launch(visibility_kernels.transform_vertices, g.vertex_count, inputs, self.device)
        boxes = [g.chunks, g.chunk_centres, g.chunk_halves]
        launch(visibility_kernels.cull_chunks, g.chunk_count, [*boxes, self._b["view"], lens, self._seen], self.device)
        self._raster(self._coarse, 1)
        wp.copy(r["extents"].flatten(), self._no_extents.flatten())
        tables = [g.triangle_surface, g.surface_actor, g.surface_instance, g.surface_tag]
        out = [r["depth"], r["instance"], r["semantic"], r["extents"][0]]
        size = stage.tiles.size * int(label_kernels.TILE_PIXELS)
        launch(label_kernels.label_pixels, size, [stage.tiles, self._coarse, *tables, lens, *out], self.device)
        first = g.static_triangles
        for start in range(0, len(g.actors), 64):
            self._raster(self._bits, 1, g.static_chunks, start)
            actors = min(64, len(g.actors) - start)
            inputs = [stage.tiles, self._bits, lens, start, actors, r["extents"][1]]
            launch(label_kernels.count_amodal, size, inputs, self.device)
        if g.triangle_count > first:
            tables = [self._vertices, g.triangles, g.triangle_surface, g.surface_actor, first, lens]
            inputs = [*tables, distortion_of(stage.camera), r["extents"][2], r["extents"][3]]
            launch(label_kernels.project_boxes, g.triangle_count - first, inputs, self.device)

    def _raster(self, keys: Any, side: int, first: int = 0, actor: int = -1) -> None:
        g, lens = self.stage.g, pinhole_of(self.stage.camera, side)
        keys.zero_()
        self._taken.zero_()
        tables, lists = [g.triangle_surface, g.surface_actor, actor], [lens, keys, self._bands, self._taken]
        inputs = [self._vertices, g.triangles, g.chunks, self._seen, first, *tables, *lists]
        launch(bin_kernels.bin_triangles, (g.chunk_count - first) * CHUNK, inputs, self.device)
        threads = int(bin_kernels.BIN_GROUPS) * int(bin_kernels.BIN_THREADS)
        launch(bin_kernels.raster_bins, threads, [self._vertices, g.triangles, *tables, *lists], self.device)

    def _place(self) -> None:
        """Samples, as `points` places and surveys them, but in slots."""
        stage, size = self.stage, self.stage.tiles.size * int(label_kernels.TILE_PIXELS)
        lens, cursor = pinhole_of(stage.camera, stage.side), self._r["cursor"]
        if stage.side == 2:
            self._raster(self._fine, 2)
        keys = [self._coarse, self._fine]
        grouped = [lens, self._scene, self._nothing_still, self._groups, self._starts, self._counts]
        launch(sample_kernels.count_samples, size, [stage.tiles, *keys, *grouped], self.device)
        self._wanted.zero_()
        cursor.zero_()
        launch(slot_kernels.rank_in_tile, size, [self._counts, self._firsts, self._wanted], self.device)
        launch(slot_kernels.reserve_slots, stage.tiles.size, [self._wanted, self._stretches, cursor], self.device)
        inputs = [stage.tiles, lens, self._stretches, self.room, self._counts, self._firsts]
        launch(slot_kernels.assign_slots, size, inputs, self.device)
        self._of_pixel.fill_(-1)
        self._of_tile.fill_(-1)
        places = [lens, self._scene, self._groups, self._starts]
        out = [self._keys, self._of_pixel, self._places, self._weights, self._of_tile]
        launch(
            sample_kernels.emit_samples,
            size,
            [stage.tiles, *keys, self._counts, self._firsts, *places, *out],
            self.device,
        )
        lens = pinhole_of(stage.camera, 1)
        inputs = [0, self._keys, self._of_pixel, self._places, lens, self._scene]
        out = [self._surfaces, self._positions, self._normals, self._details, self._codes]
        launch(sample_kernels.evaluate_samples, self.room, [*inputs, *out], self.device)

    def _shadow(self) -> None:
        g = self.stage.g
        count = g.vertex_count - g.static_vertices
        if not self.stage.suns:
            return
        inputs = [g.vertices, g.vertex_part, self._b["world"], g.static_vertices, self._world]
        launch(visibility_kernels.transform_vertices, count, inputs, self.device)
        for n, maps in enumerate(self._maps):
            for k, sheet in enumerate(maps, start=2):
                beam, first = self._b[f"beams {n}"][k : k + 1], g.static_chunks
                sheet.clear()
                sheet.draw(beam, self._world, self._b["world"], first, g.chunk_count - first)

    def _near(self) -> None:
        stage, lens = self.stage, pinhole_of(self.stage.camera, 1)
        for lit, lists in self._lists.items():
            inputs = [self._coarse, lens, self._b["back"], self._lamps[lit], self._bodies, *lists[:2]]
            launch(tile_list_kernels.cull_lights, stage.tiles.size, inputs, self.device)
            inputs = [lens, self._b["view"], self._lamps[lit], lists[2]]
            launch(fog_glow_kernels.cull_glows, stage.tiles.size, inputs, self.device)

    def _shade(self, v: int, look: ShadedAppearance) -> None:
        stage, b, lens = self.stage, self._b, pinhole_of(self.stage.camera, 1)
        data, air = b["samples"], b[f"air {v}"]
        beams = b[f"beams {look.sun}"] if look.sun >= 0 else stage.dark
        inputs = [data, look.looks, air, beams, self._lamps[look.lit], self._bodies, *self._lists[look.lit]]
        shown = self._shown if look.wet else self._light
        out = [self._light, self._gleam, self._known, shown]
        launch(shading_kernels.shade_samples, self.room, [*inputs, self._nothing_before, self._all, *out], self.device)
        if look.wet:
            inputs = [data, self._gleam, self._r["depth"], self._starts, b["view"], lens, self._nothing_before]
            inputs += [self._nothing_moved, 1, self._reach, self._asked, self._ways]
            launch(reflection_kernels.trace_rays, self._reach.size, inputs, self.device)
            inputs = [data, air, self._gleam, self._reach, self._r["depth"], self._starts, b["view"], lens]
            inputs += [self._nothing_before, self._all, self._light, self._sources, shown]
            launch(reflection_kernels.reflect, self.room, inputs, self.device)
        cover = self._dry
        if look.light.rain > 0.0:
            cover = self._cover
            cover.zero_()
            count = int(rain_at(np.zeros((3, 4)), look.light, 0.0).count)
            inputs = [b[f"shower {v}"], self._r["depth"], b["view"], lens, cover]
            launch(rain_kernels.draw_streaks, count, inputs, self.device)
        streak = streak_radiance(look.light)
        inputs = [shown, self._starts, self._groups, self._weights, cover, streak, b[f"response {v}"]]
        inputs += self._no_levels
        launch(
            develop_kernels.develop_pixels, stage.pixels, [*inputs, *look.tables, 1, self._r[f"rgb {v}"]], self.device
        )


def _results(stage: StreamSetup, actors: int) -> list[tuple[str, Any, tuple[int, ...]]]:
    """What a frame leaves behind."""
    labels = [("depth", wp.float32), ("instance", wp.uint16), ("semantic", wp.uint8)]
    return [
        *((name, kind, (stage.pixels,)) for name, kind in labels),
        ("extents", wp.int32, (4, actors, 5)),
        ("cursor", wp.int32, (1,)),
        *((f"rgb {v}", wp.uint8, (stage.pixels * 3,)) for v in range(len(stage.looks))),
    ]
