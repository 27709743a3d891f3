"""The map of patches: the patch that each pixel's centre shows, exact like all labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recipe_runtime.render.device.arrays import DeviceArray, struct_array
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.patches.patch_kernels import number_patches
from recipe_runtime.render.raster.distortion import apply_distortion
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.sampling.sampler import FrameSamples


def patch_map(obs: Observation, points: FrameSamples, patches: DeviceArray, device: str) -> NDArray[np.uint8]:
    """Return the patch that each pixel shows.

    Args:
        obs: The observation of the picture.
        points: The samples of the undistorted image, one per pixel.
        patches: A one-element array of `PatchArrays`.
        device: The Warp device.

    Returns:
        uint8 [H, W], 1 + the index of the topmost patch at the pixel's centre; 0 where there is none.
    """
    pixels = points.starts.size
    words = wp.empty(pixels, dtype=wp.uint64, device=device)
    samples = struct_array([points.data], device)
    launch(number_patches, pixels, device, starts=points.starts, samples=samples, patches=patches, out_words=words)
    numbers = apply_distortion(words, obs.camera, device).numpy()
    shown: NDArray[np.uint8] = numbers.astype(np.uint8).reshape(obs.camera.height, obs.camera.width)
    return shown
