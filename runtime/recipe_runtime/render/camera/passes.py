"""The passes from light to pixels, each a launch of one kernel. CameraPass and RecordedFrame both run these.

`starts` and `groups` int32 [H * W] are each pixel's first sample and, in the low bits, its number of samples;
`weights` float32 is each sample's share of its pixel; `cover` int32 [H * W] is the output of `draw_rain`, or has one
element if it does not rain; `response` is a one-element array of the struct `Response`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from recipe_compiler.ir.plan import CameraPlan

from recipe_runtime.render.camera import develop_kernels, rain_kernels
from recipe_runtime.render.device.arrays import DeviceArray
from recipe_runtime.render.device.launch import fields_of, launch
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.lighting.buffers import PixelLevels
from recipe_runtime.render.scene.camera import pinhole_of


@dataclass(frozen=True)
class Exposed:
    """The input of a picture: radiance by sample, samples by pixel, and the rain in front."""

    radiance: DeviceArray  # vec3f by sample
    starts: DeviceArray
    groups: DeviceArray
    weights: DeviceArray
    cover: DeviceArray
    streak: wp.vec3f  # radiance of a streak

    def arguments(self) -> dict[str, Any]:
        """Return them under the names that kernels give them."""
        return fields_of(self, "radiance", "starts", "groups", "weights", "streak") | {"rain_cover": self.cover}


@dataclass(frozen=True)
class Tables:
    """The tables of a response, on the device."""

    gains: DeviceArray  # float32, of the vignette: by pixel, or by the squared distance from the centre
    tone_table: DeviceArray  # uint8 by linear level
    deviates: DeviceArray  # float32, normal deviates of the noise


def draw_rain(
    count: int,
    shower: DeviceArray,
    depth: DeviceArray,
    view_from_world: DeviceArray,
    camera: CameraPlan,
    out_cover: DeviceArray,
    device: str,
) -> None:
    """Add the streaks of `count` drops to the cover of the pixels that they cross.

    `shower` is a one-element array of `Rain`.
    """
    launch(
        rain_kernels.draw_streaks,
        count,
        device,
        shower=shower,
        depth=depth,
        view_from_world=view_from_world,
        pinhole=pinhole_of(camera, 1),
        out_cover=out_cover,
    )


def develop_pixels(
    exposed: Exposed,
    camera: CameraPlan,
    response: DeviceArray,
    tables: Tables,
    kept: int,
    pixels: PixelLevels,
    out_rgb: DeviceArray,
    out_light: DeviceArray | None,
    device: str,
) -> None:
    """Write the bytes of a picture, uint8 [H * W * 3], and the light that they round, vec3f [H * W], if it is wanted.

    Pixels with samples below index `kept` may keep their levels.
    """
    span = camera.width if device == "cpu" else 1  # a GPU has threads to spare
    launch(
        develop_kernels.develop_pixels,
        camera.width * camera.height // span,
        device,
        **exposed.arguments(),
        responses=response,
        kept_samples=kept,
        out_stale=pixels.stale,
        out_levels=pixels.levels,
        **fields_of(tables, "gains", "tone_table", "deviates"),
        pixels_per_thread=span,
        out_rgb=out_rgb,
        out_light=out_light,
    )
