"""The motion of a sensor: linear, along a route, after an actor, rotation and jitter."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.schema.fields import (
    ActorName,
    Degrees,
    Loose,
    Magnitude,
    Metres,
    Model,
    Turn,
    bounded,
    ordered,
)

MAX_POINTS = 1000
SHORTEST_LEG = 1e-6  # metres; shorter legs of a route are left out

Span = Annotated[tuple[Degrees, Degrees], Loose, AfterValidator(ordered)]
Sway = Annotated[Span | None, Field(description="Lowest and highest angle, degrees, added to the mount's angle.")]


class Target(Model):
    """A point of a motion. A coordinate that is absent equals that of the point before, at first the mount's."""

    x: Annotated[Metres | None, Field(description="x, metres.")] = None
    y: Annotated[Metres | None, Field(description="y, metres.")] = None
    z: Annotated[Metres | None, Field(description="z, metres.")] = None


class Linear(Model):
    """Motion at constant speed from the mount to a point, where the sensor stays."""

    to: Annotated[Target, Field(description="Point at which the motion ends, in the same frame as the mount.")]
    speed: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False, description="Speed, m/s.")]


class Route(Model):
    """Motion at constant speed along a line of points, or along the roads of the town."""

    points: Annotated[
        tuple[Target, ...] | None,
        Field(
            strict=False,
            min_length=1,
            max_length=MAX_POINTS,
            description="Points after the mount, in the same frame as the mount.",
        ),
    ] = None
    road: Annotated[
        bool,
        Field(
            description="Instead of `points`: from the mount along the lane ahead, at the mount's height; turns at "
            "junctions are drawn from the seed."
        ),
    ] = False
    speed: Annotated[
        float | None,
        Field(gt=0, le=100, allow_inf_nan=False, description="Speed, m/s. Default: the whole route during the clip."),
    ] = None
    loop: Annotated[
        bool, Field(description="Whether it returns from the last point to the mount and starts again.")
    ] = False
    heading: Annotated[
        Literal["along", "fixed"],
        Field(description="along: the mount's yaw is relative to the direction of travel; fixed: it stays."),
    ] = "along"
    radius: Annotated[
        float, bounded(0, 1000, "Radius of the arcs that replace corners, metres; less where legs are short.")
    ] = 0.0

    def waypoints(self, start: tuple[float, float, float]) -> list[tuple[float, float, float]]:
        """Return `points` with all of their coordinates, after a start; none if the route follows a road."""
        found = []
        for point in self.points or ():
            given = zip(start, (point.x, point.y, point.z), strict=True)
            x, y, z = (before if own is None else own for before, own in given)
            start = x, y, z
            found.append(start)
        return found

    @model_validator(mode="after")
    def _one_way(self) -> Route:
        if self.points is not None and self.road:
            raise PydanticCustomError("moves", "`points` are given too; keep one of the two", {"key": "road"})
        if self.points is None and not self.road:
            raise PydanticCustomError("route", "leads nowhere; add `points`, or `road: true`", {})
        if self.road and self.speed is None:
            raise PydanticCustomError("route", "a road has no end; add `speed`, m/s", {"key": "road"})
        if self.road and self.loop:
            raise PydanticCustomError("moves", "roads are not followed in a loop; remove it", {"key": "loop"})
        return self


class Follow(Model):
    """Motion after an actor, at a distance. The sensor looks at the actor, at 1 m above its origin."""

    actor: Annotated[ActorName, Field(description="The actor to follow.")]
    distance: Annotated[float, bounded(0.5, 1000, "Horizontal distance from the actor's origin, metres.")]
    height: Annotated[float, bounded(-10, 1000, "Height above the actor's origin, metres.")]
    bearing: Annotated[
        Degrees,
        Field(
            description="Where it stands, seen from the actor: degrees counter-clockwise from the actor's heading at "
            "frame 0; 180: behind, 90: to its left."
        ),
    ] = 180.0
    lag: Annotated[
        float | None,
        bounded(
            0, 5, "Time constant with which it turns with the actor, seconds. Default: it keeps frame 0's direction."
        ),
    ] = None
    collision: Annotated[
        bool, Field(description="Whether it comes nearer where a building or a wall is in between.")
    ] = True


class Rotation(Model):
    """A sinusoidal oscillation of the orientation that starts at the middle of its range."""

    yaw: Sway = None
    pitch: Sway = None
    roll: Sway = None
    period: Annotated[float, bounded(0.1, 86_400, "Period of the oscillation, seconds.")]


class Jitter(Model):
    """A random offset of the sensor, uniform between -m and m, drawn independently at every frame."""

    x: Annotated[Magnitude, Field(description="Largest offset along x, metres.")] = 0.0
    y: Annotated[Magnitude, Field(description="Largest offset along y, metres.")] = 0.0
    z: Annotated[Magnitude, Field(description="Largest offset along z, metres.")] = 0.0
    yaw: Annotated[Turn, Field(description="Largest offset of the yaw, degrees.")] = 0.0
    pitch: Annotated[Turn, Field(description="Largest offset of the pitch, degrees.")] = 0.0
    roll: Annotated[Turn, Field(description="Largest offset of the roll, degrees.")] = 0.0


class Motion(Model):
    """Motion of a sensor. At most one of linear, route and follow; rotation and jitter are added to it."""

    linear: Annotated[Linear | None, Field(description="Linear motion to a point.")] = None
    route: Annotated[Route | None, Field(description="Motion along a route.")] = None
    follow: Annotated[Follow | None, Field(description="Motion after an actor.")] = None
    rotation: Annotated[Rotation | None, Field(description="Oscillation of the orientation.")] = None
    jitter: Annotated[Jitter | None, Field(description="Random offset at every frame.")] = None

    @model_validator(mode="after")
    def _one_way(self) -> Motion:
        given = [key for key in ("linear", "route", "follow") if getattr(self, key) is not None]
        if len(given) > 1:
            text = "`{first}` is given too; keep one of the two"
            raise PydanticCustomError("moves", text, {"key": given[1], "first": given[0]})
        return self
