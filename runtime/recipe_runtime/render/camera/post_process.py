"""From exposed samples to a picture, for a camera that does more than see through a pinhole: the host's side.

A plain camera's samples become bytes in one kernel. Any other's become a plate first: a straight picture of light,
wider and finer as its lens and its supersampling ask. There motion blur and bloom act; the picture is cut from it.
"""

from __future__ import annotations

from typing import Any

from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.render.camera import bloom, develop_kernels, exposure, motion_blur, post_process_kernels
from recipe_runtime.render.device.arrays import record
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import distortion
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.scene.camera import upload_transforms
from recipe_runtime.render.scene.geometry import Geometry


class ResponseTables:
    """The tables of the responses met, on the device."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._held: dict[Any, tuple[Any, Any, Any]] = {}
        self._gains: dict[Any, Any] = {}
        self._bells = wp.array(exposure.deviates(), dtype=wp.float32, device=device)

    def of(self, response: CameraResponse) -> tuple[Any, Any, Any]:
        """The rim's gains by the distance from the centre, the levels, and the noise's deviates."""
        key = response.lens_circle_multiplier, response.lens_circle_falloff, response.gamma
        if key not in self._held:
            levels = exposure.tone_table(int(develop_kernels.LEVELS), response.gamma)
            self._held[key] = (
                wp.array(exposure.lens_circle(response), dtype=wp.float32, device=self._device),
                wp.array(levels, dtype=wp.uint8, device=self._device),
                self._bells,
            )
        return self._held[key]

    def straight(self, response: CameraResponse, plan: CameraPlan) -> tuple[Any, Any, Any]:
        """The same for a camera whose picture is its plate: the gains by pixel instead."""
        rims, *others = self.of(response)
        dark = response.lens_circle_multiplier, response.lens_circle_falloff, response.vignette_intensity
        key = (*dark, plan.width, plan.height)
        if key not in self._gains:
            gains = wp.empty(plan.width * plan.height, dtype=wp.float32, device=self._device)
            told = record(response_of(response, 1.0, 0, plan), self._device)
            launch(develop_kernels.vignette_gains, gains.size, [told, rims, gains], self._device)
            self._gains[key] = gains
        return self._gains[key], *others


def response_of(response: CameraResponse, automatic: float, key: int, plan: CameraPlan) -> Any:
    """A response as kernels want it; `automatic` is the exposure for sun, weather and lamps."""
    r = develop_kernels.Response()
    r.exposure, r.noise = exposure.gain(response, automatic), exposure.noise_strength(response)
    r.white = wp.vec3f(*exposure.white(response))
    r.vignette, r.rim = 0.8 * response.vignette_intensity, int(response.lens_circle_multiplier > 0.0)
    r.key, r.width, r.height = key, plan.width, plan.height
    return r


def needs_post_process(plan: CameraPlan, response: CameraResponse, moment: motion_blur.NeighbourFrame | None) -> bool:
    """Whether a picture takes more than one kernel."""
    return (
        optics.bends(plan)
        or response.supersample > 1
        or response.chromatic_aberration_intensity > 0.0
        or response.bloom_intensity > 0.0
        or (moment is not None and response.motion_blur_intensity > 0.0)
    )


def observe_plate(observer: Observer, obs: Observation, supersample: int) -> Observation:
    """What the plate of an observation sees; the observation itself if that is its own plate."""
    straight = distortion.plate_of(obs.camera, supersample)
    if straight == obs.camera:
        return obs
    name = f"plate {supersample}"
    if name not in obs.derived:
        obs.derived[name] = observer.observe(straight, obs.world_from_sensor, obs.parts)
    plate: Observation = obs.derived[name]
    return plate


def finish(
    plate: Any,
    seen: Observation,
    obs: Observation,
    response: CameraResponse,
    told: list[Any],
    geometry: Geometry,
    moment: motion_blur.NeighbourFrame | None,
    device: str,
) -> Any:
    """The bytes of a picture, uint8 [H * W * 3], from the light of its plate, which `seen` is the observation of."""
    if moment is not None and response.motion_blur_intensity > 0.0:
        rows = upload_transforms(motion_blur.then_from_now(seen.world_from_sensor, seen.parts, moment), device)
        frames = motion_blur.frames_open(response, moment)
        most = response.motion_blur_max_distortion
        plate = motion_blur.blurred(plate, seen.camera, seen.keys, geometry, rows, frames, most, device)
    end = post_process_kernels.LensEffects()
    end.fringe = 0.01 * response.chromatic_aberration_intensity
    end.clear = response.chromatic_aberration_offset
    end.bloom = bloom.SHARE * response.bloom_intensity
    end.coarse = bloom.side_of(seen.camera)
    shed = bloom.spread(plate, seen.camera, device) if response.bloom_intensity > 0.0 else plate
    out = wp.empty(obs.camera.width * obs.camera.height * 3, dtype=wp.uint8, device=device)
    curve = distortion.distortion_of(obs.camera, response.supersample)
    inputs = [plate, shed, curve, end, *told, out]
    launch(post_process_kernels.finish_pixels, obs.camera.width * obs.camera.height, inputs, device)
    return out
