"""A stream of frames of one camera, each started before the earlier ones are finished.

The inputs of several frames are computed at once, while several recorded frames keep a GPU busy.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, SensorPlan

from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.core.transforms import Array
from recipe_runtime.render.atmosphere.weather_light import WeatherLight, initial_light, move_air
from recipe_runtime.render.camera.develop_kernels import Response
from recipe_runtime.render.camera.post_process import needs_post_process
from recipe_runtime.render.camera.rain import rain_at
from recipe_runtime.render.camera.responses import ResponseTables, response_of
from recipe_runtime.render.device.arrays import copy_struct, set_fields, struct_array
from recipe_runtime.render.device.memory_layout import span_of
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.gpu.recorded_frame import RecordedFrame, RenderedFrame
from recipe_runtime.render.gpu.stream_setup import ShadedAppearance, StreamSetup, frame_layout, suns_of
from recipe_runtime.render.lighting import lights
from recipe_runtime.render.numeric.seeds import noise_key
from recipe_runtime.render.patches.patch_arrays import no_patches, patch_shapes, patch_structs, texture_of
from recipe_runtime.render.raster.observer import all_tiles
from recipe_runtime.render.sampling import sample_kernels
from recipe_runtime.render.scene.camera import view_from_parts, world_from_parts, world_from_view
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.shadows.lamp_shadow_maps import LampShadowMaps
from recipe_runtime.render.shadows.lamp_slots import MAP_NAMES, STATIC_SLOTS
from recipe_runtime.render.shadows.shadow_maps import ShadowMaps, moving_beams
from recipe_runtime.render.texture.mipmaps import ImageAtlases
from recipe_runtime.render.texture.surface_colours import surface_colours

_CHUNK = 8  # frames whose inputs are computed at once, while earlier frames are drawn
_EDGE_SAMPLES = 0.5  # initial capacity for samples at edges, per pixel


@dataclass(frozen=True)
class FrameBatch:
    """Frames to draw: number, time, pose of the sensor, and transforms of the parts."""

    numbers: Sequence[int]
    times: Sequence[float]  # seconds
    poses: Array  # [F, 3, 4] world from sensor
    parts: Array  # [F, P, 3, 4] world from part
    lamps: NDArray[np.int32] | None = None  # [F, A] masks of `LampState`; None: none of these lamps is lit


class FrameStream:
    """Draws frames of one camera in appearances that agree on antialiasing."""

    def __init__(
        self,
        geometry: Geometry,
        shadows: ShadowMaps,
        atlases: ImageAtlases,
        device: str,
        camera_plan: CameraPlan,
        sensor: str,
        appearances: Sequence[AppearancePlan],
        in_flight: int = 16,
        patched: Sequence[AppearancePlan] = (),
        label_passes: Sequence[LabelPass] = (),
    ) -> None:
        """Prepare the stream; each frame has a map of the patches of each of the appearances `patched`."""
        self._g, self._device, self._camera, self._sensor = geometry, device, camera_plan, sensor
        self._shadows, self._atlases, self._tables = shadows, atlases, ResponseTables(device)
        lit = [initial_light(plan, device) for plan in appearances]
        suns = suns_of(lit)
        looks = [self._prepare(plan, light, suns) for plan, light in zip(appearances, lit, strict=True)]
        smooth = {look.response.antialias for look in looks} or {False}
        if len(smooth) != 1:
            raise ValueError("the appearances of a stream must all be antialiased, or none")
        side = 2 if smooth.pop() else 1
        pixels = camera_plan.width * camera_plan.height
        self._setup = StreamSetup(
            geometry,
            device,
            camera_plan,
            side,
            suns,
            looks,
            [patch_shapes(geometry, plan.patches, device) for plan in patched],
            label_passes,
            tiles=wp.array(all_tiles(camera_plan), dtype=wp.int32, device=device),
            no_shadows=struct_array([shadows.none()] * 4, device),
            layout=frame_layout(geometry, len(suns), len(looks)),
            capacity=pixels + (int(_EDGE_SAMPLES * pixels) if side == 2 else 0),
        )
        self._burning = any(look.light.lamps_burn for look in looks)
        self._lamp_shadows = LampShadowMaps(geometry, device)
        self._responses: dict[int, tuple[float, Response]] = {}  # by appearance, with the light of lamps
        self._maps: list[object] = []  # static shadow maps that frames in flight may read
        self._recorded = [RecordedFrame(self._setup) for _ in range(in_flight)]

    def frames(self, batch: FrameBatch) -> Iterator[RenderedFrame]:
        """Yield the frames in order."""
        waiting: list[tuple[RecordedFrame, int]] = []
        for start in range(0, len(batch.numbers), _CHUNK):
            stop = min(start + _CHUNK, len(batch.numbers))
            rows = self._rows(batch, start, stop)
            for index in range(start, stop):
                if len(waiting) == len(self._recorded):
                    yield self._ready(batch, *waiting.pop(0))
                recorded = self._recorded[index % len(self._recorded)]
                recorded.start(rows[index - start])
                waiting.append((recorded, index))
        for recorded, index in waiting:
            yield self._ready(batch, recorded, index)

    def _ready(self, batch: FrameBatch, recorded: RecordedFrame, index: int) -> RenderedFrame:
        """Return a finished recorded frame; it is drawn again with more capacity if it had too little."""
        recorded.wait()
        if recorded.wanted > recorded.capacity:
            self._setup.capacity = max(self._setup.capacity, recorded.wanted + recorded.wanted // 8)
            recorded.rebuild()
            recorded.wait()
        return recorded.result(batch.numbers[index], batch.poses[index], batch.parts[index])

    def _prepare(self, plan: AppearancePlan, light: WeatherLight, suns: list[NDArray[np.float64]]) -> ShadedAppearance:
        response = plan.responses.get(self._sensor) or CameraResponse()
        sun = next((n for n, sun in enumerate(suns) if light.sun_shines and bool((light.sun == sun).all())), -1)
        shown = [texture for patch in plan.patches if (texture := texture_of(patch, 0)) is not None]
        atlas, device = self._atlases.of(plan, shown), self._device
        colours = surface_colours(self._g, plan.looks.root, atlas.images, device)
        patches = patch_structs(self._g, plan.patches, atlas.numbers, 0, device) if plan.patches else no_patches(device)
        tables = self._tables.by_pixel(response, self._camera)
        air, uploaded = copy_struct(light.air), struct_array([colours], device)
        return ShadedAppearance(plan, light, air, uploaded, patches, response, tables, sun)

    def _rows(self, batch: FrameBatch, start: int, stop: int) -> NDArray[np.uint8]:
        """Return layout rows of some frames, without the bytes that belong to a recorded frame."""
        span, layout = slice(start, stop), self._setup.layout
        poses, parts = batch.poses[span], batch.parts[span]
        rows, put = layout.rows(stop - start), layout.put
        world, eyes = world_from_parts(parts), poses[:, :, 3]
        put(rows, "view_from_part", view_from_parts(poses, parts))
        put(rows, "world_from_part", world)
        put(rows, "world_from_view", world_from_view(poses))
        held = self._put_lamps(rows, world, poses) if self._burning else []
        for name, column in zip(lights.BODY_NAMES, lights.body_columns(self._g, parts), strict=True):
            put(rows, f"bodies {name}", column)
        dark = np.zeros((stop - start, len(self._g.actors)), np.int32)
        put(rows, "lit", lights.lit_surfaces(self._g, dark if batch.lamps is None else batch.lamps[span]))
        put(rows, "samples", eyes, span_of(sample_kernels.Samples, "eye")[0])
        held += [beam for row, pose in zip(rows, poses, strict=True) for beam in self._put_beams(row, pose)]
        for row, pose, moved, number, time in zip(
            rows, poses, parts, batch.numbers[span], batch.times[span], strict=True
        ):
            self._put_light(row, pose, moved, number, time)
        under_way = _CHUNK + len(self._recorded)
        maps = 2 * len(self._setup.suns) + (STATIC_SLOTS if self._burning else 0)
        self._maps = (self._maps + held)[-under_way * max(maps, 1) :]
        if self._device != "cpu":
            wp.synchronize_stream(wp.get_stream(self._device))  # static shadows are drawn there
        return rows

    def _put_lamps(self, rows: NDArray[np.uint8], world: Array, poses: Array) -> list[object]:
        """Put the lamps into rows; the frames must hold references to the static maps that are returned."""
        put, put_records = self._setup.layout.put, self._setup.layout.put_records
        columns, slots = lights.lamp_columns(self._g, world, poses)
        for name, column in zip(lights.LAMP_NAMES, columns, strict=True):
            put(rows, f"lamps {name}", column)
        for name, column in zip(MAP_NAMES, slots.columns, strict=True):
            put(rows, f"lamp maps {name}", column)
        held: list[object] = []
        for row, frame in zip(rows, slots.by_frame(), strict=True):
            static = self._lamp_shadows.static_maps(frame)
            put_records(row, "lamp maps static", static)
            held += static
        return held

    def _put_beams(self, row: NDArray[np.uint8], pose: Array) -> list[object]:
        """Put the shadow maps of a pose into a row; the frame must hold references to the static maps."""
        held: list[object] = []
        for n, sun in enumerate(self._setup.suns):
            static = self._shadows.static(sun, pose[:, 3])
            held += static
            moving = moving_beams(sun, pose[:, 3], pose[:, 0])
            self._setup.layout.put_records(row, f"beams {n}", [*static, *moving])
        return held

    def _put_light(self, row: NDArray[np.uint8], pose: Array, parts: Array, number: int, time: float) -> None:
        """Put the light, rain and camera response of every appearance at a time into a row."""
        layout = self._setup.layout
        for v, look in enumerate(self._setup.appearances):
            light, seed = look.light, look.plan.seed
            move_air(look.air, light, time)
            layout.put_records(row, f"air {v}", [look.air])
            if light.rain > 0.0:
                layout.put_records(row, f"rain {v}", [rain_at(pose, light, time, seed)])
            response = self._response(v, look, pose[:, 3], parts)
            set_fields(response, key=noise_key(seed, self._sensor, number))
            layout.put_records(row, f"response {v}", [response])

    def _response(self, v: int, look: ShadedAppearance, eye: Array, parts: Array) -> Response:
        """Return the response of appearance `v` without the key of its noise; computed again if the lamps changed."""
        lamps = lights.lamplight(self._g, eye, parts) if look.light.lamplight > 0.0 else 1.0
        latest = self._responses.get(v)
        if latest is None or latest[0] != lamps:
            latest = lamps, response_of(look.response, look.light.exposure(lamps), 0, self._camera)
            self._responses[v] = latest
        return latest[1]


def can_stream(sensor: SensorPlan, appearances: Sequence[AppearancePlan]) -> bool:
    """Return whether a stream can draw a sensor in these appearances.

    Its camera must need no post-processing, and the appearances' patches must not be inserted into the picture or
    change their image from frame to frame.
    """
    responses = [plan.responses.get(sensor.name) or CameraResponse() for plan in appearances]
    if any(patch.inserted or patch.changes for plan in appearances for patch in plan.patches):
        return False
    plain = all(not needs_post_process(sensor.camera, r, None) and r.motion_blur_intensity == 0.0 for r in responses)
    return plain and len({r.antialias for r in responses}) <= 1
