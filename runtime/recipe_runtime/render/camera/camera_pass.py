"""From the light of a frame's samples to a picture: rain, exposure, tone, noise and the effects of lens and shutter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse

from recipe_runtime.core.timings import Timings
from recipe_runtime.render.atmosphere.weather_light import WeatherLight
from recipe_runtime.render.camera import exposure, passes
from recipe_runtime.render.camera.develop_kernels import LEVELS, Response
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.camera.passes import Exposed
from recipe_runtime.render.camera.post_process import PostProcess, needs_post_process
from recipe_runtime.render.camera.rain import drop_count, rain_at, streak_radiance
from recipe_runtime.render.camera.responses import ResponseTables, response_of
from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.lights import lamplight
from recipe_runtime.render.lighting.sample_light import SampleLight
from recipe_runtime.render.lighting.shading import ShadingPass
from recipe_runtime.render.numeric.seeds import noise_key
from recipe_runtime.render.patches.patch_map import patch_map
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.sampling.sampler import FrameSamples, Sampler
from recipe_runtime.render.scene.camera import upload_transforms, view_from_parts
from recipe_runtime.render.scene.geometry import Geometry


@dataclass(frozen=True)
class ExposedFrame:
    """The light of a frame's samples before the camera develops it."""

    undistorted: Observation  # by the undistorted camera
    points: FrameSamples
    light: WeatherLight
    found: SampleLight
    exposed: Exposed
    response: CameraResponse
    record: Response  # the response with exposure and noise


class CameraPass:
    """Makes the pictures of one scene's observations."""

    def __init__(
        self,
        geometry: Geometry,
        observer: Observer,
        sampler: Sampler,
        shading: ShadingPass,
        device: str,
        timings: Timings,
        reuse: TemporalReuse,
    ) -> None:
        self._g, self._device, self._timings = geometry, device, timings
        self._sampler, self.shading, self._reuse = sampler, shading, reuse
        self.tables = ResponseTables(device)
        self.post = PostProcess(geometry, observer, self.tables, device)

    def develop(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor: str,
        frame: int,
        time: float,
        neighbour: NeighbourFrame | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture, 8-bit sRGB [H, W, 3]; motion blur takes the motion from a neighbouring frame."""
        out = self._developed(obs, self.expose(obs, appearance, sensor, frame, time), neighbour)
        picture: NDArray[np.uint8] = out.numpy().reshape(obs.camera.height, obs.camera.width, 3)
        return picture

    def unrounded(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor: str,
        frame: int,
        time: float,
        neighbour: NeighbourFrame | None = None,
    ) -> NDArray[np.float64]:
        """Return the picture before it is rounded to 8 bits, sRGB [H, W, 3], 0 to 1."""
        light: DeviceArray = wp.empty(obs.camera.width * obs.camera.height, dtype=wp.vec3f, device=self._device)
        taken = self.expose(obs, appearance, sensor, frame, time)
        self._developed(obs, taken, neighbour, light)
        table = exposure.encoded(int(LEVELS), taken.response.gamma)
        values: NDArray[np.float64] = np.interp(light.numpy(), np.linspace(0.0, 1.0, len(table)), table)
        return values.reshape(obs.camera.height, obs.camera.width, 3)

    def _developed(
        self,
        obs: Observation,
        taken: ExposedFrame,
        neighbour: NeighbourFrame | None,
        out_light: DeviceArray | None = None,
    ) -> DeviceArray:
        """Return the bytes of a picture, uint8 [H * W * 3]; write the light that they round, if it is wanted."""
        with self._timings("develop"):
            if not needs_post_process(obs.camera, taken.response, neighbour):
                return self.developed(taken, obs.camera, out_light)
            light = self.post.hdr_image(taken.exposed, taken.undistorted, taken.record)
            return self.post.finish(light, taken.undistorted, obs, taken.response, taken.record, neighbour, out_light)

    def expose(
        self, obs: Observation, appearance: AppearancePlan, sensor: str, frame: int, time: float
    ) -> ExposedFrame:
        """Return the light of a frame's samples, and the settings of the camera."""
        response = appearance.responses.get(sensor) or CameraResponse()
        undistorted = self.post.undistorted(obs, response.supersample)
        points = self._sampler.points(undistorted, response.antialias)
        light = self.shading.weather_light(appearance, time)
        found = self.shading.shade(undistorted, points, appearance, sensor, light, frame)
        with self._timings("rain"):
            cover = self._rain(undistorted, appearance.seed, light, time)
        key = noise_key(appearance.seed, sensor, frame)
        r = response_of(response, self._exposure(obs, light), key, obs.camera)
        exposed = Exposed(
            found.light.shown, points.starts, points.groups, points.weights, cover, streak_radiance(light)
        )
        return ExposedFrame(undistorted, points, light, found, exposed, response, r)

    def developed(self, taken: ExposedFrame, camera: CameraPlan, out_light: DeviceArray | None = None) -> DeviceArray:
        """Return the bytes of a picture that one kernel develops; arguments are those of `PostProcess.finish`."""
        out = wp.empty(camera.width * camera.height * 3, dtype=wp.uint8, device=self._device)
        tables, found = self.tables.by_pixel(taken.response, camera), taken.found
        record = struct_array([taken.record], self._device)
        with self._without_pixel_reuse(found):
            passes.develop_pixels(
                taken.exposed, camera, record, tables, found.kept, found.pixels, out, out_light, self._device
            )
        return out

    @contextmanager
    def _without_pixel_reuse(self, found: SampleLight) -> Iterator[None]:
        """With pixel reuse off, mark all pixels as stale for the block; restore the marks that the kernel keeps."""
        if self._reuse.pixels or not found.kept:
            yield
            return
        stale = found.pixels.stale.numpy()
        before = stale.copy()
        stale.fill(1)
        yield
        stale &= before

    def patch_map(self, obs: Observation, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        """Return 1 + the number of the patch at each pixel's centre, uint8 [H, W]; 0 for none."""
        if not appearance.patches:
            return np.zeros((obs.camera.height, obs.camera.width), np.uint8)
        undistorted = self.post.undistorted(obs, 1)
        scene, samples = self._sampler.frame(undistorted)
        return patch_map(obs, undistorted, scene, samples, self.shading.patches_of(appearance, frame), self._device)

    def radiance(
        self, obs: Observation, appearance: AppearancePlan, time: float, frame: int = 0
    ) -> NDArray[np.float32]:
        """Return linear radiance at pixel centres, float32 [H, W, 3]."""
        points = self._sampler.points(obs, antialias=False)
        light = self.shading.weather_light(appearance, time)
        found = self.shading.shade(obs, points, appearance, "", light, frame)
        values: NDArray[np.float32] = found.light.shown.numpy()[points.starts.numpy()]
        return values.reshape(obs.camera.height, obs.camera.width, 3)

    def _exposure(self, obs: Observation, light: WeatherLight) -> float:
        """Return the gain of automatic exposure."""
        return light.exposure(
            lamplight(self._g, obs.world_from_sensor[:, 3], obs.parts) if light.lamplight > 0.0 else 1.0
        )

    def _rain(self, obs: Observation, seed: int, light: WeatherLight, time: float) -> DeviceArray:
        if light.rain <= 0.0:
            return wp.zeros(1, dtype=wp.int32, device=self._device)
        cover = wp.zeros(obs.camera.width * obs.camera.height, dtype=wp.int32, device=self._device)
        rain = rain_at(obs.world_from_sensor, light, time, seed)
        view = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
        rain_record = struct_array([rain], self._device)
        passes.draw_rain(drop_count(light), rain_record, obs.device_depth, view, obs.camera, cover, self._device)
        return cover
