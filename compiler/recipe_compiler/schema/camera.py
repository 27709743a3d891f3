"""The sensors of a recipe: mount, camera and motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir import optics
from recipe_compiler.ir.modalities import Modality
from recipe_compiler.schema.fields import (
    ActorName,
    Degrees,
    Loose,
    Magnitude,
    Metres,
    Model,
    Turn,
    bounded,
    distinct,
    ordered,
)

Span = Annotated[tuple[Degrees, Degrees], Loose, AfterValidator(ordered)]
Sway = Annotated[Span | None, Field(description="[lowest, highest], degrees, added to the mount's.")]


class Mount(Model):
    """Where a sensor is: x forward, y left, z up; positive pitch looks down."""

    on: Annotated[ActorName | None, Field(description="An actor whose frame this is; absent: the world.")] = None
    x: Annotated[Metres, Field(description="Metres.")] = 0.0
    y: Annotated[Metres, Field(description="Metres.")] = 0.0
    z: Annotated[Metres, Field(description="Metres.")] = 0.0
    yaw: Annotated[Degrees, Field(description="Degrees, counter-clockwise.")] = 0.0
    pitch: Annotated[Degrees, Field(description="Degrees, down.")] = 0.0
    roll: Annotated[Degrees, Field(description="Degrees, to the right.")] = 0.0


class Camera(Model):
    """A camera and what it makes of light; names are CARLA's where it has one."""

    width: Annotated[int, Field(ge=16, le=4096, description="Pixels.")] = 800
    height: Annotated[int, Field(ge=16, le=4096, description="Pixels.")] = 600
    fov: Annotated[float, bounded(1, 170, "Horizontal field of view, degrees.")] = 90.0
    near: Annotated[float, bounded(0.01, 10, "Nearest depth, metres.")] = 0.1
    far: Annotated[float, bounded(20, 10_000, "Farthest depth, metres.")] = 1000.0
    lens_k: Annotated[float, bounded(-1, 1, "Distortion: above 0 barrel, below pincushion.")] = 0.0
    lens_kcube: Annotated[float, bounded(-1, 1, "Distortion that grows faster to the corners.")] = 0.0
    exposure_mode: Annotated[
        Literal["auto", "manual"],
        Field(description="auto: by sun, weather and lamps; manual: by shutter, iso and fstop."),
    ] = "auto"
    exposure_compensation: Annotated[float, bounded(-15, 15, "Stops on top of the exposure.")] = 0.0
    shutter_speed: Annotated[float, bounded(1, 10_000, "1/s: 200 is open for 1/200 s.")] = 200.0
    iso: Annotated[float, bounded(25, 102_400, "Sensitivity; noise grows as its root.")] = 100.0
    fstop: Annotated[float, bounded(0.7, 32, "f-number; for the manual exposure.")] = 1.4
    gamma: Annotated[float, bounded(0.5, 5, "2.2: sRGB; above: brighter.")] = 2.2
    temp: Annotated[float, bounded(1500, 15_000, "Kelvin of the light taken for white.")] = 6500.0
    tint: Annotated[float, bounded(-1, 1, "-1 green to 1 magenta.")] = 0.0
    noise: Annotated[float, bounded(0, 10, "0: none; 1: a good street camera's.")] = 1.0
    vignette_intensity: Annotated[float, bounded(0, 1, "How much darker corners are; 0: none.")] = 0.4
    lens_circle_multiplier: Annotated[float, bounded(0, 10, "How dark the lens's rim is; 0: none.")] = 0.0
    lens_circle_falloff: Annotated[float, bounded(0, 10, "How near to the corners the rim stays.")] = 5.0
    chromatic_aberration_intensity: Annotated[
        float, bounded(0, 10, "Percent by which red and blue part at corners.")
    ] = 0.0
    chromatic_aberration_offset: Annotated[float, bounded(0, 0.99, "Radius from which they part; 1: the corners.")] = (
        0.0
    )
    bloom_intensity: Annotated[float, bounded(0, 5, "Light that bright places shed about them.")] = 0.0
    motion_blur_intensity: Annotated[float, bounded(0, 10, "0: none; 1: as long as the shutter is open.")] = 0.0
    motion_blur_max_distortion: Annotated[float, bounded(0, 1, "Longest blur, as a share of the width.")] = 0.35
    antialias: Annotated[bool, Field(description="Smooth edges in RGB; labels never are.")] = True
    supersample: Annotated[int, Field(ge=1, le=4, description="RGB samples along a pixel's side.")] = 1
    enable_postprocess_effects: Annotated[
        bool, Field(description="false: no noise, vignette, rim, aberration, bloom or motion blur.")
    ] = True

    @model_validator(mode="after")
    def _can_be_drawn(self) -> Camera:
        wrong = optics.fault(self, self.supersample)
        if wrong is not None:
            key = "supersample" if "samples a frame" in wrong else "lens_k" if self.lens_k else "lens_kcube"
            raise PydanticCustomError(
                "optics", "{value} {wrong}", {"key": key, "value": f"{getattr(self, key):g}", "wrong": wrong}
            )
        return self


class Target(Model):
    """Where linear motion ends; an absent coordinate is the mount's."""

    x: Annotated[Metres | None, Field(description="Metres.")] = None
    y: Annotated[Metres | None, Field(description="Metres.")] = None
    z: Annotated[Metres | None, Field(description="Metres.")] = None


class Linear(Model):
    """From the mount to a point, straight, then it stays there."""

    to: Annotated[Target, Field(description="In the mount's frame.")]
    speed: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False, description="m/s.")]


class Rotation(Model):
    """A smooth sweep to and fro, a sine over time, that starts midway."""

    yaw: Sway = None
    pitch: Sway = None
    roll: Sway = None
    period: Annotated[float, bounded(0.1, 86_400, "Seconds to and fro.")]


class Jitter(Model):
    """Uniform between -m and m at every frame, on the whole rig, never added up."""

    x: Annotated[Magnitude, Field(description="Metres.")] = 0.0
    y: Annotated[Magnitude, Field(description="Metres.")] = 0.0
    z: Annotated[Magnitude, Field(description="Metres.")] = 0.0
    yaw: Annotated[Turn, Field(description="Degrees.")] = 0.0
    pitch: Annotated[Turn, Field(description="Degrees.")] = 0.0
    roll: Annotated[Turn, Field(description="Degrees.")] = 0.0


class Motion(Model):
    """How a rig moves in its mount's frame; any of the three, together."""

    linear: Annotated[Linear | None, Field(description="Along a line.")] = None
    rotation: Annotated[Rotation | None, Field(description="To and fro.")] = None
    jitter: Annotated[Jitter | None, Field(description="Shaking.")] = None


class Sensor(Model):
    """One rig pose and all its modalities, which agree to the pixel."""

    mount: Annotated[Mount, Field(description="Where it is.")]
    camera: Annotated[Camera, Field(description="Its picture.")] = Camera()
    capture: Annotated[
        tuple[Modality, ...],
        AfterValidator(distinct),
        Field(strict=False, min_length=1, description="Which of rgb, depth, instance, semantic."),
    ]
    motion: Annotated[Motion, Field(description="How it moves.")] = Motion()
