"""The types of meshes: triangles in the frame of a part, each with a surface, and the part's lights."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Pattern(IntEnum):
    """The procedural pattern of a surface, evaluated at `uv`; its base colour is the slot's colour."""

    PLAIN = 0
    ASPHALT = 1  # uv in metres
    SLABS = 2  # paving, uv in metres
    CONCRETE = 3
    BRICK = 4  # uv in metres
    PLASTER = 5
    ROOF = 6
    GRASS = 7
    FOLIAGE = 8
    BARK = 9
    METAL = 10
    SKIN = 11
    CLOTH = 12
    RUBBER = 13
    ROAD_PAINT = 14
    CAR_PAINT = 15
    GLASS = 16  # vehicle glass
    WINDOW = 17  # floor(uv) is the window's number (some are lit at night), fract(uv) the position in the pane
    LAMP = 18  # emits light at night
    HEADLIGHT = 19  # emits light at night; fract(uv) is the position in a reflector
    TAILLIGHT = 20  # emits light at night; uv as for `HEADLIGHT`
    HAIR = 21
    LENS = 22  # the glass of a vehicle lamp that is never lit
    CLAPBOARD = 30  # overlapping horizontal boards, uv in metres
    STONE = 31  # ashlar, uv in metres
    WOOD = 32  # planks along v, uv in metres
    WATER = 33
    NICHE = 34  # a recess in a wall: v is 0 at its opening and 1 at its end, where ambient light is low
    CURTAIN_WALL = 35  # numbered like WINDOW; the lower part of a pane hides a floor slab
    SHOP_WINDOW = 36  # numbered like WINDOW; a display behind one large pane
    LETTER = 38  # a letter of 4 x 6 dots, see `lettering`, drawn in the second colour
    FACADE = 39  # numbered like WINDOW; a window and the wall around it, for distant buildings
    SIGNAL = 40  # a lit signal lens: it emits light by day and by night
    IMAGE = 41  # an image texture, uv (0, 0) at its top-left corner; without a texture, the slot's colour
    BIRCH_BARK = 50  # white, with dark marks across
    LANES = 42  # asphalt of lanes: u along in metres, floor(v) is the lane, fract(v) the position across it
    SETTS = 43  # small paving stones, uv in metres
    PLATES = 44  # paving of concrete plates, uv in metres
    KERB = 45  # kerb stones, uv in metres along the kerb and upwards
    PANELS = 46  # a wall of concrete panels, uv in metres
    BRAKELIGHT = 55  # uv as for `HEADLIGHT`
    INDICATOR = 56  # uv as for `HEADLIGHT`
    REVERSELIGHT = 57  # uv as for `HEADLIGHT`
    CABIN = 58  # vehicle glass with the interior behind it; uv is that of `meshes.cabin`
    NUMBER_PLATE = 59  # floor(u) is the character's place, fract(u) and v the position in it
    STRIPES = 63  # patterns of cloth: uv in metres, u 0 in the middle of the front
    CHECKS = 64
    PRINT = 65  # a picture on the chest
    DENIM = 66
    VEST = 67  # high-visibility, with reflecting bands
    POSTER = 37  # floor(u) is the picture's number, fract(uv) the position in it


@dataclass(frozen=True)
class Surface:
    """The appearance of triangles: a colour slot (key of the body's look in the plan), a pattern, and CARLA's tag."""

    slot: str
    pattern: Pattern
    tag: int


@dataclass(frozen=True)
class Light:
    """A spot light carried by a part, in the part's frame; it is on at night. A street lamp points down."""

    position: tuple[float, float, float]
    direction: tuple[float, float, float]  # unit
    colour: tuple[float, float, float]  # linear RGB
    intensity: float  # approximate candela
    cone: float  # cosine of the half angle of the cone, at which the light has faded to 0


REFERENCE_FOCAL = 640.0  # pixels: the focal length for which the distances of levels are given


@dataclass(frozen=True)
class Level:
    """A version of an object that is shown at some distances only, by the size that the object has in the picture.

    A camera whose focal length is REFERENCE_FOCAL pixels (1280 pixels wide, 90 degrees) shows the level if the distance
    from its eye to the anchor is at least `near` and less than `far`; for twice the focal length both are twice as
    large. The versions of an object have one anchor, and each begins where another ends.
    """

    near: float  # metres
    far: float  # metres
    anchor: tuple[float, float, float]  # metres, in the frame of the body's base part
    casts: bool  # whether this version casts the object's shadow, at any distance


@dataclass(frozen=True)
class Skin:
    """The parts that the vertices of an actor's continuous surface follow, by weight.

    Vertices and normals of the mesh are those of the rest pose: in the frame of the base part, while no joint is
    turned, so that all parts have the actor's orientation. A vertex follows its parts rigidly, and is drawn at the mean
    of their places, by weight.
    """

    parts: NDArray[np.int32]  # [V, K], K up to 4: indices of the actor's parts, the strongest first
    weights: NDArray[np.uint8]  # [V, K] in 255ths, of sum 255
    origins: NDArray[np.float64]  # [P, 3] origins of the actor's parts in the rest pose, metres
    parents: tuple[int, ...]  # of each part, -1 for the base part


@dataclass(frozen=True)
class Mesh:
    """V vertices and T triangles, counter-clockwise seen from outside. Vertices are duplicated at hard edges."""

    vertices: NDArray[np.float32]  # [V, 3] metres
    normals: NDArray[np.float32]  # [V, 3] unit
    uvs: NDArray[np.float32]  # [V, 2]
    triangles: NDArray[np.int32]  # [T, 3]
    surface: NDArray[np.int32]  # [T] index into surfaces
    surfaces: tuple[Surface, ...]
    lights: tuple[Light, ...] = ()
    levels: tuple[Level, ...] = ()
    level: NDArray[np.int32] | None = None  # [T] index into levels, -1 for what is always shown; None without levels
    skin: Skin | None = None  # of the mesh of a base part only; None: all vertices follow the part

    def seen_near_by(self) -> NDArray[np.int64]:
        """Return the vertices that near cameras see: those of the nearest version of every object, ascending."""
        if self.level is None:
            return np.arange(len(self.vertices))
        near = np.array([*(level.near == 0.0 for level in self.levels), True])
        found: NDArray[np.int64] = np.unique(self.triangles[near[self.level]]).astype(np.int64)
        return found


NO_MESH = Mesh(
    np.zeros((0, 3), np.float32),
    np.zeros((0, 3), np.float32),
    np.zeros((0, 2), np.float32),
    np.zeros((0, 3), np.int32),
    np.zeros(0, np.int32),
    (),
)  # of a part that a skin covers


@dataclass(frozen=True)
class Body:
    """An actor or a town element: its parts in the order of the Trace, the base part first, which may have a skin."""

    name: str  # key of AppearancePlan.looks
    instance: int  # class * 1000 + instance for actors, 0 for the town
    parts: tuple[tuple[str, Mesh], ...]
    is_signal: bool = False  # the lit lenses of a traffic light, which move

    @property
    def moves(self) -> bool:
        """Whether its parts have a pose in each frame; those of the others are in the world frame."""
        return self.instance != 0 or self.is_signal

    def mesh(self, part: str) -> Mesh:
        """Return the mesh of a part."""
        return dict(self.parts)[part]
