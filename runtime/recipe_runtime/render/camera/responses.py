"""Camera responses as numbers and tables on a device: exposure, white balance, vignette, tone curve, noise."""

from __future__ import annotations

from typing import Any

from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.render.camera import exposure
from recipe_runtime.render.camera.develop_kernels import LEVELS, Response, vignette_gains
from recipe_runtime.render.camera.passes import Tables
from recipe_runtime.render.device.arrays import set_fields, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp


class ResponseTables:
    """The tables of responses, cached."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._held: dict[tuple[float, ...], Tables] = {}
        self._gains: dict[tuple[float, ...], Any] = {}
        self._deviates: wp.array[wp.float32] = wp.array(exposure.deviates(), dtype=wp.float32, device=device)

    def by_distance(self, response: CameraResponse) -> Tables:
        """Return tables with the gains of the lens circle, float32 [RIM_STEPS + 1], by squared distance."""
        key = response.lens_circle_multiplier, response.lens_circle_falloff, response.gamma
        if key not in self._held:
            levels = exposure.tone_table(int(LEVELS), response.gamma)
            self._held[key] = Tables(
                wp.array(exposure.lens_circle(response), dtype=wp.float32, device=self._device),
                wp.array(levels, dtype=wp.uint8, device=self._device),
                self._deviates,
            )
        return self._held[key]

    def by_pixel(self, response: CameraResponse, camera: CameraPlan) -> Tables:
        """Return tables with the gains of the vignette, by pixel, float32 [H * W]."""
        tables = self.by_distance(response)
        dark = response.lens_circle_multiplier, response.lens_circle_falloff, response.vignette_intensity
        key = (*dark, camera.width, camera.height)
        if key not in self._gains:
            gains = wp.empty(camera.width * camera.height, dtype=wp.float32, device=self._device)
            response_record = struct_array([response_of(response, 1.0, 0, camera)], self._device)
            circle = {"lens_circle": tables.gains}
            launch(vignette_gains, gains.size, self._device, responses=response_record, **circle, out_gains=gains)
            self._gains[key] = gains
        return Tables(self._gains[key], tables.tone_table, tables.deviates)


def response_of(response: CameraResponse, automatic: float, key: int, camera: CameraPlan) -> Response:
    """Return the struct `Response`; `automatic` is the gain of automatic exposure, `key` that of the noise."""
    return set_fields(
        Response(),
        exposure=exposure.gain(response, automatic),
        white=wp.vec3f(*exposure.white(response)),
        noise=exposure.noise_strength(response),
        vignette=0.8 * response.vignette_intensity,
        rim=int(response.lens_circle_multiplier > 0.0),
        key=key,
        width=camera.width,
        height=camera.height,
    )
