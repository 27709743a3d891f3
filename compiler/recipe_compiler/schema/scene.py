"""The scene of a recipe: clock, town, actors, traffic, assets and props."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir.plurals import form
from recipe_compiler.ir.semantic_tags import PropLabel
from recipe_compiler.schema.fields import (
    BLUEPRINT,
    MAX_FRAMES,
    NAME_LENGTH,
    PARKED_LIMIT,
    TRAFFIC_LIMIT,
    Colour,
    Degrees,
    Glob,
    Metres,
    Model,
    Name,
    Percent,
    Seed,
    Weight,
    bounded,
)


class Clock(Model):
    """The frame rate, the length of a clip and the physics rate."""

    fps: Annotated[int, Field(ge=1, le=1000, description="Frames per second; must divide `physics`.")]
    frames: Annotated[int, Field(ge=1, le=MAX_FRAMES, description="Number of frames per clip.")]
    physics: Annotated[int, Field(ge=60, le=1000, description="Physics steps per second.")] = 240
    warmup: Annotated[
        float | None,
        bounded(
            0,
            600,
            "Seconds simulated before frame 0; absent: 10 with moving traffic, else 0. "
            "An actor with a `start` stays there until frame 0.",
        ),
    ] = None

    @model_validator(mode="after")
    def _fps_divides(self) -> Clock:
        if self.physics % self.fps:
            below = [n for n in range(1, self.fps) if self.physics % n == 0][-1]
            above = [n for n in range(self.fps, self.physics + 1) if self.physics % n == 0][:1]
            near = " or ".join(map(str, [below, *above]))
            raise PydanticCustomError(
                "fps",
                "{fps} does not divide the physics rate {physics}; write {near}, the nearest that {do}",
                {
                    "key": "fps",
                    "fps": self.fps,
                    "physics": self.physics,
                    "near": near,
                    "do": form(1 + len(above), "does", "do"),
                },
            )
        return self


class Town(Model):
    """A town: its name, its seed, and the parameters of that town."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[
        str,
        Field(
            max_length=NAME_LENGTH,
            description="Name of the town. `town: downtown` is short for `town: {name: downtown}`.",
        ),
    ]
    seed: Annotated[Seed, Field(description="Seed of the town's layout, independent of the recipe's seed.")] = 0


class GroundPoint(Model):
    """A point on the ground, in the world frame."""

    x: Annotated[Metres, Field(description="x in the world frame (east), metres.")]
    y: Annotated[Metres, Field(description="y in the world frame (north), metres.")]


class Start(GroundPoint):
    """The start of an actor, on the ground."""

    yaw: Annotated[
        Degrees | None,
        Field(description="Heading, degrees counter-clockwise from +x. Default: towards the first waypoint."),
    ] = None


class Driver(Model):
    """How a vehicle is driven. Names and signs are those of CARLA's Traffic Manager, except `headway`."""

    percentage_speed_difference: Annotated[
        float | None,
        bounded(-100, 90, "Percentage by which the desired speed is below the speed limit; negative: above it."),
    ] = None
    distance_to_leading_vehicle: Annotated[
        float | None, bounded(0.5, 100, "Metres to the vehicle ahead at standstill.")
    ] = None
    headway: Annotated[float | None, bounded(0.3, 10, "Seconds to the vehicle ahead in motion.")] = None
    ignore_lights_percentage: Annotated[
        Percent | None, Field(description="Probability of ignoring traffic lights. Default: that of the traffic, or 0.")
    ] = None
    ignore_signs_percentage: Annotated[Percent, Field(description="Probability of ignoring stop and yield signs.")] = (
        0.0
    )
    ignore_vehicles_percentage: Annotated[Percent, Field(description="Probability of ignoring other vehicles.")] = 0.0
    ignore_walkers_percentage: Annotated[Percent, Field(description="Probability of ignoring pedestrians.")] = 0.0
    keep_right_rule_percentage: Annotated[
        Percent, Field(description="Probability of returning to the right lane when it is free.")
    ] = 0.0
    auto_lane_change: Annotated[bool, Field(description="Whether it changes lanes.")] = True


class Actor(Model):
    """A pedestrian or a vehicle."""

    blueprint: Annotated[
        str,
        StringConstraints(pattern=BLUEPRINT, max_length=NAME_LENGTH),
        Field(description="Blueprint id, or a glob pattern such as `walker.pedestrian.*` to draw from."),
    ]
    speed: Annotated[float | None, bounded(0, 60, "Speed, m/s; 0: stationary. Default: the blueprint's speed.")] = None
    start: Annotated[Start | None, Field(description="Start position. Default: a random spawn point of the town.")] = (
        None
    )
    goal: Annotated[
        GroundPoint | None, Field(description="Goal, reached by the shortest way. Default: a random route of the town.")
    ] = None
    route: Annotated[
        tuple[GroundPoint, ...] | None,
        Field(
            strict=False,
            min_length=1,
            max_length=1000,
            description="List of waypoints after the start, instead of `goal`.",
        ),
    ] = None
    look: Annotated[
        dict[str, Colour], Field(description='Colours by slot, such as `{shirt: "#aa0000"}`. Default: random colours.')
    ] = {}
    pose: Annotated[
        Literal["talk", "telephone", "sit"] | None,
        Field(
            description="What a pedestrian does. talk: stands, with a gesture; telephone: holds a telephone to the "
            "ear; sit: sits at the start, on a seat 0.45 m high. Default: as the blueprint."
        ),
    ] = None
    driver: Annotated[Driver | None, Field(description="How a vehicle is driven.")] = None

    @model_validator(mode="after")
    def _pose_of_a_pedestrian(self) -> Actor:
        if self.pose is not None and not self.blueprint.startswith("walker."):
            raise PydanticCustomError("pose", "only pedestrians have a pose; remove the key", {"key": "pose"})
        if self.pose in ("sit", "talk") and (self.goal or self.route or self.speed):
            text = f"a person whose pose is `{self.pose}` stays at the start; remove `goal`, `route` and `speed`"
            raise PydanticCustomError("pose", text, {"key": "pose"})
        return self

    @model_validator(mode="after")
    def _one_way(self) -> Actor:
        if self.goal and self.route:
            raise PydanticCustomError(
                "way", "`goal` is given too; keep one of the two, and end a route at the goal", {"key": "route"}
            )
        return self

    @model_validator(mode="after")
    def _one_speed(self) -> Actor:
        driver = self.driver
        if self.speed is not None and driver is not None and driver.percentage_speed_difference is not None:
            raise PydanticCustomError(
                "speed", "`driver.percentage_speed_difference` is given too; keep one of the two", {"key": "speed"}
            )
        return self


class Density(Model):
    """Traffic by the length of the town's streets, instead of by number."""

    vehicles: Annotated[float, bounded(0, 100, "Vehicles for each kilometre of lane.")] = 0.0
    pedestrians: Annotated[float, bounded(0, 1000, "Pedestrians for each kilometre of sidewalk.")] = 0.0


class Traffic(Model):
    """Randomly chosen actors, named traffic.vehicle.0, traffic.pedestrian.0, traffic.parked.0 and so on."""

    vehicles: Annotated[int, Field(ge=0, le=TRAFFIC_LIMIT, description="Number of moving vehicles.")] = 0
    pedestrians: Annotated[int, Field(ge=0, le=TRAFFIC_LIMIT, description="Number of walking pedestrians.")] = 0
    parked: Annotated[int, Field(ge=0, le=PARKED_LIMIT, description="Number of parked cars.")] = 0
    density: Annotated[
        Density | None, Field(description="Numbers by length, instead of `vehicles` and `pedestrians`.")
    ] = None
    mix: Annotated[
        dict[Glob, Weight],
        Field(
            max_length=32,
            description="Share of each blueprint or glob among vehicles or pedestrians, as weights: "
            "`{vehicle.sedan.*: 6, vehicle.bus.*: 1}`; absent: each blueprint as often.",
        ),
    ] = {}
    near: Annotated[Name | None, Field(description="A sensor: traffic is placed where it is likely to see it.")] = None
    seed: Annotated[Seed | None, Field(description="Seeds the traffic alone; absent: the seed of the recipe.")] = None
    ignore_lights_percentage: Annotated[
        Percent, Field(description="Percentage of the traffic that ignores traffic lights.")
    ] = 0.0
    driver: Annotated[
        Driver | None,
        Field(description="How all vehicles of the traffic are driven. Default: speeds and headways are drawn."),
    ] = None

    @model_validator(mode="after")
    def _one_number(self) -> Traffic:
        if self.density is not None:
            for key in ("vehicles", "pedestrians"):
                if getattr(self, key) and getattr(self.density, key):
                    raise PydanticCustomError(
                        "density", "`density.{key}` is given too; keep one of the two", {"key": key}
                    )
        return self


class Asset(Model):
    """A file of the recipe: a mesh or an image."""

    mesh: Annotated[
        str | None, Field(max_length=200, description="A .glb, .gltf, .obj or .stl file below this file's folder.")
    ] = None
    image: Annotated[str | None, Field(max_length=200, description="A .png file below this file's folder.")] = None
    sha256: Annotated[
        str | None,
        StringConstraints(pattern=r"^[0-9a-f]{64}$"),
        Field(description="SHA-256 of the file; another content is an error. The lockfile pins it too."),
    ] = None
    up: Annotated[
        Literal["y", "z"] | None,
        Field(description="Axis of an OBJ or STL mesh that points up. Default: y for OBJ, z for STL."),
    ] = None

    @model_validator(mode="after")
    def _one(self) -> Asset:
        if (self.mesh is None) == (self.image is None):
            raise PydanticCustomError("asset", "an asset is either a `mesh` or an `image`; give one of them", {})
        if self.up is not None and (self.mesh is None or not self.mesh.lower().endswith((".obj", ".stl"))):
            raise PydanticCustomError("asset", "goes with OBJ and STL meshes only; remove it", {"key": "up"})
        return self


class Blueprint(Model):
    """A type of actor of the recipe, whose body comes from a file."""

    mesh: Annotated[
        str,
        Field(
            max_length=200,
            description="A .glb or .gltf file below this file's folder: a person with a skin on Mixamo's skeleton, or "
            "a vehicle whose wheels are nodes of their own.",
        ),
    ]
    sha256: Annotated[
        str | None,
        StringConstraints(pattern=r"^[0-9a-f]{64}$"),
        Field(description="SHA-256 of the file; another content is an error. The lockfile pins it too."),
    ] = None
    scale: Annotated[
        float, Field(ge=1e-4, le=1e4, allow_inf_nan=False, description="Length of one unit of the file, metres.")
    ] = 1.0
    speed: Annotated[float | None, bounded(0, 60, "Speed of its actors, m/s. Default: that of its family.")] = None


class Standing(GroundPoint):
    """The pose of a prop."""

    z: Annotated[
        Metres | None,
        Field(description="Height of the origin (of a board: its lower edge), metres. Default: on the ground."),
    ] = None
    yaw: Annotated[
        Degrees, Field(description="Degrees counter-clockwise from +x; the direction that a board faces.")
    ] = 0.0
    pitch: Annotated[Degrees, Field(description="Degrees; positive tilts the front down.")] = 0.0
    roll: Annotated[Degrees, Field(description="Degrees; positive tilts to the right.")] = 0.0


class Board(Model):
    """The size of a board."""

    width: Annotated[float, bounded(0.01, 100, "Width, metres.")]
    height: Annotated[float, bounded(0.01, 100, "Height, metres.")]


class Prop(Model):
    """A static object: a mesh of `assets`, or a flat board."""

    asset: Annotated[Name | None, Field(description="Name of a mesh in `assets`.")] = None
    size: Annotated[Board | None, Field(description="Size of a flat board, instead of `asset`.")] = None
    image: Annotated[
        Name | None, Field(description="Name of an image in `assets`: texture of the board's front, or of the mesh.")
    ] = None
    at: Annotated[Standing, Field(description="Pose of the prop.")]
    scale: Annotated[
        float, Field(ge=1e-4, le=1e4, allow_inf_nan=False, description="Length of one unit of the mesh's file, metres.")
    ] = 1.0
    tag: Annotated[PropLabel, Field(description="Semantic tag of the prop, by CARLA's name.")] = "Static"
    look: Annotated[
        dict[str, Colour], Field(description="Colours by slot: `face` and `back` of a board, the materials of a mesh.")
    ] = {}

    @model_validator(mode="after")
    def _one(self) -> Prop:
        if (self.asset is None) == (self.size is None):
            raise PydanticCustomError(
                "prop", "a prop has either an `asset`, a mesh, or a `size`, a board's; give one of them", {}
            )
        return self
