"""Plans: the complete input of the runtime.

A `ScenarioPlan` is three plans, each with a digest of its own. `ScenePlan` decides where every body is at every
frame, `RigPlan` what every pixel hits, `AppearancePlan` what colour it has. Everything in them is
resolved: no preset, no glob, no draw. They are immutable, contain integers and fixed decimals only, and are plain JSON.

Frames of reference: right-handed, z up, metres, seconds; yaw counter-clockwise; vehicles and sensors x forward,
y left, z up (REP-103). Plans are documents, so angles are in degrees here; rotations apply roll, then pitch, then
yaw about fixed axes (R = Rz(yaw) Ry(pitch) Rx(roll)); positive pitch looks down, as REP-103 has it.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from functools import cached_property
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    RootModel,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from recipe_compiler.ir import modalities
from recipe_compiler.ir.about import About
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.patches import Patches
from recipe_compiler.ir.patches import PatchPlan as PatchPlan
from recipe_compiler.ir.plan_types import (
    MAX_ACTORS,
    MAX_BODIES,
    MAX_DESCRIPTION,
    MAX_ELEMENTS,
    MAX_FRAMES,
    MAX_POINTS,
    MAX_PROPS,
    MAX_SENSORS,
    MAX_SLOTS,
    MAX_VARIANT_NAME,
    MAX_VARIANTS,
    Colour,
    Degrees,
    Metres,
    Name,
    Number,
    Shape,
    Share,
    Slot,
    Slots,
    Tag,
    Ten,
)
from recipe_compiler.ir.plan_types import ActorMesh as ActorMesh
from recipe_compiler.ir.plan_types import FilePlan as FilePlan
from recipe_compiler.ir.plan_types import Plan as Plan
from recipe_compiler.ir.plan_types import Point as Point
from recipe_compiler.ir.plan_types import Pose as Pose
from recipe_compiler.ir.rig.plan import ArmPlan as ArmPlan
from recipe_compiler.ir.rig.plan import CameraPlan as CameraPlan
from recipe_compiler.ir.rig.plan import RigPlan as RigPlan
from recipe_compiler.ir.rig.plan import SensorPlan as SensorPlan
from recipe_compiler.ir.semantic_tags import Category
from recipe_compiler.ir.weather import Weather as Weather


class Clock(Plan):
    """When frames are taken: frame k is k / fps seconds after frame 0, which the warm-up precedes."""

    fps: Annotated[int, Field(ge=1, le=1000)]
    frames: Annotated[int, Field(ge=1, le=MAX_FRAMES)]
    physics: Annotated[int, Field(ge=1, le=1000)]  # steps a second
    warmup: Annotated[Number, Field(ge=0, le=600)] = 0.0  # seconds simulated before frame 0

    @model_validator(mode="after")
    def _whole_steps(self) -> Clock:
        if self.physics % self.fps:
            raise ValueError(f"{self.physics} steps a second are not a multiple of {self.fps} fps")
        return self

    @property
    def warmup_steps(self) -> int:
        """Physics steps before frame 0."""
        return int(self.warmup * self.physics + 0.5)

    @property
    def steps_per_frame(self) -> int:
        """Physics steps between two frames."""
        return self.physics // self.fps


class Element(Plan):
    """One element of the town: a road, a building, a lamp. `shape` has the parameters of its mesh."""

    name: Name
    kind: Name
    pose: Pose
    size: tuple[Metres, Metres, Metres]  # metres along its own x, y, z
    shape: Shape = Field(default_factory=dict)


class TownPlan(Plan):
    """A town's layout. Meshes and collision shapes follow from it alone."""

    name: Name
    elements: Annotated[tuple[Element, ...], Field(max_length=MAX_ELEMENTS)]

    @cached_property
    def digest(self) -> str:
        """Identity of the layout."""
        return digest("plan/town/1", self.document())


class Pause(Plan):
    """A pause of some seconds at a waypoint of a pedestrian's route."""

    waypoint: Annotated[int, Field(ge=0, lt=MAX_POINTS)]  # index into the route
    seconds: Annotated[Number, Field(ge=0, le=3600)]


class DriverPlan(Plan):
    """How a vehicle is driven, where it differs from what all vehicles of its kind have in common."""

    limit_factor: Annotated[Number, Field(gt=0, le=10)] = 1.0  # desired speed relative to the speed limit
    headway: Annotated[Number, Field(gt=0, le=60)] | None = None  # desired time gap, seconds; None: that of its kind
    gap: Annotated[Number, Field(gt=0, le=1000)] | None = None  # metres kept at standstill; None: those of its kind
    obeys_signs: bool = True
    sees_vehicles: bool = True
    sees_walkers: bool = True
    keeps_right: bool = False
    changes_lanes: bool = True


class ActorPlan(Plan):
    """One moving body: its blueprint, start pose and route."""

    name: Name
    blueprint: Name  # an id of the library, such as walker.pedestrian.0003
    category: Category
    tag: Tag
    instance: Annotated[int, Field(ge=1, le=999)]  # unique within the tag, the same in every variant
    shape: Shape  # parameters of its mesh and joints
    start: Pose
    route: Annotated[
        tuple[Point, ...], Field(max_length=MAX_POINTS)
    ]  # after the start, the goal last; empty: it does not move
    speed: Annotated[Number, Field(ge=0, le=1000)]  # m/s; a vehicle's where no speed limit is lower
    held: bool = False  # waits at its start until frame 0, and then moves at its speed
    obeys: bool = True  # traffic lights
    entry: Pose | None = None  # a vehicle that reaches its goal leaves, and enters again here when there is room
    pauses: Annotated[tuple[Pause, ...], Field(max_length=MAX_POINTS)] = ()  # in order of their waypoints
    companion: Name | None = None  # the pedestrian that it accompanies; its route is then not used
    driver: DriverPlan | None = None
    mesh: ActorMesh | None = None

    @model_serializer(mode="wrap")
    def _without_absent_parts(self, own: SerializerFunctionWrapHandler) -> dict[str, object]:
        document: dict[str, object] = own(self)
        for name in ("driver", "mesh"):
            if getattr(self, name) is None:
                document.pop(name, None)
        return document


class PropPlan(Plan):
    """A static body: a mesh from a file, or a flat board whose front is its +x side."""

    name: Name
    mesh: FilePlan | None  # None: a board
    up: Literal["y", "z"] = "z"  # the file's axis that points up; y: its z is our x
    scale: Annotated[Number, Field(gt=0, le=100_000)] = 1.0  # metres of one unit of the file
    pose: Pose
    tag: Tag
    low: tuple[Metres, Metres, Metres]  # its box in its own frame, in metres; what collides
    high: tuple[Metres, Metres, Metres]

    @model_validator(mode="after")
    def _size(self) -> PropPlan:
        if self.mesh is None and any(a >= b for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError("a board without a size")
        return self


class ScenePlan(Plan):
    """Where every body is at every frame."""

    version: Literal[1] = 1
    clock: Clock
    town: TownPlan
    actors: Annotated[tuple[ActorPlan, ...], Field(max_length=MAX_ACTORS)]
    props: Annotated[tuple[PropPlan, ...], Field(max_length=MAX_PROPS)] = ()

    @cached_property
    def digest(self) -> str:
        """Identity of the scene; independent of the weather. An absent optional part does not change it."""
        own = self.model_dump(mode="json", exclude={"town"} if self.props else {"town", "props"})
        return digest("plan/scene/1", {**own, "town": self.town.digest})

    def first(self, frames: int) -> ScenePlan:
        """The same scene, `frames` (at least 1) long or as long as it is, whichever is less.

        A simulation does not depend on its length, so the Trace of this scene is a prefix of that of the full scene.
        """
        if frames >= self.clock.frames:
            return self
        clock = self.clock.model_copy(update={"frames": frames})
        return ScenePlan(clock=clock, town=self.town, actors=self.actors, props=self.props)


class Sun(Plan):
    """The position of the sun. `azimuth` counter-clockwise from world +x, `altitude` above the horizon, in degrees."""

    azimuth: Degrees
    altitude: Annotated[Number, Field(ge=-90, le=90)]


class CameraResponse(Plan):
    """How a sensor turns light into 8-bit sRGB. Names are CARLA's where it has one."""

    exposure_mode: Literal["auto", "manual"] = "auto"
    exposure_compensation: Annotated[Number, Field(ge=-15, le=15)] = 0.0  # stops
    shutter_speed: Annotated[Number, Field(ge=1, le=10_000)] = 200.0  # 1 / seconds
    iso: Annotated[Number, Field(ge=25, le=102_400)] = 100.0
    fstop: Annotated[Number, Field(ge=0.7, le=32)] = 1.4
    gamma: Annotated[Number, Field(ge=0.5, le=5)] = 2.2
    temp: Annotated[Number, Field(ge=1500, le=15_000)] = 6500.0  # kelvin
    tint: Annotated[Number, Field(ge=-1, le=1)] = 0.0
    noise: Ten = 1.0  # read and shot noise, 0 off, 1 a good street camera at ISO 100
    vignette_intensity: Share = 0.4
    lens_circle_multiplier: Ten = 0.0
    lens_circle_falloff: Ten = 5.0
    chromatic_aberration_intensity: Ten = 0.0
    chromatic_aberration_offset: Annotated[Number, Field(ge=0, le=0.99)] = 0.0
    bloom_intensity: Annotated[Number, Field(ge=0, le=5)] = 0.0
    motion_blur_intensity: Ten = 0.0
    motion_blur_max_distortion: Share = 0.35  # of the picture's width
    sensor: Literal["bayer"] | None = None  # None: every pixel measures all three colours
    antialias: bool = True
    supersample: Annotated[int, Field(ge=1, le=4)] = 1  # samples along a pixel's side

    @model_serializer(mode="wrap")
    def _without_absent_sensor(self, own: SerializerFunctionWrapHandler) -> dict[str, object]:
        document: dict[str, object] = own(self)
        if self.sensor is None:
            document.pop("sensor", None)
        return document


class Looks(RootModel[Annotated[dict[Name, Slots], Field(max_length=MAX_BODIES)]]):
    """Colours: body or town element -> slot (skin, shirt, paint, wall ...) -> colour. A value that variants share."""

    model_config = ConfigDict(frozen=True, ignored_types=(cached_property,))

    def __getitem__(self, name: str) -> dict[str, Colour]:
        return self.root[name]

    @cached_property
    def digest(self) -> str:
        """Identity of the colours."""
        return digest("plan/looks/1", self.root)


class TexturePlan(Plan):
    """An image on a slot of a body, by the texture coordinates of its mesh; the slot's colour is multiplied by it."""

    file: FilePlan
    number: Annotated[int, Field(ge=0, le=100_000)] | None = (
        None  # which of a glTF file's images; None: the file is the image
    )
    repeat: bool = False  # beyond its edges it starts again, else its edge goes on


Textures = Annotated[dict[Slot, TexturePlan], Field(max_length=MAX_SLOTS)]  # by slot


class AppearancePlan(Plan):
    """What colour everything has."""

    version: Literal[1] = 1
    seed: Annotated[int, Field(ge=0, lt=1 << 53)]  # for rain, sensor noise and lit windows
    weather: Weather
    sun: Sun
    looks: Looks
    textures: Annotated[dict[Name, Textures], Field(max_length=MAX_PROPS + MAX_ACTORS)] = Field(
        default_factory=dict
    )  # body -> slot -> image
    patches: Patches = ()
    responses: Annotated[dict[Name, CameraResponse], Field(max_length=MAX_SENSORS)]  # by sensor

    @model_serializer(mode="wrap")
    def _without_absent_patches(self, own: SerializerFunctionWrapHandler) -> dict[str, object]:
        document: dict[str, object] = own(self)
        if not self.patches:
            document.pop("patches", None)
        return document

    @cached_property
    def colours(self) -> str:
        """Identity of what surfaces look like in white light."""
        textures = self.model_dump(mode="json", include={"textures", "patches"})
        return digest("plan/colours/1", {**textures, "looks": self.looks.digest})

    @cached_property
    def digest(self) -> str:
        """Identity of the appearance. An absent optional part does not change it."""
        own = self.model_dump(mode="json", exclude={"looks"} if self.textures else {"looks", "textures"})
        return digest("plan/appearance/1", {**own, "looks": self.looks.digest})


class ScenarioPlan(Plan):
    """One fully resolved variant of a recipe."""

    variant: Annotated[str, Field(max_length=MAX_VARIANT_NAME)]
    scene: ScenePlan
    rig: RigPlan
    appearance: AppearancePlan

    @property
    def files(self) -> dict[str, FilePlan]:
        """The files that it uses, by digest."""
        meshes = [prop.mesh for prop in self.scene.props if prop.mesh is not None]
        meshes += [actor.mesh.file for actor in self.scene.actors if actor.mesh is not None]
        images = [texture.file for slots in self.appearance.textures.values() for texture in slots.values()]
        patches = [file for patch in self.appearance.patches for file in patch.texture.files]
        return {file.sha256: file for file in [*meshes, *images, *patches]}

    @cached_property
    def observation(self) -> str:
        """Identity of scene and rig, which determine the labels."""
        return digest("plan/observation/1", [self.scene.digest, self.rig.digest])

    @cached_property
    def digest(self) -> str:
        """Identity of the variant's content; its name is not part of it."""
        return digest("plan/scenario/1", [self.scene.digest, self.rig.digest, self.appearance.digest])


class DatasetPlan(Plan):
    """All variants of a recipe, in file order, and what to write."""

    recipe: Name
    description: Annotated[str, Field(max_length=MAX_DESCRIPTION)]
    about: About = About()
    variants: Annotated[tuple[ScenarioPlan, ...], Field(max_length=MAX_VARIANTS)]
    annotations: Annotated[tuple[Literal["kwcoco", "coco", "mots_txt", "mots_png"], ...], Field(max_length=4)]
    forms: Annotated[dict[str, str], AfterValidator(modalities.checked)] = Field(
        default_factory=dict, validate_default=True
    )  # of the files of modalities that have several

    def named(self, name: str | None) -> ScenarioPlan:
        """The variant of that name; the first one for None.

        Raises:
            InputError: there is no such variant; the remedy has the nearest name.
            TypeError: the name is not text.
        """
        by_name = {v.variant: v for v in self.variants}
        if name is None:
            return self.variants[0]
        if not isinstance(name, str):  # the name may come from a caller of the Python API
            raise TypeError(f"a variant is a name, such as {next(iter(by_name))!r}, not {name!r}")
        if name not in by_name:
            near = _with_values(name, by_name) or get_close_matches(name, by_name, 1, 0.6)
            hint = f"did you mean {near[0]!r}?" if near else f"the first is {next(iter(by_name))!r}, and"
            raise InputError(
                f"{self.recipe} has no variant {name!r}",
                help=f"{hint} `recipe plan` lists all",
                code=Code.UNKNOWN_NAME,
            )
        return by_name[name]

    @property
    def outputs(self) -> dict[str, list[str] | str]:
        """The annotation formats, and the form of each listed modality by its name, as plain JSON values."""
        return {"annotations": list(self.annotations), **self.forms}

    @cached_property
    def digest(self) -> str:
        """Identity of the recipe's meaning: every variant's name and digest, and the outputs asked for."""
        return digest(
            "plan/dataset/1",
            {"variants": [[v.variant, v.digest] for v in self.variants], **self.outputs},
        )


def _with_values(given: str, names: Iterable[str]) -> list[str]:
    """The first variant that has all the values of axes in a text such as `wet` or `weather=wet,dusk`, if any."""
    wanted = set(given.split(","))
    for name in names:
        parts = name.split(",")
        if wanted <= {*parts, *(part.partition("=")[2] for part in parts)}:
            return [name]
    return []
