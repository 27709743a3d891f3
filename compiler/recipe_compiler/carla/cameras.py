"""Conversion of the attributes of CARLA's cameras to the parameters of a recipe's camera."""

from __future__ import annotations

from typing import TypeAlias

from pydantic import ValidationError

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.draft import Data
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code
from recipe_compiler.schema.camera import Camera
from recipe_compiler.source.yaml_reader import show

_SIZES = {"image_size_x": "width", "image_size_y": "height"}
_LENS = ("lens_k", "lens_kcube")
GEOMETRY = ("width", "height", "fov", *_LENS)
_NOT_RESPONSE = {*GEOMETRY, "near", "far", "noise", "vignette_intensity", "sensor", "antialias", "supersample"}
RESPONSE = tuple(name for name in Camera.model_fields if name not in _NOT_RESPONSE)
DEFAULTS: dict[str, Data] = {"width": 800, "height": 600, "fov": 90.0, "gamma": 2.2}
_NO_ADAPTATION = "automatic exposure does not depend on earlier pictures"
_UNSUPPORTED = {
    "lens_flare_intensity": "no lens flares",
    "lens_x_size": "the unit of distortion is half the picture's width",
    "lens_y_size": "the unit of distortion is half the picture's width",
    **dict.fromkeys(("min_fstop", "blade_count", "focal_distance", "blur_amount", "blur_radius"), "no depth of field"),
    **dict.fromkeys(("slope", "toe", "shoulder", "black_clip", "white_clip"), "no film curve"),
    **dict.fromkeys(("exposure_min_bright", "exposure_max_bright"), _NO_ADAPTATION),
    **dict.fromkeys(("exposure_speed_up", "exposure_speed_down", "calibration_constant"), _NO_ADAPTATION),
    "motion_blur_min_object_screen_size": "every moving object is blurred",
    "post_process_profile": "the renderer has one camera model",
}
_LENS_UNIT = "the unit of radii is half the picture's width, whatever CARLA's lens_x_size and lens_y_size are"
_OTHER_UNITS = {
    "motion_blur_intensity": "a share of the time that the shutter is open, in CARLA of the time of a frame",
    **dict.fromkeys(_LENS, _LENS_UNIT),
}
_READ_ELSEWHERE = {"role_name", "sensor_tick"}
_SKIPPED = "the collector skips attributes that the blueprint lacks"


Attributes: TypeAlias = "dict[str, tuple[Data, Node]]"
"""The parameters of one camera: the value in the recipe, and the one in the configuration, by name."""


def read(reader: Reader, given: dict[str, Node], *, rgb: bool) -> Attributes:
    """Read the attributes of a camera, and record those that are ignored.

    Args:
        reader: collects problems and outcomes.
        given: the values by attribute.
        rgb: whether the camera takes RGB pictures; of other cameras only the geometry is read.
    """
    found: Attributes = {}
    for name, node in given.items():
        parameter = _SIZES.get(name, name)
        if name in _READ_ELSEWHERE or node.value.data is None:
            continue
        if name in _UNSUPPORTED:
            reader.ledger.ignored(node, f"not supported here: {_UNSUPPORTED[name]}")
        elif parameter not in (*GEOMETRY, *RESPONSE) or name in ("width", "height"):
            reader.ledger.ignored(node, f"not an attribute of cameras; {_SKIPPED}")
        elif parameter in RESPONSE and not rgb:
            reader.ledger.ignored(node, f"not an attribute of this camera, which has no RGB picture; {_SKIPPED}")
        elif (value := _value(reader, node, parameter)) is not None:
            found[parameter] = value, node
    return found


def note(reader: Reader, attributes: Attributes, to: str) -> None:
    """Record the outcome of the attributes of a camera; `to` is the path of the camera in the recipe."""
    for parameter, (value, node) in attributes.items():
        data = node.value.data
        why = _OTHER_UNITS.get(parameter, "") if value else ""
        if str(data).lower() != str(value).lower() and _as_number(data) != value:
            why = why or "automatic exposure depends on the scene, not on earlier pictures"
        reader.ledger.record(node, f"{to}.{parameter}", value, why)


def _as_number(data: object) -> float | None:
    """Return a scalar as a number; None if it is not a number."""
    try:
        return float(str(data))
    except ValueError:
        return None


def _value(reader: Reader, node: Node, parameter: str) -> Data | None:
    """Return the value of a parameter; None, with a problem or an outcome, if a recipe cannot have it."""
    kind = Camera.model_fields[parameter].annotation
    value: Data | None
    if parameter == "exposure_mode":
        mode = reader.text(node)
        value = mode and ("manual" if mode == "manual" else "auto")
    elif kind is bool:
        value = reader.boolean(node)
    elif kind is int:
        value = reader.integer(node, 0, 1_000_000)
    else:
        value = reader.number(node)
    if value is None:
        return None
    try:
        Camera.model_validate({parameter: value})
    except ValidationError as error:
        wrong = error.errors()[0]["msg"]
        if parameter in _LENS:
            reader.ledger.ignored(node, f"this lens is not supported: {wrong}")
        else:
            message = f"{show(node.value.plain)}: {wrong[:1].lower()}{wrong[1:]}"
            reader.reject(node, message, "write a value that a recipe's camera may have", Code.OUT_OF_RANGE)
        return None
    return value
