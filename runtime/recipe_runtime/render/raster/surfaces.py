"""The visible surfaces of a frame: what the passes of further labels read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.core.interfaces import LabelPass
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.distortion import distortion_of, undistorted_camera
from recipe_runtime.render.raster.distortion_kernels import Distortion
from recipe_runtime.render.scene.camera import pinhole_of
from recipe_runtime.render.scene.geometry import Geometry, SurfaceKey
from recipe_runtime.render.scene.pinhole import Pinhole


@dataclass(frozen=True)
class VisibleSurfaces:
    """Which triangle each pixel of a frame shows, and where its corners are. View space: x right, y down, z forward."""

    geometry: Geometry
    camera: CameraPlan
    keys: DeviceArray  # uint64 [H * W], visibility at pixel centres: `label_kernels.triangle_of`; 0 for the sky
    vertices: DeviceArray  # vec3f [V] in view space, metres; valid for the triangles that the keys name
    view_from_part: DeviceArray  # float32 [1 + P, 12], from the world and each moving part to view space
    device: str

    @property
    def pixels(self) -> int:
        """Number of the picture's pixels."""
        return self.camera.width * self.camera.height

    @property
    def pinhole(self) -> Pinhole:
        """The camera of the undistorted image; `distortion_kernels.nearest_sample` is a pixel's place in it."""
        return pinhole_of(undistorted_camera(self.camera), 1)

    @property
    def distortion(self) -> Distortion:
        """The mapping from the picture to the undistorted image."""
        return distortion_of(self.camera)

    def drawn(self, label_pass: LabelPass) -> NDArray[np.generic]:
        """Return the array of a pass: [H, W], or [H, W, channels] of a pass with several."""
        kind = wp.dtype_from_numpy(np.dtype(label_pass.dtype))
        out = wp.empty(self.pixels * label_pass.channels, dtype=kind, device=self.device)
        label_pass.draw(self, out)
        array: NDArray[np.generic] = out.numpy().reshape(label_pass.shape(self.camera.width, self.camera.height))
        return array

    def at(self, x: int, y: int) -> SurfaceKey | None:
        """Return the surface that the pixel in column x and row y shows; None for the sky."""
        key = int(self.keys.numpy()[y * self.camera.width + x])
        if key == 0:
            return None
        triangle = key & 0xFFFFFF  # as `label_kernels.triangle_of`
        return self.geometry.surfaces[int(self.geometry.triangle_surface.numpy()[triangle])]
