"""The attributes of CARLA's cameras and the parameters of a recipe's camera that they become."""

from __future__ import annotations

from dataclasses import dataclass, field

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
_OWN = {*GEOMETRY, "near", "far", "noise", "vignette_intensity", "antialias", "supersample"}
RESPONSE = tuple(name for name in Camera.model_fields if name not in _OWN)
DEFAULTS: dict[str, Data] = {"width": 800, "height": 600, "fov": 90.0, "gamma": 2.2}
_UNSUPPORTED = {
    "lens_flare_intensity": "no lens flares",
    "lens_x_size": "distortion is measured in half widths of the picture",
    "lens_y_size": "distortion is measured in half widths of the picture",
    **dict.fromkeys(("min_fstop", "blade_count", "focal_distance", "blur_amount", "blur_radius"), "no depth of field"),
    **dict.fromkeys(("slope", "toe", "shoulder", "black_clip", "white_clip"), "no film curve"),
    **dict.fromkeys(
        (
            "exposure_min_bright",
            "exposure_max_bright",
            "exposure_speed_up",
            "exposure_speed_down",
            "calibration_constant",
        ),
        "automatic exposure has no history",
    ),
    "motion_blur_min_object_screen_size": "every moving object is blurred",
    "post_process_profile": "the look of the camera is the renderer's own",
}
_OF_SPECS = {"role_name", "sensor_tick"}  # read elsewhere
_AGAIN = "the collector skips attributes that the blueprint lacks"


@dataclass
class Attributes:
    """The attributes of one camera of CARLA's.

    Args:
        geometry: parameters that decide what each pixel shows.
        response: parameters of the RGB picture.
        nodes: by parameter, the value that sets it.
    """

    geometry: dict[str, Data] = field(default_factory=dict)
    response: dict[str, Data] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict)


def read(reader: Reader, given: dict[str, Node], *, rgb: bool) -> Attributes:
    """Read the attributes of a camera; notes those that are ignored.

    Args:
        reader: collects problems.
        given: the values by attribute.
        rgb: whether it is, or has, an RGB camera: the attributes of others only set the geometry.
    """
    found = Attributes()
    for name, node in given.items():
        parameter = _SIZES.get(name, name)
        if name in _OF_SPECS or node.value.data is None:
            continue
        if parameter not in (*GEOMETRY, *RESPONSE) or name in ("width", "height"):
            why = _UNSUPPORTED.get(name)
            reader.ledger.ignored(node, f"not supported here: {why}" if why else f"no attribute of a camera; {_AGAIN}")
        elif parameter in RESPONSE and not rgb:
            reader.ledger.ignored(node, f"not an attribute of this camera, which takes no colours; {_AGAIN}")
        else:
            value = _value(reader, node, parameter)
            if value is not None:
                (found.geometry if parameter in GEOMETRY else found.response)[parameter] = value
                found.nodes[parameter] = node
    return found


def note(reader: Reader, attributes: Attributes, to: str) -> None:
    """Note where the attributes of a camera went; `to` is the path of the camera in the recipe."""
    values = {**attributes.geometry, **attributes.response}
    for parameter, node in attributes.nodes.items():
        data = node.value.data
        is_same = str(data).lower() == str(values[parameter]).lower() or reader_number(data) == values[parameter]
        if is_same:
            reader.ledger.kept(node, f"{to}.{parameter}")
        else:
            why = "automatic exposure here follows from the scene, not from earlier pictures"
            reader.ledger.mapped(node, f"{to}.{parameter}", values[parameter], why)


def reader_number(data: object) -> float | None:
    """A scalar as a number; None if it is not a number."""
    try:
        return float(str(data))
    except ValueError:
        return None


def _value(reader: Reader, node: Node, parameter: str) -> Data | None:
    """The value of a parameter; None, with a problem or a note, if it has none here."""
    kind = Camera.model_fields[parameter].annotation
    value: Data | None
    if parameter == "exposure_mode":
        mode = reader.text(node)
        value = None if mode is None else "manual" if mode == "manual" else "auto"
    elif kind is bool:
        value = reader.truth(node)
    elif kind is int:
        value = reader.whole(node, 0, 1_000_000)
    else:
        value = reader.number(node)
    if value is None:
        return None
    try:
        Camera.model_validate({parameter: value})
    except ValidationError as error:
        wrong = error.errors()[0]["msg"]
        if parameter in _LENS:
            reader.ledger.ignored(node, f"no camera here has this lens: {wrong}")
        else:
            message = f"{show(node.value.plain)}: {wrong[:1].lower()}{wrong[1:]}"
            reader.refuse(node, message, "write a value that cameras here can have", Code.OUT_OF_RANGE)
        return None
    return value
