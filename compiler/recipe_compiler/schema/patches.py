"""Patches: textures on surfaces of the town, of actors and of props, and on free-standing boards."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from recipe_compiler.ir.patches import MAX_EMISSION, PatchMode, TransferMethod
from recipe_compiler.schema.fields import NAME_LENGTH, ActorName, Colour, Metres, Model, Name, bounded
from recipe_compiler.schema.scene import Board, Standing


class SurfacePoint(Model):
    """The position of a patch's centre on its surface."""

    x: Annotated[
        Metres | None, Field(description="Metres to the right of the surface's middle, seen from its front.")
    ] = None
    z: Annotated[
        Metres | None,
        Field(description="Metres above the foot of the body; on a level surface, from the surface's middle."),
    ] = None


class Carrier(Model):
    """The surface that a patch is on: of the town, of an actor or of a prop; or a free-standing board."""

    town: Annotated[str | None, Field(max_length=100, description="Element of the town, such as `wall.3`.")] = None
    actor: Annotated[ActorName | None, Field(description="Name of an actor.")] = None
    prop: Annotated[Name | None, Field(description="Name of a prop.")] = None
    board: Annotated[
        Standing | None,
        Field(description="Pose of a free-standing board, like that of a prop; it has the patch's size."),
    ] = None
    surface: Annotated[
        str | None,
        Field(
            max_length=NAME_LENGTH,
            description="Name of the surface. Default: the first that `recipe surfaces` lists. `body` and `shirt` are "
            "texture maps, which cover the entire body or shirt.",
        ),
    ] = None
    at: Annotated[
        SurfacePoint, Field(description="Position of the patch's centre on the surface. Default: the middle.")
    ] = SurfacePoint()
    size: Annotated[Board | None, Field(description="Size of the patch; not for texture maps.")] = None

    @model_validator(mode="after")
    def _one(self) -> Carrier:
        given = [key for key in ("town", "actor", "prop", "board") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "carrier", "a patch is on one of `town`, `actor`, `prop` or `board`; give one of them", {}
            )
        if self.board is not None and self.size is None:
            raise PydanticCustomError("carrier", "a board has the patch's size; give `size`", {"key": "board"})
        if self.board is not None and (self.surface is not None or self.at != SurfacePoint()):
            key = "surface" if self.surface is not None else "at"
            raise PydanticCustomError("carrier", "a patch fills its board; remove it", {"key": key})
        return self


class Texture(Model):
    """The texture of a patch: an image, a folder of images, or a colour."""

    image: Annotated[str | None, Field(max_length=200, description="A .png file below this file's folder.")] = None
    frames: Annotated[
        str | None,
        Field(max_length=200, description="A folder of .png files, one for each frame, in the order of their names."),
    ] = None
    color: Annotated[Colour | None, Field(description='A colour, such as "#00903a".')] = None
    sha256: Annotated[
        str | None,
        StringConstraints(pattern=r"^[0-9a-f]{64}$"),
        Field(description="SHA-256 of the image; other content is an error. The lockfile pins it as well."),
    ] = None

    @model_validator(mode="after")
    def _one(self) -> Texture:
        given = [key for key in ("image", "frames", "color") if getattr(self, key) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "texture", "a texture is one of `image`, `frames` or `color`; give one of them", {}
            )
        if self.sha256 is not None and self.image is None:
            raise PydanticCustomError("texture", "goes with an `image` only; remove it", {"key": "sha256"})
        return self


class ColorTransfer(Model):
    """How the colours of a texture are fitted to the picture, in mode color_transfer."""

    method: Annotated[
        TransferMethod,
        Field(
            description="dapricot: a matrix fitted to a chart of 24 colours, and the placeholder's brightness. "
            "matrix: likewise, with the brightness relative to the matrix's prediction. "
            "armory: the placeholder's brightness. reap: a linear fit per channel to the chart."
        ),
    ] = "dapricot"


class Patch(Model):
    """A texture on a surface: opaque matt paper, unless it has gloss or emission."""

    on: Annotated[Carrier, Field(description="The surface.")]
    mode: Annotated[
        PatchMode,
        Field(
            description="rendered: the texture in the scene's light. green: the placeholder #00903a. "
            "digital, color_transfer: the placeholder, with the texture inserted into the finished picture."
        ),
    ] = "rendered"
    color_transfer: Annotated[ColorTransfer, Field(description="The colour transform of mode color_transfer.")] = (
        ColorTransfer()
    )
    texture: Annotated[Texture | None, Field(description="The texture; optional in mode green.")] = None
    gloss: Annotated[float, bounded(0, 1, "Gloss, 0 (matt) to 1 (a mirror).")] = 0.0
    emission: Annotated[
        float, bounded(0, MAX_EMISSION, "Luminance of a white texel, cd/m2, of a display or a lit case.")
    ] = 0.0

    @model_validator(mode="after")
    def _has_texture(self) -> Patch:
        if self.texture is None and self.mode != "green":
            raise PydanticCustomError("texture", "a patch of this mode needs a `texture`; add it", {"key": "mode"})
        return self
