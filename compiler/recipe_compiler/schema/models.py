"""The recipe language as models: every key, its type, its range and its meaning.

They are frozen, refuse unknown keys, and take no type for another (`"30"` is no number). Shorthands are written out
before a value comes here. Lengths are metres, times seconds, angles degrees, speeds metres a second.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir import optics

MAX_FRAMES = 100_000
MAX_VARIANTS = 10_000
MAX_DRAWS = 100_000  # of all variants together
MAX_SEED = 2**32 - 1
MAX_DRAWN = 1e15  # bounds of a draw: far beyond any number of the language, and no sum of two overflows
NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"  # names become folders; a dot in one would break consumers of file stems
BLUEPRINT = r"^[A-Za-z0-9_.?*-]+$"
NAME_LENGTH = 64
MAX_PROPS, MAX_ASSETS = 1000, 100
TRAFFIC_LIMIT, PARKED_LIMIT = 250, 100  # instance numbers are three digits, shared out in placing.py

Name = Annotated[str, StringConstraints(pattern=NAME, max_length=NAME_LENGTH)]
ActorName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$", max_length=NAME_LENGTH)]
Colour = Annotated[str, StringConstraints(pattern=r"^#[0-9A-Fa-f]{6}$")]
Metres = Annotated[float, Field(ge=-10_000, le=10_000, allow_inf_nan=False)]
Degrees = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]
Percent = Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)]
Magnitude = Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)]
Turn = Annotated[float, Field(ge=0, le=180, allow_inf_nan=False)]
Modality = Literal["rgb", "depth", "instance", "semantic"]
Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
PropTag = Literal[
    "Buildings", "Walls", "Fences", "Poles", "TrafficLight", "TrafficSigns", "Vegetation", "Static", "Dynamic", "Other",
    "Bridge", "GuardRail",
]  # fmt: skip


def _forwards(value: Any) -> Any:
    if value is not None and value[0] > value[1]:
        low, high = (f"{number:g}" for number in value)
        raise PydanticCustomError(
            "range",
            "the range [{low}, {high}] runs backwards; write the lower number first",
            {"low": low, "high": high},
        )
    return value


def _unique(value: tuple[str, ...]) -> tuple[str, ...]:
    for name in value:
        if value.count(name) > 1:
            raise PydanticCustomError("once", "names {name} twice; once is enough", {"name": name})
    return value


def _lists_as_tuples(**extra: Any) -> Any:
    return Field(strict=False, **extra)


class Model(BaseModel):
    """A frozen part of a recipe."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


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


class Weather(Model):
    """CARLA's fourteen weather parameters, over a preset. Absent ones are the preset's."""

    preset: Annotated[
        str, Field(max_length=NAME_LENGTH, description="A CARLA preset; `weather: ClearNoon` is short for it.")
    ] = "Default"
    cloudiness: Annotated[Percent | None, Field(description="Clouds, 0 to 100.")] = None
    precipitation: Annotated[Percent | None, Field(description="Rain, 0 to 100.")] = None
    precipitation_deposits: Annotated[Percent | None, Field(description="Puddles, 0 to 100.")] = None
    wind_intensity: Annotated[Percent | None, Field(description="Wind, 0 to 100.")] = None
    sun_azimuth_angle: Annotated[
        float | None,
        Field(ge=0, le=360, allow_inf_nan=False, description="CARLA's azimuth: clockwise, seen from above, from +x."),
    ] = None
    sun_altitude_angle: Annotated[
        float | None, Field(ge=-90, le=90, allow_inf_nan=False, description="Degrees above the horizon.")
    ] = None
    fog_density: Annotated[Percent | None, Field(description="Fog, 0 to 100.")] = None
    fog_distance: Annotated[
        float | None, Field(ge=0, le=10_000, allow_inf_nan=False, description="Metres at which fog starts.")
    ] = None
    fog_falloff: Annotated[
        float | None, Field(ge=0, le=1000, allow_inf_nan=False, description="How fast fog thins with height.")
    ] = None
    wetness: Annotated[Percent | None, Field(description="How wet surfaces are, 0 to 100.")] = None
    scattering_intensity: Annotated[Percent | None, Field(description="Light that fog scatters, 0 to 100.")] = None
    mie_scattering_scale: Annotated[
        float | None, Field(ge=0, le=5, allow_inf_nan=False, description="Scattering by large particles.")
    ] = None
    rayleigh_scattering_scale: Annotated[
        float | None, Field(ge=0, le=2, allow_inf_nan=False, description="Scattering by air.")
    ] = None
    dust_storm: Annotated[Percent | None, Field(description="Dust in the air, 0 to 100.")] = None


class Geography(Model):
    """Where and on which day `time` is told. The town's +x points east, its +y north."""

    latitude: Annotated[float, Field(ge=-89, le=89, allow_inf_nan=False, description="Degrees north.")] = 49.0
    longitude: Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False, description="Degrees east.")] = 8.0
    date: Annotated[
        str,
        StringConstraints(pattern=r"^(19|20)[0-9]{2}-[0-9]{2}-[0-9]{2}$"),
        Field(description='The day, quoted: "2022-08-12".'),
    ] = "2022-08-12"
    utc_offset: Annotated[
        float | None,
        Field(ge=-14, le=14, allow_inf_nan=False, description="Hours ahead of UTC; absent: longitude / 15, rounded."),
    ] = None


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
    speed: Annotated[
        float | None,
        Field(ge=0, le=60, allow_inf_nan=False, description="m/s; absent: the blueprint's own; 0: it stands."),
    ] = None
    start: Annotated[Start | None, Field(description="Absent: a spawn point of the town, by seed and name.")] = None
    goal: Annotated[GroundPoint | None, Field(description="It goes there straight; absent: a route of the town.")] = (
        None
    )
    route: Annotated[
        tuple[GroundPoint, ...] | None,
        _lists_as_tuples(min_length=1, max_length=1000, description="Waypoints after the start, instead of `goal`."),
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

    width: Annotated[float, Field(ge=0.01, le=100, allow_inf_nan=False, description="Metres.")]
    height: Annotated[float, Field(ge=0.01, le=100, allow_inf_nan=False, description="Metres.")]


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
    tag: Annotated[PropTag, Field(description="What it is to the semantic camera; CARLA's names.")] = "Static"
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
    fov: Annotated[
        float, Field(ge=1, le=170, allow_inf_nan=False, description="Horizontal field of view, degrees.")
    ] = 90.0
    near: Annotated[float, Field(ge=0.01, le=10, allow_inf_nan=False, description="Nearest depth, metres.")] = 0.1
    far: Annotated[float, Field(ge=20, le=10_000, allow_inf_nan=False, description="Farthest depth, metres.")] = 1000.0
    lens_k: Annotated[
        float, Field(ge=-1, le=1, allow_inf_nan=False, description="Distortion: above 0 barrel, below pincushion.")
    ] = 0.0
    lens_kcube: Annotated[
        float, Field(ge=-1, le=1, allow_inf_nan=False, description="Distortion that grows faster to the corners.")
    ] = 0.0
    exposure_mode: Annotated[
        Literal["auto", "manual"],
        Field(description="auto: by sun, weather and lamps; manual: by shutter, iso and fstop."),
    ] = "auto"
    exposure_compensation: Annotated[
        float, Field(ge=-15, le=15, allow_inf_nan=False, description="Stops on top of the exposure.")
    ] = 0.0
    shutter_speed: Annotated[
        float, Field(ge=1, le=10_000, allow_inf_nan=False, description="1/s: 200 is open for 1/200 s.")
    ] = 200.0
    iso: Annotated[
        float, Field(ge=25, le=102_400, allow_inf_nan=False, description="Sensitivity; noise grows as its root.")
    ] = 100.0
    fstop: Annotated[
        float, Field(ge=0.7, le=32, allow_inf_nan=False, description="f-number; for the manual exposure.")
    ] = 1.4
    gamma: Annotated[float, Field(ge=0.5, le=5, allow_inf_nan=False, description="2.2: sRGB; above: brighter.")] = 2.2
    temp: Annotated[
        float, Field(ge=1500, le=15_000, allow_inf_nan=False, description="Kelvin of the light taken for white.")
    ] = 6500.0
    tint: Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False, description="-1 green to 1 magenta.")] = 0.0
    noise: Annotated[
        float, Field(ge=0, le=10, allow_inf_nan=False, description="0: none; 1: a good street camera's.")
    ] = 1.0
    vignette_intensity: Annotated[
        float, Field(ge=0, le=1, allow_inf_nan=False, description="How much darker corners are; 0: none.")
    ] = 0.4
    lens_circle_multiplier: Annotated[
        float, Field(ge=0, le=10, allow_inf_nan=False, description="How dark the lens's rim is; 0: none.")
    ] = 0.0
    lens_circle_falloff: Annotated[
        float, Field(ge=0, le=10, allow_inf_nan=False, description="How near to the corners the rim stays.")
    ] = 5.0
    chromatic_aberration_intensity: Annotated[
        float, Field(ge=0, le=10, allow_inf_nan=False, description="Percent by which red and blue part at corners.")
    ] = 0.0
    chromatic_aberration_offset: Annotated[
        float, Field(ge=0, le=0.99, allow_inf_nan=False, description="Radius from which they part; 1: the corners.")
    ] = 0.0
    bloom_intensity: Annotated[
        float, Field(ge=0, le=5, allow_inf_nan=False, description="Light that bright places shed about them.")
    ] = 0.0
    motion_blur_intensity: Annotated[
        float, Field(ge=0, le=10, allow_inf_nan=False, description="0: none; 1: as long as the shutter is open.")
    ] = 0.0
    motion_blur_max_distortion: Annotated[
        float, Field(ge=0, le=1, allow_inf_nan=False, description="Longest blur, as a share of the width.")
    ] = 0.35
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


Loose = Field(strict=False)  # a list stands for a tuple
Bound = Annotated[float, Field(ge=-MAX_DRAWN, le=MAX_DRAWN, allow_inf_nan=False)]
Range = Annotated[tuple[Bound, Bound], Loose, AfterValidator(_forwards)]
WholeRange = Annotated[tuple[int, int], Loose, AfterValidator(_forwards)]
Span = Annotated[tuple[Degrees, Degrees], Loose, AfterValidator(_forwards)]
Sway = Annotated[Span | None, Field(description="[lowest, highest], degrees, added to the mount's.")]


class Rotation(Model):
    """A smooth sweep to and fro, a sine over time, that starts midway."""

    yaw: Sway = None
    pitch: Sway = None
    roll: Sway = None
    period: Annotated[float, Field(ge=0.1, le=86_400, allow_inf_nan=False, description="Seconds to and fro.")]


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
        AfterValidator(_unique),
        _lists_as_tuples(min_length=1, description="Which of rgb, depth, instance, semantic."),
    ]
    motion: Annotated[Motion, Field(description="How it moves.")] = Motion()


class Base(Model):
    """One scenario: what every variant starts from."""

    clock: Annotated[Clock, Field(description="When frames are taken.")]
    town: Annotated[Town, Field(description="The town, or its name.")]
    weather: Annotated[Weather, Field(description="The weather, or a preset's name.")] = Weather()
    time: Annotated[
        str | None,
        StringConstraints(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9](:[0-5][0-9])?$"),
        Field(description='Time of day, quoted: "19:40"; sets the sun, unless a sun angle is given by hand.'),
    ] = None
    place: Annotated[Geography, Field(description="Where `time` is told.")] = Geography()
    actors: Annotated[dict[Name, Actor], Field(description="Actors by name.")] = {}
    traffic: Annotated[Traffic, Field(description="Seeded others.")] = Traffic()
    props: Annotated[dict[Name, Prop], Field(max_length=MAX_PROPS, description="What stands about, by name.")] = {}
    sensors: Annotated[dict[Name, Sensor], Field(min_length=1, description="Sensors by name.")]


class Distribution(Model):
    """What a draw takes its value from: exactly one of the four."""

    uniform: Annotated[Range | None, Field(description="[low, high].")] = None
    normal: Annotated[Annotated[tuple[Bound, Bound], Loose] | None, Field(description="[mean, deviation].")] = None
    integer: Annotated[WholeRange | None, Field(description="[low, high], both included.")] = None
    choice: Annotated[
        tuple[bool | int | float | str, ...] | None,
        _lists_as_tuples(min_length=1, max_length=1000, description="One of these."),
    ] = None
    clip: Annotated[Range | None, Field(description="With `normal`: [low, high].")] = None

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [name for name in ("uniform", "normal", "integer", "choice") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise PydanticCustomError(
                "distribution",
                "a draw is one of uniform, normal, integer, choice, and this has {found}; give one",
                {"found": found},
            )
        if self.clip and not self.normal:
            raise PydanticCustomError("clip", "goes with `normal` only; remove it", {"key": "clip"})
        if self.normal and self.normal[1] < 0:
            raise PydanticCustomError(
                "deviation",
                "the deviation {it} is negative; write 0 or more",
                {"key": "normal", "it": f"{self.normal[1]:g}"},
            )
        return self


class Draw(Model):
    """Random draws, resolved when compiled; each is a variant with the same draws in all axes' values."""

    count: Annotated[int, Field(ge=1, le=MAX_VARIANTS, description="How many draws of each variant.")]
    values: Annotated[
        dict[Annotated[str, StringConstraints(min_length=1, max_length=200)], Distribution],
        Field(min_length=1, max_length=100, description="Path, such as actors.hero1.speed, to distribution."),
    ]


class Sweep(Model):
    """Which variants there are."""

    axes: Annotated[
        tuple[str, ...] | None,
        _lists_as_tuples(min_length=1, description="Axes to multiply; absent: all, in file order."),
    ] = None
    exclude: Annotated[
        tuple[dict[str, str], ...],
        _lists_as_tuples(max_length=1000, description="Combinations to leave out: `{weather: foggy}`."),
    ] = ()
    repeats: Annotated[
        int, Field(ge=1, le=MAX_VARIANTS, description="Runs of each variant, each with a seed of its own.")
    ] = 1
    draw: Annotated[Draw | None, Field(description="Random draws.")] = None


class Output(Model):
    """What is written besides the frames."""

    annotations: Annotated[
        tuple[Literal["kwcoco", "coco", "mots_txt", "mots_png"], ...],
        AfterValidator(_unique),
        _lists_as_tuples(description="Annotation formats."),
    ] = ("kwcoco", "coco")
    depth: Annotated[
        Literal["carla", "npy"], Field(description="Depth on disk: CARLA's 24-bit PNG, or float32 metres.")
    ] = "carla"


class Recipe(Model):
    """A recipe without its base and deltas, which are checked variant by variant."""

    recipe: Annotated[Name, Field(description="The dataset's name.")]
    description: Annotated[str, Field(max_length=2000, description="What the dataset is for.")] = ""
    seed: Annotated[Seed, Field(description="Seeds every draw; 0 is a seed like any other.")] = 0
    extends: Annotated[str | None, Field(description="A file below this one's folder that this one is laid over.")] = (
        None
    )
    assets: Annotated[
        dict[Name, Asset], Field(max_length=MAX_ASSETS, description="Files that the recipe brings, by name.")
    ] = {}
    sweep: Annotated[Sweep, Field(description="Which variants there are.")] = Sweep()
    output: Annotated[Output, Field(description="What is written.")] = Output()
