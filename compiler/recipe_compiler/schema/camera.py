"""The sensors of a recipe: mount and camera; `motion` has their motion."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir import optics
from recipe_compiler.ir.modalities import MODALITIES, Modality
from recipe_compiler.schema.fields import (
    ActorName,
    Degrees,
    Metres,
    Model,
    bounded,
    distinct,
)
from recipe_compiler.schema.motion import SHORTEST_LEG, Motion
from recipe_compiler.schema.tick import MAX_TICK

Attachment = Literal["rigid", "spring_arm", "spring_arm_ghost"]


class Mount(Model):
    """The pose of a sensor: x forward, y left, z up, in metres; angles in degrees."""

    on: Annotated[
        ActorName | None,
        Field(description="Actor that the sensor is mounted on; the pose is in its frame. Default: the world frame."),
    ] = None
    attachment: Annotated[
        Attachment,
        Field(
            description="Attachment to `on`. rigid: it leans and turns with the actor; spring_arm: on an arm that "
            "stays level and turns smoothly, shortened at buildings; spring_arm_ghost: the same arm, never shortened."
        ),
    ] = "rigid"
    x: Annotated[Metres, Field(description="Position along x, metres.")] = 0.0
    y: Annotated[Metres, Field(description="Position along y, metres.")] = 0.0
    z: Annotated[Metres, Field(description="Height, metres.")] = 0.0
    yaw: Annotated[Degrees, Field(description="Degrees counter-clockwise seen from above; 0 looks along +x.")] = 0.0
    pitch: Annotated[Degrees, Field(description="Degrees; positive looks down.")] = 0.0
    roll: Annotated[Degrees, Field(description="Degrees; positive tilts to the right.")] = 0.0

    @model_validator(mode="after")
    def _arm_has_two_ends(self) -> Mount:
        if self.attachment == "rigid":
            return self
        if self.on is None:
            text = "{arm} needs an actor at its other end; add `on`, the actor's name"
        elif not (self.x or self.y):
            text = "{arm} has no length; give the sensor's place behind the actor, such as x: -6"
        else:
            return self
        raise PydanticCustomError("arm", text, {"key": "attachment", "arm": self.attachment})


class Camera(Model):
    """A camera and its response to light. Parameters that CARLA's RGB camera has too have CARLA's names."""

    width: Annotated[int, Field(ge=16, le=4096, description="Width, pixels (CARLA: image_size_x).")] = 800
    height: Annotated[int, Field(ge=16, le=4096, description="Height, pixels (CARLA: image_size_y).")] = 600
    fov: Annotated[float, bounded(1, 170, "Horizontal field of view, degrees.")] = 90.0
    near: Annotated[float, bounded(0.01, 10, "Distance of the near plane, metres.")] = 0.1
    far: Annotated[float, bounded(20, 10_000, "Distance of the far plane, metres.")] = 1000.0
    lens_k: Annotated[
        float, bounded(-1, 1, "Radial distortion, quadratic coefficient (CARLA: lens_k): > 0 barrel, < 0 pincushion.")
    ] = 0.0
    lens_kcube: Annotated[float, bounded(-1, 1, "Radial distortion, cubic coefficient (CARLA: lens_kcube).")] = 0.0
    exposure_mode: Annotated[
        Literal["auto", "manual"],
        Field(description="auto: from sun, weather and lamps; manual: from shutter_speed, iso and fstop."),
    ] = "auto"
    exposure_compensation: Annotated[float, bounded(-15, 15, "Exposure compensation, stops (EV).")] = 0.0
    shutter_speed: Annotated[float, bounded(1, 10_000, "Reciprocal of the exposure time, 1/s; 200 means 1/200 s.")] = (
        200.0
    )
    iso: Annotated[float, bounded(25, 102_400, "Sensitivity, ISO; noise is proportional to its square root.")] = 100.0
    fstop: Annotated[float, bounded(0.7, 32, "Aperture, f-number; used with manual exposure.")] = 1.4
    gamma: Annotated[float, bounded(0.5, 5, "Gamma; 2.2 is sRGB, higher values are brighter.")] = 2.2
    temp: Annotated[
        float, bounded(1500, 15_000, "White balance: colour temperature of the light that appears white, kelvins.")
    ] = 6500.0
    tint: Annotated[float, bounded(-1, 1, "White balance: tint from -1 (green) to 1 (magenta).")] = 0.0
    noise: Annotated[
        float, bounded(0, 10, "Strength of sensor noise; 0: none, 1: typical of a good surveillance camera.")
    ] = 1.0
    vignette_intensity: Annotated[float, bounded(0, 1, "Darkening towards the corners (vignetting); 0: none.")] = 0.4
    lens_circle_multiplier: Annotated[
        float, bounded(0, 10, "Darkness of the lens rim; 0: none (CARLA: lens_circle_multiplier).")
    ] = 0.0
    lens_circle_falloff: Annotated[
        float, bounded(0, 10, "Falloff of the lens rim; higher values confine it to the corners.")
    ] = 5.0
    chromatic_aberration_intensity: Annotated[
        float, bounded(0, 10, "Distance between red and blue at the corners, percent.")
    ] = 0.0
    chromatic_aberration_offset: Annotated[
        float, bounded(0, 0.99, "Radius at which chromatic aberration starts, as a fraction of the half diagonal.")
    ] = 0.0
    bloom_intensity: Annotated[float, bounded(0, 5, "Strength of the glow around bright areas; 0: none.")] = 0.0
    motion_blur_intensity: Annotated[
        float, bounded(0, 10, "Blur length as a multiple of the motion during the exposure; 0: none, 1: realistic.")
    ] = 0.0
    motion_blur_max_distortion: Annotated[float, bounded(0, 1, "Longest blur, as a fraction of the image width.")] = (
        0.35
    )
    sensor: Annotated[
        Literal["bayer"] | None,
        Field(
            description="bayer: each pixel of the sensor measures one colour, with noise, and demosaicking estimates "
            "the others. Default: each pixel measures all three."
        ),
    ] = None
    antialias: Annotated[
        bool, Field(description="Whether edges in RGB pictures are antialiased. Labels never are.")
    ] = True
    supersample: Annotated[
        int, Field(ge=1, le=4, description="RGB samples per pixel along each axis; 2 means 4 samples per pixel.")
    ] = 1
    enable_postprocess_effects: Annotated[
        bool,
        Field(
            description="false disables noise, vignette, lens rim, chromatic aberration, bloom, motion blur and the "
            "sensor's mosaic."
        ),
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


class Sensor(Model):
    """A camera at a pose. All of its modalities agree to the pixel."""

    mount: Annotated[Mount, Field(description="Pose of the sensor, and the actor that it is mounted on.")]
    camera: Annotated[Camera, Field(description="Intrinsics and response of the camera.")] = Camera()
    capture: Annotated[
        tuple[Modality, ...],
        AfterValidator(distinct),
        Field(strict=False, min_length=1, description=f"Modalities to record, a list of {', '.join(MODALITIES)}."),
    ]
    motion: Annotated[Motion, Field(description="Motion relative to the mount. Default: none.")] = Motion()
    tick: Annotated[
        float,
        bounded(
            0,
            MAX_TICK,
            "Seconds from one picture to the next, a multiple of the frame interval (CARLA: sensor_tick). "
            "0: every frame.",
        ),
    ] = 0.0

    @property
    def carrier(self) -> str | None:
        """The actor on which its pose depends; None if it is static or moves in the world frame."""
        return self.mount.on if self.motion.follow is None else self.motion.follow.actor

    def _stays(self) -> bool:
        start, route = (self.mount.x, self.mount.y, self.mount.z), self.motion.route
        if route is None or route.road:
            return False
        spans = ([end - begin for begin, end in zip(start, point, strict=True)] for point in route.waypoints(start))
        return all(math.sqrt(sum(span * span for span in each)) <= SHORTEST_LEG for each in spans)

    @model_validator(mode="after")
    def _one_frame_of_reference(self) -> Sensor:
        mount, key = self.mount, "mount"
        if self.motion.follow is not None and (mount.on is not None or mount.x or mount.y or mount.z):
            text = "`motion.follow` decides the position; keep angles only, or none: `mount: {}`"
        elif self.motion.route is not None and self.motion.route.road and mount.on is not None:
            text = "`motion.route` follows a road of the town; remove `on`"
        elif self._stays():
            text, key = "`route` never leaves the mount; add a point that differs from it", "motion"
        else:
            return self
        raise PydanticCustomError("frame", text, {"key": key})
