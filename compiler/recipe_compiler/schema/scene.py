"""The scene of a recipe: clock, town, actors, traffic, assets and props."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir.semantic_tags import PropLabel
from recipe_compiler.schema.fields import (
    BLUEPRINT,
    MAX_FRAMES,
    NAME_LENGTH,
    PARKED_LIMIT,
    TRAFFIC_LIMIT,
    Colour,
    Degrees,
    Metres,
    Model,
    Name,
    Seed,
    bounded,
)


class Clock(Model):
    """When frames are taken."""

    fps: Annotated[int, Field(ge=1, le=1000, description="Frames a second; must divide `physics`.")]
    frames: Annotated[int, Field(ge=1, le=MAX_FRAMES, description="Frames in a clip.")]
    physics: Annotated[int, Field(ge=60, le=1000, description="Physics steps a second.")] = 240

    @model_validator(mode="after")
    def _fps_divides(self) -> Clock:
        if self.physics % self.fps:
            below = [n for n in range(1, self.fps) if self.physics % n == 0][-1]
            above = [n for n in range(self.fps, self.physics + 1) if self.physics % n == 0][:1]
            near = " or ".join(map(str, [below, *above]))
            raise PydanticCustomError(
                "fps",
                "{fps} does not divide the physics rate {physics}; write {near}, the nearest that do",
                {"key": "fps", "fps": self.fps, "physics": self.physics, "near": near},
            )
        return self


class Town(Model):
    """The town: its name, its seed and its own parameters."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[
        str, Field(max_length=NAME_LENGTH, description="One of the towns; `town: downtown` is short for it.")
    ]
    seed: Annotated[Seed, Field(description="Which of the towns of that name; the recipe's own seed has no say.")] = 0


class GroundPoint(Model):
    """A point on the ground plan."""

    x: Annotated[Metres, Field(description="Metres.")]
    y: Annotated[Metres, Field(description="Metres.")]


class Start(GroundPoint):
    """Where an actor starts; its height is the ground's."""

    yaw: Annotated[
        Degrees | None, Field(description="Degrees counter-clockwise from +x; absent: towards the way it goes.")
    ] = None


class Actor(Model):
    """A pedestrian or a vehicle."""

    blueprint: Annotated[
        str,
        StringConstraints(pattern=BLUEPRINT, max_length=NAME_LENGTH),
        Field(description="An id of the library or a glob such as `walker.pedestrian.*`, chosen by seed and name."),
    ]
    speed: Annotated[float | None, bounded(0, 60, "m/s; absent: the blueprint's own; 0: it stands.")] = None
    start: Annotated[Start | None, Field(description="Absent: a spawn point of the town, by seed and name.")] = None
    goal: Annotated[GroundPoint | None, Field(description="It goes there straight; absent: a route of the town.")] = (
        None
    )
    route: Annotated[
        tuple[GroundPoint, ...] | None,
        Field(strict=False, min_length=1, max_length=1000, description="Waypoints after the start, instead of `goal`."),
    ] = None
    look: Annotated[
        dict[str, Colour], Field(description='Colours by slot: `{shirt: "#aa0000"}`; absent: by seed and name.')
    ] = {}

    @model_validator(mode="after")
    def _one_way(self) -> Actor:
        if self.goal and self.route:
            raise PydanticCustomError(
                "way", "`goal` is given too; keep one of the two, and end a route at the goal", {"key": "route"}
            )
        return self


class Traffic(Model):
    """Seeded others, named traffic.vehicle.0, traffic.parked.0 and so on."""

    vehicles: Annotated[int, Field(ge=0, le=TRAFFIC_LIMIT, description="How many vehicles drive about.")] = 0
    pedestrians: Annotated[int, Field(ge=0, le=TRAFFIC_LIMIT, description="How many pedestrians walk about.")] = 0
    parked: Annotated[int, Field(ge=0, le=PARKED_LIMIT, description="How many cars stand at the kerbs.")] = 0


class Asset(Model):
    """A file that the recipe brings: a mesh or an image."""

    mesh: Annotated[
        str | None, Field(max_length=200, description="A .glb, .gltf, .obj or .stl file below this one's folder.")
    ] = None
    image: Annotated[str | None, Field(max_length=200, description="A .png file below this one's folder.")] = None
    sha256: Annotated[
        str | None,
        StringConstraints(pattern=r"^[0-9a-f]{64}$"),
        Field(description="The file's digest, so that no other file can stand in; the lockfile has it anyway."),
    ] = None
    up: Annotated[
        Literal["y", "z"] | None,
        Field(description="Which axis of an OBJ or STL mesh points up; absent: y for OBJ, z for STL. glTF's is y."),
    ] = None

    @model_validator(mode="after")
    def _one(self) -> Asset:
        if (self.mesh is None) == (self.image is None):
            raise PydanticCustomError("asset", "an asset is either a `mesh` or an `image`; give one of them", {})
        if self.up is not None and (self.mesh is None or not self.mesh.lower().endswith((".obj", ".stl"))):
            raise PydanticCustomError("asset", "goes with OBJ and STL meshes only; remove it", {"key": "up"})
        return self


class Standing(GroundPoint):
    """Where a prop stands."""

    z: Annotated[
        Metres | None, Field(description="Height of its origin (a board's: its lower edge); absent: on the ground.")
    ] = None
    yaw: Annotated[Degrees, Field(description="Degrees, counter-clockwise; a board faces that way.")] = 0.0
    pitch: Annotated[Degrees, Field(description="Degrees, down.")] = 0.0
    roll: Annotated[Degrees, Field(description="Degrees, to the right.")] = 0.0


class Board(Model):
    """A board's size."""

    width: Annotated[float, bounded(0.01, 100, "Metres.")]
    height: Annotated[float, bounded(0.01, 100, "Metres.")]


class Prop(Model):
    """A body that stands still: a mesh of the assets, or a flat board."""

    asset: Annotated[Name | None, Field(description="A mesh of `assets`.")] = None
    size: Annotated[Board | None, Field(description="Of a flat board, instead of `asset`.")] = None
    image: Annotated[
        Name | None, Field(description="An image of `assets`: on the board's front, or in place of the mesh's own.")
    ] = None
    at: Annotated[Standing, Field(description="Where it stands.")]
    scale: Annotated[
        float, Field(ge=1e-4, le=1e4, allow_inf_nan=False, description="Metres of one unit of the mesh's file.")
    ] = 1.0
    tag: Annotated[PropLabel, Field(description="What it is to the semantic camera; CARLA's names.")] = "Static"
    look: Annotated[
        dict[str, Colour], Field(description="Colours by slot; a board has `face` and `back`, a mesh its materials.")
    ] = {}

    @model_validator(mode="after")
    def _one(self) -> Prop:
        if (self.asset is None) == (self.size is None):
            raise PydanticCustomError(
                "prop", "a prop has either an `asset`, a mesh, or a `size`, a board's; give one of them", {}
            )
        return self
