"""The renderer of one scene: observes it from poses and shades the observations in appearances.

It caches what frames may share (geometry, static views, shadow maps), which changes no byte.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan

from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.core.timings import Timings
from recipe_runtime.core.transforms import Array
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.render.camera.camera_pass import CameraPass
from recipe_runtime.render.camera.motion_blur import NeighbourFrame
from recipe_runtime.render.device.reuse import ALL_REUSE, TemporalReuse
from recipe_runtime.render.gpu.frame_stream import FrameStream
from recipe_runtime.render.lighting.shading import ShadingPass
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.raster.observer import Observer
from recipe_runtime.render.retexture.patched_frame import PatchedFrame
from recipe_runtime.render.sampling.sampler import Sampler
from recipe_runtime.render.scene.geometry import upload
from recipe_runtime.render.shadows.shadow_maps import ShadowMaps
from recipe_runtime.render.texture.mipmaps import ImageAtlases, Images, no_images


class Renderer:
    """Renders one scene: first the bodies of the town (instance 0), then the actors', parts in the Trace's order."""

    def __init__(
        self,
        bodies: Sequence[Body],
        device: str = "cpu",
        *,
        reuse: TemporalReuse = ALL_REUSE,
        images: Images | None = None,
    ) -> None:
        """`images` returns an image's pixels; without it appearances may not have images."""
        self.timings, self._device = Timings(), device
        self._geometry = upload(bodies, device)
        self._observer = Observer(self._geometry, device, self.timings, reuse)
        self._atlases = ImageAtlases(self._geometry, images, device)
        sampler = Sampler(self._geometry, self._observer, device, self.timings, reuse)
        shading = ShadingPass(self._geometry, self._atlases, device, self.timings, reuse)
        self._images = images or no_images
        self._camera = CameraPass(self._geometry, self._observer, sampler, shading, device, self.timings, reuse)

    def observe(
        self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
    ) -> Observation:
        """Return the observation from `world_from_sensor` [3, 4] (x forward, y left, z up); `parts` is [P, 3, 4].

        `lamps` int32 [A] is a mask of `LampState` for each actor; None: none of them is lit.
        """
        return self._observer.observe(camera, world_from_sensor, parts, lamps)

    def shade(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: NeighbourFrame | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture of an observation, 8-bit sRGB [H, W, 3]; `time` of the frame in seconds.

        `neighbour` is the frame before or after, for motion blur; without it there is none.
        """
        return self._camera.develop(obs, appearance, sensor_name, frame, time, neighbour)

    def unrounded(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: NeighbourFrame | None = None,
    ) -> NDArray[np.float64]:
        """Return the picture before it is rounded to 8 bits, [H, W, 3], 0 to 1; arguments are those of `shade`."""
        return self._camera.unrounded(obs, appearance, sensor_name, frame, time, neighbour)

    def radiance(self, obs: Observation, appearance: AppearancePlan, time: float = 0.0) -> NDArray[np.float32]:
        """Return linear relative radiance at pixel centres, [H, W, 3]; for tests and tools."""
        return self._camera.radiance(obs, appearance, time)

    def patch_map(self, obs: Observation, appearance: AppearancePlan, frame: int = 0) -> NDArray[np.uint8]:
        """1 + the number of the topmost patch at each pixel's centre, uint8 [H, W]; 0 where there is none."""
        return self._camera.patch_map(obs, appearance, frame)

    def patched_frame(
        self,
        obs: Observation,
        appearance: AppearancePlan,
        sensor_name: str,
        frame: int,
        time: float,
        *,
        neighbour: NeighbourFrame | None = None,
    ) -> PatchedFrame:
        """Return the frame for rendering with other textures on its patches; arguments are those of `shade`."""
        return PatchedFrame(
            self._camera, self._images, obs, appearance, sensor_name, frame, time, neighbour, self._device
        )

    def frame_stream(
        self,
        camera: CameraPlan,
        sensor_name: str,
        appearances: Sequence[AppearancePlan],
        in_flight: int = 16,
        patched: Sequence[AppearancePlan] = (),
        label_passes: Sequence[LabelPass] = (),
    ) -> FrameStream:
        """Return a stream of frames of a plain camera (`can_stream`), fast on a GPU, with the bytes of `shade`.

        Its frames also have the `patch_map` of each of the appearances `patched`, and the labels of `label_passes`.
        """
        return FrameStream(
            self._geometry,
            ShadowMaps(self._geometry, self._device),
            self._atlases,
            self._device,
            camera,
            sensor_name,
            appearances,
            in_flight,
            patched,
            label_passes,
        )
