"""The options of `recipe surfaces` that paint texture maps with textures made for other models."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from recipe_compiler.ir.errors import Code, InputError

if TYPE_CHECKING:
    from recipe_compiler.library.surfaces import WholeSurface

_T = TypeVar("_T")
Painter = Callable[["WholeSurface"], bytes]  # a texture map as a PNG


def painter(paint: Path | None, metres: float, model: Path | None, up: str, turn: int) -> Painter | None:
    """Return what paints texture maps; None if nothing is to be painted.

    Args:
        paint: The image.
        metres: Width of the image where it is repeated.
        model: The model that it was made for; None to repeat it.
        up: The model's upward axis, `y` or `z`.
        turn: Degrees by which the model is turned to the left.

    Raises:
        InputError: A file is missing, no image or no model; there is a model without an image; or the width is NaN.
    """
    if math.isnan(metres):
        raise InputError("--metres nan is not a number", help="write a width in metres, 0.01 to 100", code=Code.USAGE)
    if paint is None:
        if model is not None:
            raise InputError(f"--model {model} needs the image that was made for it", help="add --paint PNG")
        return None
    from recipe_compiler.ir import assets
    from recipe_runtime.report import foreign_textures

    pixels = _decoded(paint, ("png",), assets.image)
    if model is None:
        return lambda surface: foreign_textures.tiled(surface.islands, surface.aspect, pixels, metres)
    mesh = _decoded(model, ("obj", "glb", "gltf"), lambda content, kind: assets.mesh(content, kind, up))

    def unwrapped(surface: WholeSurface) -> bytes:
        try:
            return foreign_textures.unwrapped(surface.islands, surface.aspect, mesh, pixels, turn)
        except ValueError as error:
            help = "choose a vehicle with four wheels and a model with texture coordinates, or leave out --model"
            raise InputError(f"{model} on {surface.body}.{surface.name}: {error}", help=help) from None

    return unwrapped


def _decoded(path: Path, kinds: tuple[str, ...], decode: Callable[[bytes, str], _T]) -> _T:
    """Return the content of a file of one of some kinds."""
    from recipe_compiler.ir.assets import AssetError
    from recipe_compiler.ir.bounded_reads import read_regular
    from recipe_compiler.ir.plan_types import MAX_FILE_BYTES

    kind = path.suffix[1:].lower()
    if kind not in kinds:
        raise InputError(f"{path}: the name does not end in {' or '.join('.' + k for k in kinds)}")
    try:
        content = read_regular(path, MAX_FILE_BYTES)
        if len(content) > MAX_FILE_BYTES:
            raise AssetError(f"is larger than {MAX_FILE_BYTES >> 20} MiB; make it smaller")
        return decode(content, kind)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file", code=Code.FILE_NOT_FOUND) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
