"""Motion blur, host side: the poses of a neighbouring frame, and the blur of an HDR image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from recipe_compiler.ir.plan import CameraResponse

from recipe_runtime.core.transforms import Array, compose, invert
from recipe_runtime.render.camera.motion_blur_kernels import (
    TILE,
    Shutter,
    average_exposure,
    longest_around_tile,
    longest_in_tile,
    screen_motion,
)
from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts
from recipe_runtime.render.scene.geometry import Geometry


@dataclass(frozen=True)
class NeighbourFrame:
    """The poses of a frame that is `seconds` earlier or later."""

    world_from_sensor: Array  # [3, 4]
    parts: Array  # [P, 3, 4]
    seconds: float


def frames_open(response: CameraResponse, neighbour: NeighbourFrame) -> float:
    """Return the length of the exposure in intervals between the frame and its neighbour, scaled by the intensity."""
    return response.motion_blur_intensity / (response.shutter_speed * neighbour.seconds)


def then_from_now(world_from_sensor: Array, parts: Array, neighbour: NeighbourFrame) -> Array:
    """Return, by part, the transforms from this frame's view space to the neighbour's, [1 + P, 3, 4]."""
    then = view_from_parts(neighbour.world_from_sensor, neighbour.parts)
    return compose(then, invert(view_from_parts(world_from_sensor, parts)))


@dataclass(frozen=True, eq=False)
class ScreenMotion:
    """The motion of an HDR image's samples during the exposure."""

    keys: DeviceArray  # visibility keys, uint64 [H * W]
    motion: DeviceArray  # vec2f [H * W], in samples
    longest: DeviceArray  # vec2f, the longest motion that reaches each tile
    shutter: Shutter

    def arguments(self) -> dict[str, object]:
        """Return the arguments of kernels, by name."""
        return {"keys": self.keys, "motion": self.motion, "longest": self.longest, "shutter": self.shutter}


def screen_motion_of(
    undistorted: Observation, g: Geometry, response: CameraResponse, neighbour: NeighbourFrame, device: str
) -> ScreenMotion:
    """Return the motion of the samples of an HDR image.

    Args:
        undistorted: The observation by its camera.
        g: The geometry of the scene.
        response: The camera's settings.
        neighbour: The frame that the motion is taken from.
        device: The device of the arrays.
    """
    camera = undistorted.camera
    shutter = set_fields(
        Shutter(),
        wide=camera.width,
        high=camera.height,
        frames=frames_open(response, neighbour),
        max_length=float(np.float32(response.motion_blur_max_distortion * camera.width)),
    )
    pixels = camera.width * camera.height
    tiles = -(-camera.width // int(TILE)) * -(-camera.height // int(TILE))
    motion = wp.empty(pixels, dtype=wp.vec2f, device=device)
    own, around = (wp.empty(tiles, dtype=wp.vec2f, device=device) for _ in range(2))
    launch(
        screen_motion,
        pixels,
        device,
        keys=undistorted.keys,
        triangles=g.triangles,
        vertex_part=g.vertex_part,
        then_from_now=upload_transforms(
            then_from_now(undistorted.world_from_sensor, undistorted.parts, neighbour), device
        ),
        pinhole=pinhole_of(camera, 1),
        shutter=shutter,
        out_motion=motion,
    )
    launch(longest_in_tile, tiles, device, motion=motion, shutter=shutter, out_longest=own)
    launch(longest_around_tile, tiles, device, longest=own, shutter=shutter, out_longest=around)
    return ScreenMotion(undistorted.keys, motion, around, shutter)


def blurred(light: DeviceArray, motion: ScreenMotion, device: str) -> DeviceArray:
    """Return an HDR image, vec3f [H * W], with motion blur."""
    out = wp.empty(light.size, dtype=wp.vec3f, device=device)
    launch(average_exposure, light.size, device, hdr_image=light, out_light=out, **motion.arguments())
    return out
