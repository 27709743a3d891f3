"""Lowers props to static bodies with colours and textures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import Pose, PropPlan, TexturePlan
from recipe_compiler.ir.plan_bounds import MAX_PROP_TRIANGLES
from recipe_compiler.ir.semantic_tags import TAG_OF_LABEL
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering.asset_files import AssetFile
from recipe_compiler.schema.messages import nearest
from recipe_compiler.schema.scene import Board, Prop, Standing
from recipe_compiler.source.yaml_reader import Value, show

PREFIX = "prop."  # keeps the names of props distinct from those of actors and town elements
BOARD_THICKNESS = 0.02  # metres
BOARD_LOOK: Mapping[str, str] = {"face": "#909090", "back": "#b8b0a0"}
_WHITE = "#ffffff"
_SIZES = (0.001, 1000.0)  # limits of a prop's largest extent, metres

Corner = tuple[float, float, float]


@dataclass
class LoweredProps:
    """The lowered props of a scene: plans, colours and textures by body and slot, and problems."""

    plans: tuple[PropPlan, ...] = ()
    looks: dict[str, dict[str, str]] = field(default_factory=dict)
    textures: dict[str, dict[str, TexturePlan]] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


def lower(props: Mapping[str, Prop], assets: Mapping[str, AssetFile], base: Value, town: Town) -> LoweredProps:
    """Lower all props, in file order.

    Args:
        props: the props by name.
        assets: the assets by name.
        base: the variant's base, for the places of problems.
        town: the town, for the height of the ground.
    """
    lowered, triangles = LoweredProps(), 0
    for name, prop in props.items():
        mesh = assets[prop.asset] if prop.asset is not None else None
        triangles += mesh.triangles if mesh else 0
        if triangles > MAX_PROP_TRIANGLES:
            message = f"props: {triangles} triangles in total up to here exceed the limit of {MAX_PROP_TRIANGLES}"
            remedy, place = "use fewer or simpler meshes", base.place_of("props", name)
            lowered.problems.append(Problem(message, place, remedy, Code.INPUT_LIMIT))
            break
        wrong = [*_wrong_size(name, prop, mesh, base), *_wrong_slots(name, prop, mesh, base)]
        lowered.problems += wrong
        if not wrong:
            lowered.plans += (_plan(name, prop, mesh, town),)
            lowered.looks[PREFIX + name] = _look(prop, mesh)
            textures = _textures(prop, mesh, assets)
            if textures:
                lowered.textures[PREFIX + name] = textures
    return lowered


def board(name: str, size: Board, at: Standing, town: Town) -> PropPlan:
    """A flat board of this name, which is not a prop of the recipe."""
    return _plan(name, Prop(size=size, at=at), None, town).model_copy(update={"name": name})


def _plan(name: str, prop: Prop, mesh: AssetFile | None, town: Town) -> PropPlan:
    low, high = _box(prop, mesh)
    at = prop.at
    z = town.ground(at.x, at.y) - _lowest(low, high, at.pitch, at.roll) if at.z is None else at.z
    return PropPlan(
        name=PREFIX + name,
        mesh=mesh.file if mesh else None,
        up="y" if mesh and mesh.up == "y" else "z",
        scale=prop.scale if mesh else 1.0,
        pose=Pose(x=at.x, y=at.y, z=z, yaw=at.yaw, pitch=at.pitch, roll=at.roll),
        tag=TAG_OF_LABEL[prop.tag].value,
        low=low,
        high=high,
    )


def _box(prop: Prop, mesh: AssetFile | None) -> tuple[Corner, Corner]:
    """Return the bounding box of a prop in its own frame, metres: minimum and maximum corner."""
    if mesh is None:
        assert prop.size is not None
        half, depth = prop.size.width / 2, BOARD_THICKNESS / 2
        return (-depth, -half, 0.0), (depth, half, prop.size.height)
    s = prop.scale
    return (mesh.low[0] * s, mesh.low[1] * s, mesh.low[2] * s), (mesh.high[0] * s, mesh.high[1] * s, mesh.high[2] * s)


def _lowest(low: Corner, high: Corner, pitch: float, roll: float) -> float:
    """Return the height of a tilted box's lowest corner relative to its origin, metres.

    Args:
        low: the minimum corner of the box, metres.
        high: the maximum corner.
        pitch: degrees.
        roll: degrees.
    """
    sp, cp = exact.sin_cos_deg(pitch)
    sr, cr = exact.sin_cos_deg(roll)
    corners = itertools.product(*zip(low, high, strict=True))
    return min(-sp * x + cp * sr * y + cp * cr * z for x, y, z in corners)


def _look(prop: Prop, mesh: AssetFile | None) -> dict[str, str]:
    own = {slot: material.colour for slot, material in mesh.materials.items()} if mesh else dict(BOARD_LOOK)
    if prop.image is not None:  # white leaves the colours of the image unchanged, unless `look` overrides it
        own |= dict.fromkeys(_imaged(mesh), _WHITE)
    own |= {slot: colour.lower() for slot, colour in prop.look.items()}
    return dict(sorted(own.items()))


def _textures(prop: Prop, mesh: AssetFile | None, assets: Mapping[str, AssetFile]) -> dict[str, TexturePlan]:
    if prop.image is not None:
        texture = TexturePlan(file=assets[prop.image].file, repeat=mesh is not None)
        return dict.fromkeys(sorted(_imaged(mesh)), texture)
    return {
        slot: TexturePlan(file=mesh.file, number=material.picture, repeat=material.repeat)
        for slot, material in sorted(mesh.materials.items() if mesh else ())
        if mesh is not None and material.picture is not None
    }


def _imaged(mesh: AssetFile | None) -> list[str]:
    """Return the slots that the prop's image is applied to."""
    return ["face"] if mesh is None else [slot for slot, material in mesh.materials.items() if material.mapped]


def _wrong_size(name: str, prop: Prop, mesh: AssetFile | None, base: Value) -> Iterator[Problem]:
    low, high = _box(prop, mesh)
    largest = max(b - a for a, b in zip(low, high, strict=True))
    if not _SIZES[0] <= largest <= _SIZES[1]:
        message = f"props.{name}: its largest extent is {largest:.4g} m, not {_SIZES[0]:g} to {_SIZES[1]:g} m"
        yield Problem(message, base.place_of("props", name, "scale"), "set `scale`", Code.OUT_OF_RANGE)
    elif max(abs(v) for v in (*low, *high)) > 10 * _SIZES[1]:
        message = f"props.{name}: extends {max(map(abs, (*low, *high))):.3g} m from its origin"
        yield Problem(message, base.place_of("props", name, "asset"), "centre it in its file", Code.INVALID_ASSET)


def _wrong_slots(name: str, prop: Prop, mesh: AssetFile | None, base: Value) -> Iterator[Problem]:
    slots = list(mesh.materials) if mesh else list(BOARD_LOOK)
    parent = base.get("props", name, "look")
    for slot in prop.look:
        if slot not in slots and parent:
            message = f"props.{name}.look: {prop.asset or 'a board'} has no {show(slot)}"
            yield Problem(message, parent.key_place(slot), nearest(slot, slots), Code.UNKNOWN_NAME)
    if prop.image is not None and not _imaged(mesh):
        message = f"props.{name}.image: the mesh {show(prop.asset)} has no texture coordinates"
        remedy = "export it with texture coordinates"
        yield Problem(message, base.place_of("props", name, "image"), remedy, Code.INVALID_ASSET)
