"""Checks of textures that callers pass, and their conversion to the renderer's form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.assets.png import MAX_PIXELS, MAX_SIDE
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.patches import PatchPlan
from recipe_compiler.ir.plan import AppearancePlan

Values = NDArray[np.float64]
Texture = NDArray[np.uint8] | NDArray[np.float32] | NDArray[np.float64]


def textured_patch(patches: tuple[PatchPlan, ...], name: str) -> PatchPlan:
    """Return the patch with a name, which must show a texture.

    Raises:
        InputError: No patch has this name, or its mode is `green`.
    """
    found = next((patch for patch in patches if patch.name == name), None)
    if found is None:
        names = ", ".join(patch.name for patch in patches)
        has = f"it has {names}" if names else "it has none"
        raise InputError(f"the variant has no patch {name!r}; {has}", code=Code.UNKNOWN_NAME)
    if found.mode == "green":
        raise InputError(
            f"patch {name}: its mode is green, so it shows no texture; choose a variant with mode rendered"
        )
    return found


def differentiable_patch(appearance: AppearancePlan, sensor: str, name: str) -> PatchPlan:
    """Return the patch with a name, which must have a gradient in the pictures of a sensor.

    Raises:
        InputError: No patch has this name, its mode is `green`, or its mode is `rendered` and another patch's texture
            is inserted into the finished picture or the sensor has a mosaic.
    """
    found = textured_patch(appearance.patches, name)
    inserted = [patch.name for patch in appearance.patches if patch.inserted]
    response = appearance.responses.get(sensor)
    if not found.inserted and response is not None and response.sensor is not None:
        raise InputError(
            f"patch {name}: there is no gradient in the pictures of {sensor}, whose camera has"
            f" sensor: {response.sensor}; choose a variant without it, or mode digital"
        )
    if inserted and not found.inserted:
        raise InputError(
            f"patch {name}: there is no gradient in a picture into which the texture of {inserted[0]} is inserted;"
            " choose a variant without insertion"
        )
    return found


def as_images(patches: tuple[PatchPlan, ...], textures: Mapping[str, object]) -> dict[str, NDArray[np.uint8]]:
    """Return textures by the name of their patch, uint8 [h, w, 3] sRGB; see `as_array` for what is accepted.

    Raises:
        InputError: The textures are no mapping, a patch does not exist or its mode is `green`, or a texture is not an
            image or has floats outside 0 to 1.
    """
    if not isinstance(textures, Mapping):
        raise InputError(f"the textures are a {type(textures).__name__}; give a dictionary from names of patches")
    return {textured_patch(patches, name).name: as_image(name, texture) for name, texture in textures.items()}


def as_image(name: str, texture: object) -> NDArray[np.uint8]:
    """Return a patch's texture as uint8 [h, w, 3]; floats from 0 to 1 are rounded, halves up.

    Raises:
        InputError: It is not an image, or has floats outside 0 to 1.
    """
    values = _within(name, as_array(name, texture))
    if values.dtype == np.uint8:
        return values.astype(np.uint8)
    image: NDArray[np.uint8] = np.floor(values.astype(np.float64) * 255.0 + 0.5).astype(np.uint8)
    return image


def as_array(name: str, texture: object) -> NDArray[np.generic]:
    """Return a patch's texture as an array [h, w, 3] of uint8, or of floats, whose range is not checked.

    Args:
        name: The patch, for messages.
        texture: An array [h, w, 3], or a tensor [3, h, w] or [1, 3, h, w]; uint8, or finite floats.

    Raises:
        InputError: It is of another shape or type, has values that are not finite, or is larger than an image of a
            recipe may be.
    """
    values = _channels_last(f"the texture of {name}", texture)
    if values.ndim != 3 or values.shape[2] != 3 or not values.size:
        raise InputError(
            f"the texture of {name} has the shape {_shape(texture)}; give an array [height, width, 3], or a tensor"
            " [3, height, width]"
        )
    check_size(name, values.shape[1], values.shape[0])
    if values.dtype != np.uint8 and values.dtype.kind != "f":
        raise InputError(f"the texture of {name} is of {values.dtype}; give uint8, or floats from 0 to 1")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise InputError(f"the texture of {name} has values that are not finite; give floats from 0 to 1")
    return values


def check_size(name: str, width: int, height: int) -> None:
    """Raise InputError if a texture is larger than an image of a recipe may be, or empty."""
    if not all(isinstance(side, (int, np.integer)) and not isinstance(side, bool) for side in (width, height)):
        raise InputError(f"the texture of {name} has the size {width!r} x {height!r}; give whole numbers")
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and int(width) * int(height) <= MAX_PIXELS):
        raise InputError(
            f"the texture of {name} is {width} x {height}; at most {MAX_SIDE} per side and {MAX_PIXELS} pixels"
            " are allowed"
        )


def as_values(name: str, texture: Texture, shape: tuple[int, ...]) -> Values:
    """Return a patch's texture as float64, 0 to 1.

    Raises:
        InputError: It is not an image, has floats outside 0 to 1, or does not have the shape.
    """
    given = _within(name, as_array(name, texture))
    check_shape(name, given.shape, shape, texture)
    values: Values = given.astype(np.float64)
    return values / 255.0 if given.dtype == np.uint8 else values


def as_gradient(name: str, gradient: object, shape: tuple[int, ...]) -> Values:
    """Return the gradient of a picture that shows a patch, float64 [H, W, 3].

    Values may be infinite or NaN: mixed-precision training detects these in the result.

    Args:
        name: The patch, for messages.
        gradient: An array [H, W, 3], or a tensor [3, H, W] or [1, 3, H, W].
        shape: Of the picture, [H, W, 3].

    Raises:
        InputError: It is not numeric, or does not have the shape of the picture.
    """
    what = f"the gradient of the picture that shows {name}"
    values = _channels_last(what, gradient)
    if values.shape != shape:
        raise InputError(
            f"{what} has the shape {_shape(gradient)}, but the picture has the shape {shape}; give an array [height,"
            " width, 3], or a tensor [3, height, width]"
        )
    if values.dtype.kind not in "fiu":
        raise InputError(f"{what} is of {values.dtype}; give floats")
    return values.astype(np.float64, copy=False)


def _channels_last(what: str, given: Any) -> NDArray[np.generic]:
    """Return an array as it is, and a tensor [3, h, w] or [1, 3, h, w] as an array [h, w, 3]; `what` is for messages.

    Raises:
        InputError: It is not an array.
    """
    if hasattr(given, "detach"):  # a tensor, channels first
        given = _of_tensor(what, given.detach().cpu())
        if given.ndim == 4 and given.shape[0] == 1:
            given = given[0]
        given = np.moveaxis(given, 0, -1) if given.ndim == 3 else given
    try:
        values: NDArray[np.generic] = np.asarray(given)
    except ValueError as error:  # lists of unequal lengths
        raise InputError(f"{what} is not an array: {error}") from None
    return values


def _shape(given: object) -> tuple[int, ...]:
    """Return the shape of an array or a tensor as its owner sees it."""
    shape = getattr(given, "shape", None)
    return np.asarray(given).shape if shape is None else tuple(shape)


def _of_tensor(what: str, tensor: Any) -> NDArray[np.generic]:
    """Return a tensor as an array; of types that NumPy lacks, such as bfloat16, as float32."""
    try:
        try:
            values: NDArray[np.generic] = tensor.numpy()
        except TypeError:
            values = tensor.float().numpy()
    except (TypeError, RuntimeError) as error:  # such as sparse tensors
        raise InputError(f"{what} is not an array: {error}") from None
    return values


def check_shape(name: str, given: tuple[int, ...], wanted: tuple[int, ...], texture: object = None) -> None:
    """Raise InputError if a texture, an array or the tensor `texture`, does not have the shape that a view is for."""
    if given != wanted:
        shape = given if texture is None else _shape(texture)
        raise InputError(
            f"the texture of {name} has the shape {shape}, but the view is of textures of the shape {wanted}: height,"
            " width and channels",
            help=f"make the view with patch_view(frame, {name!r}, size=({given[0]}, {given[1]}))",
        )


def _within(name: str, values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return a texture; raise InputError if it has floats outside 0 to 1."""
    if values.dtype != np.uint8 and (values.min() < 0.0 or values.max() > 1.0):
        raise InputError(
            f"the texture of {name} has values from {values.min():g} to {values.max():g}; float textures are from 0 to"
            " 1: divide 8-bit values by 255, and clip the result of a gradient step",
            code=Code.OUT_OF_RANGE,
        )
    return values
