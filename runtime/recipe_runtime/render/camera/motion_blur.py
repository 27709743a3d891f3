"""Motion blur: the poses of a neighbouring frame, and a plate's light over the exposure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from recipe_compiler.ir.plan import CameraPlan, CameraResponse

from recipe_runtime.core.transforms import Array, compose, invert
from recipe_runtime.render.camera.motion_blur_kernels import (
    TILE,
    Shutter,
    average_exposure,
    longest_around_tile,
    longest_in_tile,
    screen_motion,
)
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.scene.camera import pinhole_of, view_from_parts


@dataclass(frozen=True)
class NeighbourFrame:
    """A neighbouring frame: where everything was (or will be), `seconds` away."""

    world_from_sensor: Array  # [3, 4]
    parts: Array  # [P, 3, 4]
    seconds: float


def frames_open(response: CameraResponse, moment: NeighbourFrame) -> float:
    """The exposure in steps from the frame to its neighbour; the intensity makes it longer or shorter."""
    return response.motion_blur_intensity / (response.shutter_speed * moment.seconds)


def then_from_now(world_from_sensor: Array, parts: Array, moment: NeighbourFrame) -> Array:
    """Where, in the camera's frame of the other moment, a point of a part is that is seen here now. [1 + P, 3, 4]."""
    then = view_from_parts(moment.world_from_sensor, moment.parts)
    return compose(then, invert(view_from_parts(world_from_sensor, parts)))


def blurred(
    plate: Any, camera: CameraPlan, keys: Any, geometry: Any, rows: Any, frames: float, most: float, device: str
) -> Any:
    """A plate's light over the exposure. `rows` is `then_from_now` on the device, `most` a share of the width."""
    s = Shutter()
    s.wide, s.high, s.frames = camera.width, camera.height, frames
    s.most = float(np.float32(most * camera.width))
    pixels = camera.width * camera.height
    tiles = -(-camera.width // int(TILE)) * -(-camera.height // int(TILE))
    ways, out = wp.empty(pixels, dtype=wp.vec2f, device=device), wp.empty(pixels, dtype=wp.vec3f, device=device)
    own, reached = (wp.empty(tiles, dtype=wp.vec2f, device=device) for _ in range(2))
    inputs = [keys, geometry.triangles, geometry.vertex_part, rows, pinhole_of(camera, 1), s, ways]
    launch(screen_motion, pixels, inputs, device)
    launch(longest_in_tile, tiles, [ways, s, own], device)
    launch(longest_around_tile, tiles, [own, s, reached], device)
    launch(average_exposure, pixels, [plate, keys, ways, reached, s, out], device)
    return out
