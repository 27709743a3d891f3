"""Pictures that take more than one kernel: lens distortion, supersampling, chromatic aberration, bloom, motion blur.

A plain camera's samples become bytes in one kernel. Any other's become a plate first: a straight picture of light,
wider and finer as its lens and its supersampling need. Motion blur and bloom act there, and the picture is resampled
from it.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.render.camera import bloom, motion_blur, passes
from recipe_runtime.render.camera.develop_kernels import Response
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.camera.passes import Exposed
from recipe_runtime.render.camera.post_process_kernels import LensEffects, finish_pixels
from recipe_runtime.render.camera.responses import ResponseTables
from recipe_runtime.render.device.arrays import DeviceArray, filled
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster import distortion
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.scene.geometry import Geometry


class PostProcess:
    """Finishes the pictures of one scene that need a plate."""

    def __init__(self, geometry: Geometry, observer: Observer, tables: ResponseTables, device: str) -> None:
        self._g, self._observer, self._tables, self._device = geometry, observer, tables, device
        self._plates: WeakKeyDictionary[Observation, dict[int, Observation]] = WeakKeyDictionary()

    def plate_of(self, obs: Observation, supersample: int) -> Observation:
        """The observation of the plate; the observation itself if it is its own plate."""
        straight = distortion.plate_of(obs.camera, supersample)
        if straight == obs.camera:
            return obs
        plates = self._plates.setdefault(obs, {})
        if supersample not in plates:
            plates[supersample] = self._observer.observe(straight, obs.world_from_sensor, obs.parts)
        return plates[supersample]

    def finish(
        self,
        exposed: Exposed,
        plate: Observation,
        obs: Observation,
        response: CameraResponse,
        r: Response,
        neighbour: NeighbourFrame | None,
    ) -> DeviceArray:
        """The bytes of a picture, uint8 [H * W * 3]; `r` is its struct `Response`."""
        device, pixels = self._device, obs.camera.width * obs.camera.height
        light = wp.empty(plate.camera.width * plate.camera.height, dtype=wp.vec3f, device=device)
        passes.expose_samples(exposed, r, light, device)
        if neighbour is not None and response.motion_blur_intensity > 0.0:
            light = motion_blur.blurred(light, plate, self._g, response, neighbour, device)
        tables = self._tables.by_distance(response)
        out = wp.empty(pixels * 3, dtype=wp.uint8, device=device)
        launch(
            finish_pixels,
            pixels,
            device,
            plate=light,
            spread=bloom.spread(light, plate.camera, device) if response.bloom_intensity > 0.0 else light,
            distortion=distortion.distortion_of(obs.camera, response.supersample),
            effects=_effects_of(response, plate.camera),
            response=r,
            lens_circle=tables.gains,
            tone_table=tables.tone,
            deviates=tables.deviates,
            out_rgb=out,
        )
        return out


def needs_post_process(camera: CameraPlan, response: CameraResponse, neighbour: NeighbourFrame | None) -> bool:
    """Whether a picture takes more than one kernel."""
    return (
        optics.bends(camera)
        or response.supersample > 1
        or response.chromatic_aberration_intensity > 0.0
        or response.bloom_intensity > 0.0
        or (neighbour is not None and response.motion_blur_intensity > 0.0)
    )


def _effects_of(response: CameraResponse, plate: CameraPlan) -> LensEffects:
    return filled(
        LensEffects(),
        fringe=0.01 * response.chromatic_aberration_intensity,
        clear=response.chromatic_aberration_offset,
        bloom=bloom.SHARE * response.bloom_intensity,
        coarse=bloom.side_of(plate),
    )
