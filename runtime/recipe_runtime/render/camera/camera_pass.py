"""From the light of a frame's samples to a picture: rain, exposure, tone, noise and the effects of lens and shutter."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraResponse

from recipe_runtime.render.camera import develop_kernels, post_process, rain_kernels
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.camera.rain import rain_at, streak_radiance
from recipe_runtime.render.device.arrays import record
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.reuse import TemporalReuse
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.device.timings import Timings
from recipe_runtime.render.lighting.lights import lamplight
from recipe_runtime.render.lighting.shading import SampleLight, ShadingPass
from recipe_runtime.render.lighting.weather_light import Light
from recipe_runtime.render.numeric.seeds import noise_key
from recipe_runtime.render.raster.observation import Observation, depth_on
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.sampling.sampler import Sampler
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts
from recipe_runtime.render.scene.geometry import Geometry


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
        self._g, self._observer, self._device, self._timings = geometry, observer, device, timings
        self._sampler, self._shading, self._reuse = sampler, shading, reuse
        self._tables = post_process.ResponseTables(device)

    def develop(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor: str,
        frame: int,
        time: float,
        moment: NeighbourFrame | None = None,
    ) -> NDArray[np.uint8]:
        """8-bit sRGB [H, W, 3]; `moment` is a neighbouring frame, which motion blur takes."""
        response = appearance.responses.get(sensor) or CameraResponse()
        plate = post_process.observe_plate(self._observer, obs, response.supersample)
        points = self._sampler.points(plate, response.antialias)
        light = self._shading.light_of(appearance, time)
        linear, shaded = self._shading.shade(plate, points, appearance, sensor, light)
        with self._timings("rain"):
            drops = self._rain(plate, appearance.seed, light, time)
        with self._timings("develop"):
            key = noise_key(appearance.seed, sensor, frame)
            r = post_process.response_of(response, self._exposure(obs, light), key, obs.camera)
            streak = streak_radiance(light)
            inputs = [linear, points.starts, points.groups, points.weights, drops, streak, r]
            if post_process.needs_post_process(obs.camera, response, moment):
                exposed = wp.empty(plate.camera.width * plate.camera.height, dtype=wp.vec3f, device=self._device)
                launch(develop_kernels.expose_samples, exposed.shape[0], [*inputs, exposed], self._device)
                told = [r, *self._tables.of(response)]
                out = post_process.finish(exposed, plate, obs, response, told, self._g, moment, self._device)
            else:
                out = wp.empty(r.width * r.height * 3, dtype=wp.uint8, device=self._device)
                inputs[-1] = record(r, self._device)
                inputs += [shaded.kept, *shaded.levels, *self._tables.straight(response, obs.camera)]
                span = r.width if self._device == "cpu" else 1  # a GPU has threads to spare
                with self._developed_anew(shaded):
                    launch(
                        develop_kernels.develop_pixels, r.width * r.height // span, [*inputs, span, out], self._device
                    )
            picture: NDArray[np.uint8] = out.numpy().reshape(r.height, r.width, 3)
        return picture

    @contextmanager
    def _developed_anew(self, shaded: SampleLight) -> Iterator[None]:
        """With pixel reuse off, mark every pixel as stale; afterwards only those are that the kernel leaves so."""
        if self._reuse.pixels or not shaded.kept:
            yield
            return
        stale = shaded.levels[0].numpy()
        before = stale.copy()
        stale.fill(1)
        yield
        stale &= before

    def radiance(self, obs: Observation, appearance: AppearancePlan, time: float) -> NDArray[np.float32]:
        """Linear radiance at pixel centres, float32 [H, W, 3]."""
        points = self._sampler.points(obs, antialias=False)
        linear, _ = self._shading.shade(obs, points, appearance, "", self._shading.light_of(appearance, time))
        values: NDArray[np.float32] = linear.numpy()[points.starts.numpy()]
        return values.reshape(obs.camera.height, obs.camera.width, 3)

    def _exposure(self, obs: Observation, light: Light) -> float:
        """What a camera would choose here by itself."""
        return light.exposure(lamplight(self._g, obs.world_from_sensor[:, 3]) if light.lamplight > 0.0 else 1.0)

    def _rain(self, obs: Observation, seed: int, light: Light, time: float) -> Any:
        if light.rain <= 0.0:
            return wp.zeros(1, dtype=wp.int32, device=self._device)
        cover = wp.zeros(obs.camera.width * obs.camera.height, dtype=wp.int32, device=self._device)
        shower = rain_at(obs.world_from_sensor, light, time)
        shower.key = noise_key(seed, "rain", 0)
        view = upload_transforms(view_from_parts(obs.world_from_sensor, obs.parts)[:1], self._device)
        inputs = [record(shower, self._device), depth_on(obs, self._device), view, pinhole_of(obs.camera, 1), cover]
        launch(rain_kernels.draw_streaks, shower.count, inputs, self._device)
        return cover
