"""Blueprints of a recipe: their files, and their shapes, which follow from the files.

A shape has the keys of the family's blueprints in the library, so that actors of both move alike. What the file does
not determine is that of the family's first blueprint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from recipe_compiler.ir.assets import AssetError, BodyData, rigs
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import ActorMesh, TexturePlan
from recipe_compiler.ir.plan_bounds import shape_of
from recipe_compiler.library import blueprints
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.lowering.asset_files import AssetFile, NamedFile, relative
from recipe_compiler.schema import scene
from recipe_compiler.source.merge import Sources
from recipe_compiler.source.yaml_reader import Value, printable, show

PREFIX = "blueprint:"  # keeps the names of files distinct from those of assets

# A person's proportions as shares of the height; `Figure` of the runtime has the same.
_ANKLE, _LEG, _NECK, _HEAD, _SHOULDER = 0.045, 0.475, 0.978, 0.142, 0.1
_GROWN = 1.55  # metres; shorter persons are children

Corner = tuple[float, float, float]


def files(root: Value, own: Mapping[str, scene.Blueprint], folder: Path, sources: Sources) -> dict[str, NamedFile]:
    """Return the files of a recipe's blueprints, for `asset_files.read`.

    Args:
        root: the recipe, for places.
        own: the blueprints by id.
        folder: the recipe's folder.
        sources: the files of the recipe.
    """
    names = {printable(str(folder / name)): name for name in sources.files}
    found = {}
    for key, blueprint in own.items():
        place = root.place_of("blueprints", key, "mesh")
        path = relative(names.get(place.file, ""), blueprint.mesh)
        asset = scene.Asset(mesh=blueprint.mesh, sha256=blueprint.sha256)
        pinned = root.place_of("blueprints", key, "sha256")
        found[PREFIX + key] = NamedFile(f"blueprints.{key}", asset, path, place, pinned, key, blueprint.scale)
    return found


def named(root: Value, folder: Path, sources: Sources) -> set[str]:
    """Return the paths of the files of a recipe's blueprints, relative to its folder, without reading them."""
    names = {printable(str(folder / name)): name for name in sources.files}
    own, found = root.get("blueprints"), set()
    for key, blueprint in (own.map if own else {}).items():
        given = blueprint.get("mesh")
        if given is not None and isinstance(given.data, str):
            found.add(relative(names.get(root.place_of("blueprints", key, "mesh").file, ""), given.data))
    return found


def clashes(root: Value, own: Mapping[str, scene.Blueprint]) -> list[Problem]:
    """Return a problem for each blueprint that has the id of one of the library."""
    known, section = {blueprint.id for blueprint in blueprints.LIBRARY}, root.get("blueprints")
    return [
        Problem(
            f"blueprints: the library has {show(key)} already", section.key_place(key), "rename it", Code.INVALID_NAME
        )
        for key in own
        if key in known and section is not None
    ]


def made(own: Mapping[str, scene.Blueprint], read: Mapping[str, AssetFile]) -> list[Blueprint]:
    """Return the blueprints whose files could be read, sorted by id."""
    return [_blueprint(key, own[key], read[PREFIX + key]) for key in sorted(own) if PREFIX + key in read]


def _blueprint(key: str, given: scene.Blueprint, file: AssetFile) -> Blueprint:
    alike = _alike(key)
    attributes = dict(alike.attributes)
    if alike.category == "pedestrian":
        attributes["generation"] = "child" if file.shape["height"] < _GROWN else "adult"
    return Blueprint(
        id=key,
        category=alike.category,
        tag=alike.tag,
        shape=dict(file.shape),
        palette={slot: (material.colour,) for slot, material in file.materials.items()},
        default_speed=alike.default_speed if given.speed is None else given.speed,
        attributes=attributes,
        mesh=ActorMesh(file=file.file, scale=given.scale, low=file.low, high=file.high),
        textures={
            slot: TexturePlan(file=file.file, number=material.picture, repeat=material.repeat)
            for slot, material in file.materials.items()
            if material.picture is not None
        },
    )


def measured(key: str, body: BodyData, scale: float) -> tuple[dict[str, float], Corner, Corner]:
    """Return the shape of a blueprint's body, and the lowest and highest corner of its body box, metres.

    Raises:
        AssetError: the file lacks something, or a measure is out of range.
    """
    alike, ranges = _alike(key), shape_of(key)
    if alike.category == "pedestrian":
        rig = rigs.person(body, scale)
        found, low, high = _person(rig), rig.low, rig.high
        firm: Sequence[str] = ("height",)
    else:
        car = rigs.vehicle(body, scale)
        low, high = car.low, car.high
        size = [b - a for a, b in zip(low, high, strict=True)]
        found = {"length": size[0], "width": size[1], "height": high[2]}
        found |= {"wheelbase": car.centres["wheel_front_left"][0] - car.centres["wheel_rear_left"][0]}
        found |= {"wheel": car.radius, "clearance": car.clearance}
        firm = ("length", "width", "height", "wheelbase", "wheel")
    for name, value in found.items():
        least, most = ranges[name]
        if name in firm and not least <= value <= most:
            what = "radius of the wheels" if name == "wheel" else name
            raise AssetError(f"its {what} is {value:.4g} m; {key} may have {least:g} to {most:g} m; set `scale`")
        found[name] = min(max(round(value, 6), least), most)
    return {**alike.shape, **found}, low, high


def _person(rig: rigs.Person) -> dict[str, float]:
    """Return the proportions of a person, as keys of a shape."""
    height, joints = rig.height, rig.joints
    hip = (joints["LeftUpLeg"][2] + joints["RightUpLeg"][2]) / 2.0
    wide = joints["LeftArm"][1] - joints["RightArm"][1]
    return {
        "height": height,
        "limb": (hip / height - _ANKLE) / _LEG,
        "head": (_NECK - joints["Neck"][2] / height) / _HEAD,
        "shoulder": wide / 2.0 / (_SHOULDER * height),
    }


def _alike(key: str) -> Blueprint:
    """Return the first blueprint of the library in the family of an id."""
    return blueprints.match(key.rpartition(".")[0] + ".*")[0]
