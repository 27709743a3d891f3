"""Motion blur: the poses of a neighbouring frame, and a plate's light over the exposure."""

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
from recipe_runtime.render.device.arrays import DeviceArray, filled
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.raster.observation import Observation
from recipe_runtime.render.scene.camera import pinhole_of, upload_transforms, view_from_parts
from recipe_runtime.render.scene.geometry import Geometry


@dataclass(frozen=True)
class NeighbourFrame:
    """A neighbouring frame: where everything was (or will be), `seconds` away."""

    world_from_sensor: Array  # [3, 4]
    parts: Array  # [P, 3, 4]
    seconds: float


def frames_open(response: CameraResponse, neighbour: NeighbourFrame) -> float:
    """The exposure in steps from the frame to its neighbour; the intensity makes it longer or shorter."""
    return response.motion_blur_intensity / (response.shutter_speed * neighbour.seconds)


def then_from_now(world_from_sensor: Array, parts: Array, neighbour: NeighbourFrame) -> Array:
    """Where, in the camera's frame of the other moment, a point of a part is that is seen here now. [1 + P, 3, 4]."""
    then = view_from_parts(neighbour.world_from_sensor, neighbour.parts)
    return compose(then, invert(view_from_parts(world_from_sensor, parts)))


def blurred(
    light: DeviceArray,
    plate: Observation,
    g: Geometry,
    response: CameraResponse,
    neighbour: NeighbourFrame,
    device: str,
) -> DeviceArray:
    """A plate's light, vec3f [H * W], over the exposure."""
    camera = plate.camera
    shutter = filled(
        Shutter(),
        wide=camera.width,
        high=camera.height,
        frames=frames_open(response, neighbour),
        most=float(np.float32(response.motion_blur_max_distortion * camera.width)),
    )
    pixels = camera.width * camera.height
    tiles = -(-camera.width // int(TILE)) * -(-camera.height // int(TILE))
    motion, out = wp.empty(pixels, dtype=wp.vec2f, device=device), wp.empty(pixels, dtype=wp.vec3f, device=device)
    own, around = (wp.empty(tiles, dtype=wp.vec2f, device=device) for _ in range(2))
    launch(
        screen_motion,
        pixels,
        device,
        keys=plate.keys,
        triangles=g.triangles,
        vertex_part=g.vertex_part,
        then_from_now=upload_transforms(then_from_now(plate.world_from_sensor, plate.parts, neighbour), device),
        pinhole=pinhole_of(camera, 1),
        shutter=shutter,
        out_motion=motion,
    )
    launch(longest_in_tile, tiles, device, motion=motion, shutter=shutter, out_longest=own)
    launch(longest_around_tile, tiles, device, longest=own, shutter=shutter, out_longest=around)
    shared = {"plate": light, "keys": plate.keys, "motion": motion, "longest": around}
    launch(average_exposure, pixels, device, shutter=shutter, out_light=out, **shared)
    return out
