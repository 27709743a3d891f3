"""Camera effects of several kernels: lens distortion, supersampling, chromatic aberration, bloom, motion blur, mosaic.

Without these effects one kernel turns samples into bytes. With any of them, samples become an undistorted HDR image
first, with the size and resolution that distortion and supersampling need. Motion blur and bloom are applied to it, and
the picture is resampled from it. A sensor with a mosaic measures the resampled light.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.render.camera import bloom, motion_blur
from recipe_runtime.render.camera.bayer_kernels import develop_mosaic, measure
from recipe_runtime.render.camera.develop_kernels import Response, expose_samples
from recipe_runtime.render.camera.motion_blur import NeighbourFrame, ScreenMotion
from recipe_runtime.render.camera.passes import Exposed
from recipe_runtime.render.camera.post_process_kernels import LensEffects, finish_pixels, light_of_pixels
from recipe_runtime.render.camera.responses import ResponseTables
from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import distortion
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.scene.geometry import Geometry


class PostProcess:
    """Finishes the pictures of one scene that need an undistorted HDR image."""

    def __init__(self, geometry: Geometry, observer: Observer, tables: ResponseTables, device: str) -> None:
        self._g, self._observer, self._tables, self._device = geometry, observer, tables, device
        self._undistorted: WeakKeyDictionary[Observation, dict[int, Observation]] = WeakKeyDictionary()

    def undistorted(self, obs: Observation, supersample: int) -> Observation:
        """Return the observation by the undistorted camera; `obs` itself if its camera is that camera."""
        straight = distortion.undistorted_camera(obs.camera, supersample)
        if straight == obs.camera:
            return obs
        by_supersampling = self._undistorted.setdefault(obs, {})
        if supersample not in by_supersampling:
            pose, parts, focal = obs.world_from_sensor, obs.parts, optics.focal_length(obs.camera)
            by_supersampling[supersample] = self._observer.observe(straight, pose, parts, obs.lamps, focal)
        return by_supersampling[supersample]

    def hdr_image(self, exposed: Exposed, undistorted: Observation, r: Response) -> DeviceArray:
        """Return the HDR image, vec3f, row by row, of the light of samples; `r` has the exposure."""
        light = wp.empty(undistorted.camera.width * undistorted.camera.height, dtype=wp.vec3f, device=self._device)
        launch(expose_samples, light.size, self._device, **exposed.arguments(), response=r, out_hdr_image=light)
        return light

    def finish(
        self,
        light: DeviceArray,
        undistorted: Observation,
        obs: Observation,
        response: CameraResponse,
        r: Response,
        neighbour: NeighbourFrame | None,
        out_light: DeviceArray | None = None,
    ) -> DeviceArray:
        """Return the bytes of a picture, uint8 [H * W * 3].

        Args:
            light: The HDR image.
            undistorted: The observation by the undistorted camera.
            obs: The observation of the picture.
            response: The camera's settings.
            r: The same as a struct `Response`, with exposure and noise.
            neighbour: The frame that motion blur takes the motion from, if any.
            out_light: Receives the light that the bytes round, vec3f [H * W]; None if it is not wanted.
        """
        pixels = obs.camera.width * obs.camera.height
        motion = self.motion(undistorted, response, neighbour)
        light, spread = self.spread_light(light, undistorted.camera, response, motion)
        tables = self._tables.by_distance(response)
        out = wp.empty(pixels * 3, dtype=wp.uint8, device=self._device)
        lens = {"hdr_image": light, "spread": spread, "response": r, "lens_circle": tables.gains}
        lens |= lens_arguments(obs.camera, undistorted.camera, response)
        written = {"tone_table": tables.tone_table, "out_rgb": out, "out_light": out_light}
        if response.sensor == "bayer":
            fallen: DeviceArray = wp.empty(pixels, dtype=wp.vec3f, device=self._device)
            mosaic: DeviceArray = wp.empty(pixels, dtype=wp.float32, device=self._device)
            noise = {"response": r, "deviates": tables.deviates}
            launch(light_of_pixels, pixels, self._device, **lens, out_light=fallen)
            launch(measure, pixels, self._device, light=fallen, **noise, out_mosaic=mosaic)
            launch(develop_mosaic, pixels, self._device, mosaic=mosaic, response=r, **written)
        else:
            launch(finish_pixels, pixels, self._device, **lens, deviates=tables.deviates, **written)
        return out

    def motion(
        self, undistorted: Observation, response: CameraResponse, neighbour: NeighbourFrame | None
    ) -> ScreenMotion | None:
        """Return the motion of the HDR image's samples; None without motion blur."""
        if neighbour is None or response.motion_blur_intensity == 0.0:
            return None
        return motion_blur.screen_motion_of(undistorted, self._g, response, neighbour, self._device)

    def spread_light(
        self, light: DeviceArray, undistorted: CameraPlan, response: CameraResponse, motion: ScreenMotion | None
    ) -> tuple[DeviceArray, DeviceArray]:
        """Return an HDR image with motion blur, and its bloom image; without bloom, the former twice."""
        if motion is not None:
            light = motion_blur.blurred(light, motion, self._device)
        return light, bloom.spread(light, undistorted, self._device) if response.bloom_intensity > 0.0 else light

    def lens_circle(self, response: CameraResponse) -> DeviceArray:
        """Return the gains of the lens circle, float32, by squared distance from the centre."""
        return self._tables.by_distance(response).gains


def lens_arguments(camera: CameraPlan, undistorted: CameraPlan, response: CameraResponse) -> dict[str, Any]:
    """Return the arguments `distortion` and `effects` of kernels that resample an HDR image."""
    effects = set_fields(
        LensEffects(),
        fringe=0.01 * response.chromatic_aberration_intensity,
        clear=response.chromatic_aberration_offset,
        bloom=bloom.SHARE * response.bloom_intensity,
        coarse=bloom.side_of(undistorted),
    )
    return {"distortion": distortion.distortion_of(camera, response.supersample), "effects": effects}


def needs_post_process(camera: CameraPlan, response: CameraResponse, neighbour: NeighbourFrame | None) -> bool:
    """Return whether a picture needs more than one kernel."""
    return (
        optics.bends(camera)
        or response.supersample > 1
        or response.chromatic_aberration_intensity > 0.0
        or response.bloom_intensity > 0.0
        or response.sensor is not None
        or (neighbour is not None and response.motion_blur_intensity > 0.0)
    )
