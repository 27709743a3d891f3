"""The mesh types: triangles in the frame of a rigid part, each with a surface, and the part's lights."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Pattern(IntEnum):
    """The procedural pattern of a surface, evaluated over `uv`; the slot's colour is its base."""

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
    WINDOW = 17  # floor(uv) names the window (some are lit at night), fract(uv) is the place in the pane
    LAMP = 18  # glows when the sun is down
    HEADLIGHT = 19  # glows when the sun is down
    TAILLIGHT = 20  # glows when the sun is down
    HAIR = 21
    LENS = 22  # the glass of a vehicle's lamp that is never lit
    CLAPBOARD = 30  # level boards that overlap, uv in metres
    STONE = 31  # dressed blocks, uv in metres
    WOOD = 32  # planks along v, uv in metres
    WATER = 33
    NICHE = 34  # a recess in a wall: v is 0 at its opening and 1 at its end, where ambient light is low
    CURTAIN_WALL = 35  # named like WINDOW; the pane's lower part hides a floor slab
    SHOP_WINDOW = 36  # named like WINDOW; a display behind one large pane
    LETTER = 38  # a letter of 4 x 6 dots, see `lettering`; the second colour writes
    FACADE = 39  # named like WINDOW; a window in its piece of wall, for buildings seen from afar
    SIGNAL = 40  # a lit lens: it glows by day and by night
    IMAGE = 41  # a texture of the appearance, uv (0, 0) its top-left corner; without one the slot's colour alone
    POSTER = 37  # floor(u) names the picture, fract(uv) is the place in it


@dataclass(frozen=True)
class Surface:
    """A look: the colour slot (a key of the body's look in the plan), the pattern, and CARLA's semantic tag."""

    slot: str
    pattern: Pattern
    tag: int


@dataclass(frozen=True)
class Light:
    """A spot light carried by a part, in the part's frame; on when the sun is down. A lamp points down."""

    position: tuple[float, float, float]
    direction: tuple[float, float, float]  # unit
    colour: tuple[float, float, float]  # linear RGB
    intensity: float  # candela, about
    cone: float  # cosine of the half angle at which it has faded to nothing


@dataclass(frozen=True)
class Mesh:
    """V vertices and T triangles, counter-clockwise seen from outside. Hard edges have split vertices."""

    vertices: NDArray[np.float32]  # [V, 3] metres
    normals: NDArray[np.float32]  # [V, 3] unit
    uvs: NDArray[np.float32]  # [V, 2]
    triangles: NDArray[np.int32]  # [T, 3]
    surface: NDArray[np.int32]  # [T] index into surfaces
    surfaces: tuple[Surface, ...]
    lights: tuple[Light, ...] = ()


@dataclass(frozen=True)
class Body:
    """An actor or a town element: its rigid parts in the Trace's order, the base first."""

    name: str  # key of AppearancePlan.looks
    instance: int  # class * 1000 + instance for actors, 0 for the town
    parts: tuple[tuple[str, Mesh], ...]

    def mesh(self, part: str) -> Mesh:
        """The mesh of a part."""
        return dict(self.parts)[part]
