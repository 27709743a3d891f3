"""The map of patches: the patch that each pixel's centre shows, exact like all labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import optics
from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.patches.patch_kernels import number_patches
from recipe_runtime.render.raster.distortion import apply_distortion
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.scene.camera import pinhole_of


def draw_patch_numbers(
    keys: DeviceArray,
    camera: CameraPlan,
    scene: DeviceArray,
    samples: DeviceArray,
    patches: DeviceArray,
    out_numbers: DeviceArray,
    device: str,
) -> None:
    """Write 1 + the index of the topmost patch at each pixel's centre, uint8 [H * W]; 0 where there is none.

    Args:
        keys: Visibility keys of the pixels, uint64 [H * W].
        camera: The undistorted camera that has these keys.
        scene: A one-element array of `SceneArrays`.
        samples: A one-element array of `Samples`, with the frame's transforms, focal length and eye.
        patches: A one-element array of `PatchArrays`.
        out_numbers: The output.
        device: The Warp device.
    """
    launch(
        number_patches,
        keys.size,
        device,
        keys=keys,
        pinhole=pinhole_of(camera, 1),
        scene=scene,
        samples=samples,
        patches=patches,
        out_numbers=out_numbers,
    )


def patch_map(
    obs: Observation,
    undistorted: Observation,
    scene: DeviceArray,
    samples: DeviceArray,
    patches: DeviceArray,
    device: str,
) -> NDArray[np.uint8]:
    """Return the patch that each pixel shows.

    Args:
        obs: The observation of the picture.
        undistorted: The same by the undistorted camera.
        scene: See `draw_patch_numbers`.
        samples: See there.
        patches: See there.
        device: The Warp device.

    Returns:
        uint8 [H, W], 1 + the index of the topmost patch at the pixel's centre; 0 where there is none.
    """
    out = wp.empty(undistorted.keys.size, dtype=wp.uint8, device=device)
    draw_patch_numbers(undistorted.keys, undistorted.camera, scene, samples, patches, out, device)
    shown: NDArray[np.uint8] = out.numpy()
    if optics.bends(obs.camera):
        words: DeviceArray = wp.array(shown.astype(np.uint64), dtype=wp.uint64, device=device)
        shown = apply_distortion(words, obs.camera, device).numpy().astype(np.uint8)
    return shown.reshape(obs.camera.height, obs.camera.width)
