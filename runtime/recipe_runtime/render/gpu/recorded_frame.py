"""The kernels of one frame, recorded once as a CUDA graph and replayed for every frame.

Observer, Sampler, ShadingPass and CameraPass read sizes back between their passes. Here every array has a fixed size
(`FrameBuffers`), and all values that change from frame to frame are in one block of memory. The passes are the same
functions, with three differences: large triangles are split among threads (`raster_binned`), samples take slots
(`assign_slots`), and nothing of an earlier frame is reused. On a CPU the passes run one by one, so tests can compare
the bytes with Renderer's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.optics import focal_length

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.camera import passes as camera_passes
from recipe_runtime.render.camera.passes import Exposed
from recipe_runtime.render.camera.rain import drop_count, streak_radiance
from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.memory_layout import span_of
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.gpu.frame_buffers import FrameBuffers
from recipe_runtime.render.gpu.stream_setup import ShadedAppearance, StreamSetup, result_layout
from recipe_runtime.render.lighting import lights
from recipe_runtime.render.lighting import passes as light_passes
from recipe_runtime.render.lighting.temporal import all_samples
from recipe_runtime.render.lighting.temporal_kernels import PreviousFrame
from recipe_runtime.render.patches.patch_map import draw_patch_numbers
from recipe_runtime.render.raster import passes as raster_passes
from recipe_runtime.render.raster.observation import RecordedLabels, objects_of
from recipe_runtime.render.raster.passes import Labels
from recipe_runtime.render.raster.surfaces import VisibleSurfaces
from recipe_runtime.render.sampling import passes as sample_passes
from recipe_runtime.render.sampling.buffers import samples_of, scene_arrays
from recipe_runtime.render.sampling.sample_kernels import Samples, StaticSamples
from recipe_runtime.render.scene.camera import pinhole_of
from recipe_runtime.render.shadows.lamp_shadow_maps import maps_of
from recipe_runtime.render.shadows.lamp_slots import MAP_NAMES
from recipe_runtime.render.shadows.shadow_kernels import Sunbeam


@dataclass(frozen=True)
class RenderedFrame:
    """A frame of a stream: its observation, a picture [H, W, 3] for every appearance, and maps of patches [H, W].

    The arrays belong to the recorded frame: they are valid until the next frame is requested.
    """

    number: int
    observation: RecordedLabels
    pictures: tuple[NDArray[np.uint8], ...]
    patch_maps: tuple[NDArray[np.uint8], ...]


class RecordedFrame:
    """The memory of one frame, and the passes that fill it."""

    def __init__(self, setup: StreamSetup) -> None:
        self.setup, self.device = setup, setup.device
        self._cuda = setup.device != "cpu"
        self._stream = wp.Stream(setup.device) if self._cuda else None
        self._done = wp.Event(setup.device) if self._cuda else None
        self._allocate()

    @property
    def capacity(self) -> int:
        """Number of samples for which there is room."""
        return self._buffers.capacity

    @property
    def wanted(self) -> int:
        """Number of samples that the last frame required."""
        return self.setup.pixels + int(self._host["cursor"][0])

    def start(self, row: NDArray[np.uint8]) -> None:
        """Start drawing a frame from a row of `setup.layout`."""
        if self.capacity < self.setup.capacity:
            self._allocate()
        self._row = row
        self._run()

    def rebuild(self) -> None:
        """Draw the frame again, with the stream's current capacity."""
        self._allocate()
        self._run()

    def wait(self) -> None:
        """Wait until the frame is in host memory."""
        if self._done is not None:
            wp.synchronize_event(self._done)

    def result(self, number: int, pose: Array, parts: Array) -> RenderedFrame:
        """Return the finished frame: its number, the sensor's pose [3, 4] and the parts' transforms [P, 3, 4]."""
        h, camera = self._host, self.setup.camera
        shape = camera.height, camera.width
        visible, amodal, projected = h["extents"][:3]
        layers = {p.name: h[f"layer {p.name}"].reshape(p.shape(*shape[::-1])) for p in self.setup.label_passes}
        seen = RecordedLabels(
            **{name: h[name].reshape(shape) for name in Labels._fields},
            objects=objects_of(self.setup.g, visible, amodal, projected),
            camera=camera,
            world_from_sensor=pose,
            parts=parts,
            layers=layers,
        )
        pictures = tuple(h[f"rgb {v}"].reshape(*shape, 3) for v in range(len(self.setup.appearances)))
        maps = tuple(h[f"patches {k}"].reshape(shape) for k in range(len(self.setup.patched)))
        return RenderedFrame(number, seen, pictures, maps)

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
        """Allocate all arrays, and on a GPU record the graph."""
        setup, device = self.setup, self.device
        if self._cuda:
            wp.synchronize_stream(self._stream)
        self._pinned = wp.zeros(setup.layout.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._numbers: NDArray[np.uint8] = self._pinned.numpy()
        self._block = wp.zeros(setup.layout.size, dtype=wp.uint8, device=device)
        self._b = setup.layout.arrays(self._block)
        results = result_layout(setup)
        self._out = wp.zeros(results.size, dtype=wp.uint8, device=device)
        self._out_host = wp.zeros(results.size, dtype=wp.uint8, device="cpu", pinned=self._cuda)
        self._r, self._host = results.arrays(self._out), results.views(self._out_host.numpy())
        self._labels = Labels(*(self._r[name] for name in Labels._fields))
        self._no_extents: wp.array[wp.int32] = wp.array(
            raster_passes.empty_extents(setup.g, 4), dtype=wp.int32, device=device
        )
        self._buffers = FrameBuffers(setup)
        self._make_records()
        self._make_own()
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

    def _make_records(self) -> None:
        """Create the struct arrays, which stay the same from frame to frame; the arrays that they refer to change."""
        g, b, device = self.setup.g, self._b, self.device
        scene = scene_arrays(g, self._buffers.vertices, b["world_from_part"], b["world_from_view"])
        self._scene, self._all = struct_array([scene], device), struct_array([all_samples()], device)
        self._no_static, self._no_previous = (
            struct_array([StaticSamples()], device),
            struct_array([PreviousFrame()], device),
        )
        views, static = [b[f"lamp maps {name}"] for name in MAP_NAMES], b["lamp maps static"]
        self._lamp_maps = struct_array([maps_of(views, static, self._buffers.lamp_maps)], device)
        columns = [b[f"lamps {name}"] for name in lights.LAMP_NAMES]
        burning, dark = (
            lights.lamps_of(g, columns, self._lamp_maps, b["lit"], device),
            lights.no_lamps(b["lit"], device),
        )
        self._lamps = {True: struct_array([burning], device), False: struct_array([dark], device)}
        columns = [b[f"bodies {name}"] for name in lights.BODY_NAMES]
        self._bodies = struct_array([lights.bodies_of(columns, columns[0].size)], device)

    def _make_own(self) -> None:
        """Return the bytes of a row that contain addresses of this frame's own arrays, and a mask of these bytes."""
        layout = self.setup.layout
        self._own, self._is_own = layout.rows(1)[0], np.zeros(layout.size, bool)
        samples, focal = samples_of(self._buffers.columns), pinhole_of(self.setup.camera, 1).focal
        transforms = {name: self._b[name] for name in ("world_from_part", "world_from_view")}
        layout.put_records(self._own, "samples", [set_fields(samples, focal=focal, **transforms)])
        layout.mark(self._is_own, "samples", 0, span_of(Samples, "eye")[0])
        for n, maps in enumerate(self._buffers.maps):
            for k, shadow_map in enumerate(maps, start=2):
                layout.put_records(self._own, f"beams {n}", [shadow_map.beam], at=k)
                for name in ("depths", "bounds"):
                    layout.mark(self._is_own, f"beams {n}", *span_of(Sunbeam, name), at=k)

    def _draw(self) -> None:
        """Run all passes of a frame, in order."""
        wp.copy(self._block, self._pinned)
        self._observe()
        self._number_patches()
        if self.setup.appearances:
            self._sample()
            self._draw_shadows()
            self._list_lights()
            for v, look in enumerate(self.setup.appearances):
                self._shade(v, look)
                self._develop(v, look)
        wp.copy(self._out_host, self._out)

    def _observe(self) -> None:
        setup, g, r, n = self.setup, self.setup.g, self._r, self._buffers
        view, camera, device = self._b["view_from_part"], self.setup.camera, self.device
        raster_passes.transform_vertices(g, view, 0, n.vertices, device)
        raster_passes.cull_chunks(g, view, camera, focal_length(camera), n.chunk_visible, device)
        self._raster(n.coarse, 1)
        wp.copy(r["extents"].flatten(), self._no_extents.flatten())
        raster_passes.label_pixels(g, setup.tiles, n.coarse, camera, self._labels, r["extents"][0], device)
        surfaces = VisibleSurfaces(g, camera, n.coarse, n.vertices, view, device)
        for label in setup.label_passes:
            label.draw(surfaces, r[f"layer {label.name}"])
        for first in range(0, len(g.actors), raster_passes.ACTORS_PER_WORD):
            self._raster(n.actor_bits, 1, g.static_chunks, first)
            raster_passes.count_amodal(g, setup.tiles, n.actor_bits, first, camera, r["extents"][1], device)
        raster_passes.project_boxes(g, n.vertices, n.chunk_visible, camera, r["extents"][2], r["extents"][3], device)

    def _number_patches(self) -> None:
        keys, camera, samples = self._buffers.coarse, self.setup.camera, self._b["samples"]
        for k, patches in enumerate(self.setup.patched):
            numbers = self._r[f"patches {k}"]
            draw_patch_numbers(keys, camera, self._scene, samples, patches, numbers, self.device)

    def _raster(self, keys: DeviceArray, side: int, first_chunk: int = 0, first_actor: int = -1) -> None:
        g, n, pinhole = self.setup.g, self._buffers, pinhole_of(self.setup.camera, side)
        raster_passes.raster_binned(
            g, n.vertices, n.chunk_visible, first_chunk, first_actor, pinhole, n.bins, keys, self.device
        )

    def _sample(self) -> None:
        n, scene, cursor, device = self._buffers, self._scene, self._r["cursor"], self.device
        tiles, camera, side, capacity = self.setup.tiles, self.setup.camera, self.setup.side, self.capacity
        if side == 2:
            self._raster(n.fine, 2)
        sample_passes.count_samples(
            tiles, n.coarse, n.fine, camera, side, scene, self._no_static, n.groups, n.starts, n.counts, device
        )
        sample_passes.assign_slots(
            tiles, camera, side, capacity, n.counts, n.wanted, n.stretches, cursor, n.firsts, device
        )
        n.columns.pixels.fill_(-1)
        n.columns.tiles.fill_(-1)
        sample_passes.emit_samples(
            tiles, n.coarse, n.fine, n.counts, n.firsts, camera, side, scene, n.groups, n.starts, n.columns, device
        )
        sample_passes.evaluate_samples(0, capacity, camera, scene, n.columns, device)

    def _draw_shadows(self) -> None:
        g, n, world, device = self.setup.g, self._buffers, self._b["world_from_part"], self.device
        raster_passes.transform_vertices(g, world, g.static_vertices, n.world_vertices, device)
        if True in n.lists:
            n.lamp_maps.clear(device)
            moving = range(g.static_chunks, g.chunk_count)
            n.lamp_maps.draw(g, self._lamp_maps, world, n.world_vertices, moving, device)
        for sun, maps in enumerate(n.maps):
            for k, shadow_map in enumerate(maps, start=2):
                beam, first = self._b[f"beams {sun}"][k : k + 1], g.static_chunks
                shadow_map.clear()
                shadow_map.draw(beam, n.world_vertices, world, first, g.chunk_count - first)

    def _list_lights(self) -> None:
        back, view = self._b["world_from_view"], self._b["view_from_part"]
        keys, camera = self._buffers.coarse, self.setup.camera
        for burn, lists in self._buffers.lists.items():
            light_passes.list_lights(keys, camera, back, view, self._lamps[burn], self._bodies, lists, self.device)

    def _shade(self, v: int, look: ShadedAppearance) -> None:
        """Return the light of all samples in an appearance."""
        b, n, device, burn = self._b, self._buffers, self.device, look.light.lamps_burn
        samples, air, light = b["samples"], b[f"air {v}"], n.light(look.light.wet)
        beams = b[f"beams {look.sun}"] if look.sun >= 0 else self.setup.no_shadows
        colours, patches, lamps = look.colours, look.patches, self._lamps[burn]
        sources = light_passes.ShadingInputs(colours, patches, air, beams, lamps, self._bodies, n.lists[burn])
        previous, every = self._no_previous, self._all
        light_passes.shade_samples(self.capacity, samples, sources, previous, every, light, device)
        if look.light.wet:
            view = light_passes.ReflectionView(self.setup.camera, self._labels.depth, n.starts, b["view_from_part"])
            light_passes.trace_rays(samples, light.mirror, view, previous, n.no_motion, n.rays, device)
            light_passes.reflect(
                self.capacity, samples, air, view, n.rays, previous, every, light, n.no_sources, device
            )

    def _develop(self, v: int, look: ShadedAppearance) -> None:
        """Write the picture of an appearance."""
        b, n, camera, cover = self._b, self._buffers, self.setup.camera, self._buffers.no_cover
        if look.light.rain > 0.0:
            cover = n.cover
            cover.zero_()
            drops, view = drop_count(look.light), b["view_from_part"]
            camera_passes.draw_rain(drops, b[f"rain {v}"], self._labels.depth, view, camera, cover, self.device)
        light, streak = n.light(look.light.wet).shown, streak_radiance(look.light)
        exposed = Exposed(light, n.starts, n.groups, n.columns.weights, cover, streak)
        response, levels, out = b[f"response {v}"], n.no_levels, self._r[f"rgb {v}"]
        camera_passes.develop_pixels(exposed, camera, response, look.tables, 0, levels, out, None, self.device)
