"""A reel: many frames of one camera, drawn without a stop for the host to look at one.

The numbers that change from frame to frame are made for a few frames at once, and several lanes, each with a frame of
its own, keep a GPU busy meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, SensorPlan

from recipe_runtime.core.transforms import Array
from recipe_runtime.render.camera import develop_kernels, post_process, rain_kernels
from recipe_runtime.render.camera.rain import rain_at
from recipe_runtime.render.device.arrays import record, records
from recipe_runtime.render.device.memory_layout import MemoryLayout, span_of
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.gpu.recorded_frame import RecordedFrame, RenderedFrame, ShadedAppearance, StreamSetup
from recipe_runtime.render.lighting import lights, shadow_kernels
from recipe_runtime.render.lighting.shadow_maps import ShadowMaps, moving_beams
from recipe_runtime.render.lighting.weather_light import drift, light_of
from recipe_runtime.render.numeric.seeds import noise_key
from recipe_runtime.render.raster.observer import all_tiles
from recipe_runtime.render.sampling import sample_kernels
from recipe_runtime.render.scene.camera import view_from_parts, world_from_parts, world_from_view
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.texture.mipmaps import ImageAtlases
from recipe_runtime.render.texture.surface_colours import surface_colours

_CHUNK = 8  # frames whose numbers are made at once, while those of before are drawn
_EDGE_SAMPLES = 0.5  # samples at edges that there is room for at first, a pixel


@dataclass(frozen=True)
class FrameBatch:
    """What a reel is to show: frames by number, each with its time, the sensor's pose and the parts' transforms."""

    numbers: Sequence[int]
    times: Sequence[float]  # seconds
    poses: Array  # [F, 3, 4] world from sensor
    parts: Array  # [F, P, 3, 4] world from part


class FrameStream:
    """Draws frames of one camera in some appearances that agree on antialiasing."""

    def __init__(
        self,
        geometry: Geometry,
        shadows: ShadowMaps,
        albums: ImageAtlases,
        device: str,
        camera_plan: CameraPlan,
        sensor: str,
        appearances: Sequence[AppearancePlan],
        lanes: int = 16,
    ) -> None:
        self._g, self._device, self._camera, self._sensor = geometry, device, camera_plan, sensor
        self._shadows, self._albums, self._tables = shadows, albums, post_process.ResponseTables(device)
        self._suns: list[NDArray[np.float64]] = []
        self._looks = [self._look(plan) for plan in appearances]
        smooth = {look.response.antialias for look in self._looks} or {False}
        if len(smooth) != 1:
            raise ValueError("the appearances of a reel are antialiased all or none")
        side = 2 if smooth.pop() else 1
        pixels = camera_plan.width * camera_plan.height
        self._stage = StreamSetup(
            geometry,
            device,
            camera_plan,
            side,
            self._suns,
            self._looks,
            tiles=wp.array(all_tiles(camera_plan), dtype=wp.int32, device=device),
            dark=records([shadows.none()] * 4, device),
            block=_layout(geometry, self._suns, self._looks),
            room=pixels + (int(_EDGE_SAMPLES * pixels) if side == 2 else 0),
        )
        self._beams: list[Any] = []  # static shadow maps that frames under way may look into
        self._lanes = [RecordedFrame(self._stage) for _ in range(lanes)]

    def frames(self, take: FrameBatch) -> Iterator[RenderedFrame]:
        """The frames, in their order."""
        waiting: list[tuple[RecordedFrame, int]] = []
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

    def _ready(self, take: FrameBatch, lane: RecordedFrame, index: int) -> RenderedFrame:
        """A lane's frame, once it is done; with more room, if it had too little."""
        lane.wait()
        if lane.wanted > lane.room:
            self._stage.room = max(self._stage.room, lane.wanted + lane.wanted // 8)
            lane.rebuild()
            lane.wait()
        return lane.print(take.numbers[index], take.poses[index], take.parts[index])

    def _look(self, plan: AppearancePlan) -> ShadedAppearance:
        light, response = light_of(plan, self._device), plan.responses.get(self._sensor) or CameraResponse()
        sun = -1
        if light.sun[2] > 0.0 and float(light.sunlight.max()) > 0.0:
            known = [bool((light.sun == other).all()) for other in self._suns]
            if not any(known):
                self._suns.append(light.sun)
            sun = known.index(True) if any(known) else len(self._suns) - 1
        looks = record(surface_colours(self._g, plan.looks.root, self._albums.of(plan), self._device), self._device)
        return ShadedAppearance(plan, light, looks, response, self._tables.straight(response, self._camera), sun)

    def _rows(self, take: FrameBatch, start: int, stop: int) -> NDArray[np.uint8]:
        """The blocks of some frames, but for what is a lane's own."""
        poses, parts, block = take.poses[start:stop], take.parts[start:stop], self._stage.block
        rows, put = block.rows(stop - start), block.put
        world, eyes = world_from_parts(parts), poses[:, :, 3]
        put(rows, "view", view_from_parts(poses, parts))
        put(rows, "world", world)
        put(rows, "back", world_from_view(poses))
        for name, column in zip(lights.LAMP_NAMES, lights.lamp_columns(self._g, world, eyes), strict=True):
            put(rows, f"lamps {name}", column)
        for name, column in zip(lights.BODY_NAMES, lights.body_columns(self._g, parts), strict=True):
            put(rows, f"bodies {name}", column)
        put(rows, "samples", eyes, span_of(sample_kernels.Samples, "eye")[0])
        held: list[Any] = []
        for row, pose in zip(rows, poses, strict=True):
            for n, sun in enumerate(self._suns):
                still = self._shadows.static(sun, pose[:, 3])
                held += still
                moving = moving_beams(sun, pose[:, 3], pose[:, 0])
                block.put_records(row, f"beams {n}", [*still, *moving])
        for v, look in enumerate(self._looks):
            for row, pose, number, time in zip(
                rows, poses, take.numbers[start:stop], take.times[start:stop], strict=True
            ):
                drift(look.light, time)
                block.put_records(row, f"air {v}", [look.light.air])
                if look.light.rain > 0.0:
                    shower = rain_at(pose, look.light, time)
                    shower.key = noise_key(look.plan.seed, "rain", 0)
                    block.put_records(row, f"shower {v}", [shower])
                block.put_records(row, f"response {v}", [self._response(look, pose, number)])
        under_way = _CHUNK + len(self._lanes)
        self._beams = (self._beams + held)[-2 * under_way * max(len(self._suns), 1) :]
        if self._device != "cpu":
            wp.synchronize_stream(wp.get_stream(self._device))  # static shadows are drawn there
        return rows

    def _response(self, look: ShadedAppearance, pose: Array, number: int) -> Any:
        key = noise_key(look.plan.seed, self._sensor, number)
        lit = lights.lamplight(self._g, pose[:, 3]) if look.light.lamplight > 0.0 else 1.0
        return post_process.response_of(look.response, look.light.exposure(lit), key, self._camera)


def _layout(g: Geometry, suns: Sequence[Any], looks: Sequence[ShadedAppearance]) -> MemoryLayout:
    """What changes from frame to frame, and where it stands."""
    parts, eye, none = 1 + g.parts, np.zeros((1, 3)), np.zeros((1, g.parts, 3, 4))
    block = MemoryLayout()
    block.add("view", wp.float32, (parts, 12))
    block.add("world", wp.float32, (parts, 12))
    block.add("back", wp.float32, (1, 12))
    columns = lights.lamp_columns(g, np.zeros((1, parts, 3, 4)), eye)
    for name, kind, column in zip(lights.LAMP_NAMES, lights.LAMP_KINDS, columns, strict=True):
        block.add(f"lamps {name}", kind, (column.shape[1],))
    columns = lights.body_columns(g, none)
    for name, kind, column in zip(lights.BODY_NAMES, lights.BODY_KINDS, columns, strict=True):
        block.add(f"bodies {name}", kind, (column.shape[1],))
    block.add("samples", sample_kernels.Samples, (1,))
    for n in range(len(suns)):
        block.add(f"beams {n}", shadow_kernels.Sunbeam, (4,))
    for v, look in enumerate(looks):
        block.add(f"air {v}", look.light.air._cls, (1,))
        block.add(f"shower {v}", rain_kernels.Rain, (1,))
        block.add(f"response {v}", develop_kernels.Response, (1,))
    return block


def can_stream(sensor: SensorPlan, appearances: Sequence[AppearancePlan]) -> bool:
    """Whether a reel can draw a sensor in these: its camera a plain one, which makes bytes of samples in one kernel."""
    responses = [plan.responses.get(sensor.name) or CameraResponse() for plan in appearances]
    plain = all(
        not post_process.needs_post_process(sensor.camera, r, None) and r.motion_blur_intensity == 0.0
        for r in responses
    )
    return plain and len({r.antialias for r in responses}) <= 1
