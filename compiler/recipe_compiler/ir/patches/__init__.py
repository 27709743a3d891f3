"""The plan of patches: textures that an appearance applies to surfaces as decals.

A patch is a rectangle on a flat surface, or it covers an entire body (`whole`): then its faces project the texture onto
the body's parts from the sides of boxes, and each triangle takes the face that it faces most. Positions of faces and
digests of images are resolved.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from recipe_compiler.ir.plan_types import MAX_FRAMES, Colour, FilePlan, Metres, Name, Number, Plan, Share, Slot

PatchMode = Literal["green", "rendered", "digital", "color_transfer"]
TransferMethod = Literal["dapricot", "matrix", "armory", "reap"]
INSERTED: tuple[PatchMode, ...] = ("digital", "color_transfer")  # modes that insert the texture into the picture
WITH_CHART: tuple[TransferMethod, ...] = ("dapricot", "matrix", "reap")  # methods that need the picture of a chart
GREEN = "#00903a"  # the placeholder colour
STATIC = "static"  # the part of a static body; its frame is world space
MAX_PATCHES = 64
MAX_FACES = 64
MAX_PATCH_SLOTS = 64
MAX_EMISSION = 100_000.0  # cd/m2

Vector = tuple[Metres, Metres, Metres]


class PatchFace(Plan):
    """A rectangle in the frame of a part of a body, metres. u is along `right`, v along `down`, from 0 to 1 each.

    Seen from the side of its normal, `down` x `right`, the texture is upright and not mirrored.
    """

    part: Name  # STATIC, or a part of an actor
    corner: Vector  # the top left corner, metres
    right: Vector  # unit
    down: Vector  # unit
    width: Annotated[Number, Field(gt=0, le=1000)]  # metres
    height: Annotated[Number, Field(gt=0, le=1000)]
    region: tuple[Share, Share, Share, Share] = (0.0, 0.0, 1.0, 1.0)  # of the texture: left, top, right, bottom
    reach: Annotated[Number, Field(gt=0, le=1000)]  # metres; points farther from the rectangle's plane are not covered

    @model_validator(mode="after")
    def _rectangle(self) -> PatchFace:
        if any(abs(sum(x * x for x in v) - 1.0) > 1e-3 for v in (self.right, self.down, self.normal)):
            raise ValueError("a face is not a rectangle")
        left, top, right, bottom = self.region
        if left >= right or top >= bottom:
            raise ValueError("a face shows nothing of the texture")
        return self

    @property
    def normal(self) -> tuple[float, float, float]:
        """The unit normal of the side that shows the texture: `down` x `right`."""
        (a, b, c), (x, y, z) = self.down, self.right
        return b * z - c * y, c * x - a * z, a * y - b * x

    @property
    def corners(self) -> tuple[tuple[float, float, float], ...]:
        """Top left, top right, bottom right, bottom left: clockwise seen from the front."""
        uv = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
        return tuple(self._at(u * self.width, v * self.height) for u, v in uv)

    def _at(self, across: float, along: float) -> tuple[float, float, float]:
        x, y, z = (self.corner[axis] + across * self.right[axis] + along * self.down[axis] for axis in range(3))
        return x, y, z


class PatchTexture(Plan):
    """The texture of a patch: an image, a sequence with an image for each frame, or a colour."""

    image: FilePlan | None = None
    frames: Annotated[tuple[FilePlan, ...], Field(max_length=MAX_FRAMES)] = ()
    colour: Colour | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> PatchTexture:
        if (self.image is not None) + bool(self.frames) + (self.colour is not None) != 1:
            raise ValueError("a texture is one of an image, a sequence and a colour")
        if any(file.kind != "png" for file in self.files):
            raise ValueError("a texture of a patch is a PNG image")
        return self

    def at(self, frame: int) -> FilePlan | None:
        """The image of a frame; None for a colour."""
        return self.frames[frame] if self.frames else self.image

    @property
    def files(self) -> tuple[FilePlan, ...]:
        """All images."""
        return (self.image,) if self.image is not None else self.frames


class PatchPlan(Plan):
    """A texture on the surface of a body. Without gloss and emission it is opaque matt paper."""

    name: Name
    body: Name  # an element of the town, an actor or a prop
    slots: Annotated[tuple[Slot, ...], Field(max_length=MAX_PATCH_SLOTS)] = ()  # of the body; empty: all slots
    faces: Annotated[tuple[PatchFace, ...], Field(min_length=1, max_length=MAX_FACES)]
    whole: bool = False  # covers its slots entirely by projection; otherwise it has one face, a rectangle
    mode: PatchMode = "rendered"
    transfer: TransferMethod | None = None  # of the colour transform, in mode color_transfer
    texture: PatchTexture
    gloss: Share = 0.0  # 0 matt, 1 a mirror
    emission: Annotated[Number, Field(ge=0, le=MAX_EMISSION)] = 0.0  # luminance of a white texel, cd/m2

    @model_validator(mode="after")
    def _insertion(self) -> PatchPlan:
        if self.mode in INSERTED and self.whole:
            raise ValueError("a texture that covers an entire body cannot be inserted into the picture")
        if (self.mode == "color_transfer") != (self.transfer is not None):
            raise ValueError("the mode color_transfer has a transfer method, and no other mode has")
        return self

    @property
    def inserted(self) -> bool:
        """Whether its texture is inserted into the finished picture."""
        return self.mode in INSERTED

    @property
    def shown(self) -> PatchTexture:
        """What the renderer shows: the texture, or the placeholder, if the texture is inserted into the picture."""
        return self.texture if self.mode == "rendered" else PatchTexture(colour=GREEN)

    @property
    def changes(self) -> bool:
        """Whether its image changes from frame to frame."""
        return bool(self.shown.frames)


Patches = Annotated[tuple[PatchPlan, ...], Field(max_length=MAX_PATCHES)]  # later ones lie over earlier ones
