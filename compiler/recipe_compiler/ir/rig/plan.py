"""Plans of sensors: what every pixel sees."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.modalities import MODALITIES, Modality
from recipe_compiler.ir.plan_types import (
    MAX_ELEMENTS,
    MAX_FRAMES,
    MAX_INTERVAL,
    MAX_PIXELS_A_SIDE,
    MAX_SENSORS,
    Degrees,
    Metres,
    Name,
    Number,
    Plan,
    Pose,
    Share,
)


class CameraPlan(Plan):
    """A camera's intrinsics. `fov` is horizontal, in degrees, and a pinhole's; pixel (0, 0) is the top-left corner."""

    width: Annotated[int, Field(ge=1, le=MAX_PIXELS_A_SIDE)]
    height: Annotated[int, Field(ge=1, le=MAX_PIXELS_A_SIDE)]
    fov: Annotated[Number, Field(gt=0, lt=180)]
    near: Annotated[Number, Field(gt=0, le=100_000)] = 0.1  # metres along the optical axis
    far: Annotated[Number, Field(gt=0, le=100_000)] = 1000.0
    lens_k: Annotated[Number, Field(ge=-1, le=1)] = 0.0  # distortion, as `optics` has it
    lens_kcube: Annotated[Number, Field(ge=-1, le=1)] = 0.0

    @model_validator(mode="after")
    def _range(self) -> CameraPlan:
        if self.near >= self.far:
            raise ValueError("near must be less than far")
        return self


class BoxPlan(Plan):
    """A building or a wall, as a box that no arm enters. Its origin is the middle of its base."""

    x: Metres
    y: Metres
    z: Metres
    yaw: Degrees
    size: tuple[Metres, Metres, Metres]  # metres along its own x, y, z


class ArmPlan(Plan):
    """An arm between an actor and a sensor. `rig.arm` defines the pose at its end."""

    decay: Share  # per frame, of the actor's earlier headings: 0 turns with the actor, 1 keeps the heading of frame 0
    obstacles: Annotated[tuple[BoxPlan, ...], Field(max_length=MAX_ELEMENTS)] = ()  # what shortens it


class SensorPlan(Plan):
    """One rig pose with all its modalities: they agree to the pixel."""

    name: Name
    on: Name | None = None  # an actor; None: the world
    camera: CameraPlan
    capture: Annotated[tuple[Modality, ...], Field(max_length=len(MODALITIES))]
    poses: Annotated[
        tuple[Pose, ...], Field(max_length=MAX_FRAMES)
    ]  # one if it never moves, else one a frame; in the frame of `on`, or of `arm`
    arm: ArmPlan | None = None  # between `on` and the sensor; None: rigid
    interval: Annotated[int, Field(ge=1, le=MAX_INTERVAL)] = 1  # frames from one of its pictures to the next

    def pose(self, frame: int) -> Pose:
        """Pose at a frame, jitter included."""
        return self.poses[frame if len(self.poses) > 1 else 0]

    def frames(self, total: int) -> range:
        """Return the numbers of the frames that it takes, of a clip of so many: 0, `interval`, 2 * `interval` ..."""
        return range(0, total, self.interval)

    def check_takes(self, frame: int, total: int) -> None:
        """Check that it takes a frame of a clip of so many; InputError otherwise."""
        taken = self.frames(total)
        if frame not in taken:
            some = ", ".join(map(str, taken[:3]))
            raise InputError(
                f"the sensor {self.name} takes no picture at frame {frame}",
                help=f"it takes the frames {some} and so on" if len(taken) > 3 else f"it takes {some} only",
                code=Code.OUT_OF_RANGE,
            )

    @model_serializer(mode="wrap")
    def _without_absent_parts(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        """Omit optional parts that are absent, so that they do not change the digest of a plan without them."""
        whole: dict[str, object] = handler(self)
        if self.arm is None:
            whole.pop("arm", None)
        if self.interval == 1:
            whole.pop("interval", None)
        return whole


class RigPlan(Plan):
    """What every pixel hits."""

    version: Literal[1] = 1
    sensors: Annotated[tuple[SensorPlan, ...], Field(max_length=MAX_SENSORS)]

    @cached_property
    def digest(self) -> str:
        """Identity of the rig."""
        return digest("plan/rig/1", self.document())
