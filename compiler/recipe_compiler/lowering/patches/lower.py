"""Lowers patches: resolves surface, position and texture of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.patches import GREEN, INSERTED, PatchFace, PatchPlan, PatchTexture
from recipe_compiler.ir.plan import Element, ScenePlan, TownPlan
from recipe_compiler.ir.plan_types import MAX_PROPS
from recipe_compiler.ir.plurals import count
from recipe_compiler.library import surfaces
from recipe_compiler.library.surfaces import FlatSurface, Surface
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering import props
from recipe_compiler.lowering.asset_files import AssetFile, other_file
from recipe_compiler.lowering.patches.texture_files import Key, texture_key
from recipe_compiler.schema.messages import nearest
from recipe_compiler.schema.patches import Carrier, Patch
from recipe_compiler.source.yaml_reader import Value, show

BOARD_PREFIX = "patch."  # keeps the names of boards distinct from those of props, actors and town elements


@dataclass
class LoweredPatches:
    """The lowered patches of a variant, in file order, and problems."""

    plans: tuple[PatchPlan, ...] = ()
    problems: list[Problem] = field(default_factory=list)


def board_key(patches: Mapping[str, Patch]) -> tuple[tuple[str, str], ...]:
    """Return the part of patches that belongs to the scene: names, poses and sizes of free-standing boards."""
    return tuple((name, patch.on.model_dump_json()) for name, patch in patches.items() if patch.on.board is not None)


def add_boards(stage: props.LoweredProps, patches: Mapping[str, Patch], base: Value, town: Town) -> None:
    """Add the free-standing boards of patches to the props of a scene."""
    for name, patch in patches.items():
        if patch.on.board is None or patch.on.size is None:
            continue
        if len(stage.plans) >= MAX_PROPS:
            message, place = f"patches.{name}: the scene has {MAX_PROPS} props already", base.place_of("patches", name)
            stage.problems.append(Problem(message, place, "remove a prop", Code.INPUT_LIMIT))
            return
        board = props.board(BOARD_PREFIX + name, patch.on.size, patch.on.board, town)
        stage.plans += (board,)
        stage.looks[board.name] = dict(props.BOARD_LOOK)


def patchable(town: TownPlan) -> dict[str, Element]:
    """Return the elements of a town that have a surface, by name."""
    return {e.name: e for e in town.elements if next(surfaces.element_surfaces(e), None) is not None}


class _Carriers:
    """The bodies of a scene that patches can be on, by kind and by their names in a recipe."""

    def __init__(self, scene: ScenePlan, elements: Mapping[str, Element]) -> None:
        self.scene, self._elements = scene, elements
        self._actors = {actor.name: actor for actor in scene.actors}
        own = (prop for prop in scene.props if prop.name.startswith(props.PREFIX))
        self._props = {prop.name.removeprefix(props.PREFIX): prop for prop in own}

    def names(self, key: str) -> list[str]:
        """Return the names of all bodies of a kind: `town`, `actor` or `prop`."""
        return list({"town": self._elements, "actor": self._actors, "prop": self._props}[key])

    def surfaces(self, key: str, name: str) -> list[Surface]:
        """Return the surfaces of a body; none if there is no body of that kind and name."""
        if key == "town":
            return list(surfaces.element_surfaces(self._elements[name])) if name in self._elements else []
        if key == "actor":
            return list(surfaces.actor_surfaces(self._actors[name])) if name in self._actors else []
        return list(surfaces.prop_surfaces(self._props[name])) if name in self._props else []


def lower(
    patches: Mapping[str, Patch],
    textures: Mapping[Key, Sequence[AssetFile]],
    base: Value,
    scene: ScenePlan,
    elements: Mapping[str, Element],
) -> LoweredPatches:
    """Lower all patches, in file order.

    Args:
        patches: the patches by name.
        textures: the validated files of textures.
        base: the variant's base, for the places of problems.
        scene: the scene, with the boards.
        elements: the elements of its town that have a surface, as `patchable` returns them.
    """
    lowered, carriers = LoweredPatches(), _Carriers(scene, elements)
    for name, patch in patches.items():
        surface = _surface(name, patch.on, base, carriers, lowered.problems)
        texture = _texture(name, patch, textures, base, scene.clock.frames, lowered.problems)
        faces = None if surface is None else _faces(name, patch, surface, base, lowered.problems)
        if surface is None or faces is None or texture is None:
            continue
        plan = PatchPlan(
            name=name,
            body=surface.body,
            slots=surface.slots,
            faces=faces,
            whole=not isinstance(surface, FlatSurface),
            mode=patch.mode,
            transfer=patch.color_transfer.method if patch.mode == "color_transfer" else None,
            texture=texture,
            gloss=patch.gloss,
            emission=patch.emission,
        )
        lowered.plans += (plan,)
    return lowered


def _surface(name: str, on: Carrier, base: Value, carriers: _Carriers, problems: list[Problem]) -> Surface | None:
    """Return the surface that a patch is on; None, with a problem, if there is no surface of that name."""
    if on.board is not None:
        board = next(prop for prop in carriers.scene.props if prop.name == BOARD_PREFIX + name)
        return next(iter(surfaces.prop_surfaces(board)))
    key, given = next((key, value) for key in ("town", "actor", "prop") if (value := getattr(on, key)) is not None)
    place = base.place_of("patches", name, "on", key)
    candidates = carriers.surfaces(key, given)
    if not candidates:
        what = {"town": "an element of the town with a surface", "actor": "an actor", "prop": "a prop"}[key]
        message = f"patches.{name}.on.{key}: {show(given)} is not {what}"
        problems.append(Problem(message, place, nearest(given, carriers.names(key)), Code.UNKNOWN_NAME))
        return None
    if on.surface is None:
        return candidates[0]
    found = next((surface for surface in candidates if surface.name == on.surface), None)
    if found is None:
        message = f"patches.{name}.on.surface: {given} has no surface {show(on.surface)}"
        remedy = nearest(on.surface, [surface.name for surface in candidates])
        problems.append(Problem(message, base.place_of("patches", name, "on", "surface"), remedy, Code.UNKNOWN_NAME))
    return found


def _faces(
    name: str, patch: Patch, surface: Surface, base: Value, problems: list[Problem]
) -> tuple[PatchFace, ...] | None:
    """Return the faces of a patch on its surface; None, with a problem, if it does not fit."""
    on, where = patch.on, f"patches.{name}.on"
    if not isinstance(surface, FlatSurface):
        if patch.mode in INSERTED:
            message = f"patches.{name}.mode: {patch.mode} needs a rectangle; {surface.name} is a texture map"
            remedy = "name another surface, or write mode: rendered"
            place = base.place_of("patches", name, "mode")
            problems.append(Problem(message, place, remedy, Code.CONFLICT))
            return None
        wrong = [key for key in ("at", "size") if base.get("patches", name, "on", key) is not None]
        for key in wrong:
            message = f"{where}.{key}: the surface {surface.name} is a texture map, which covers the entire body"
            remedy = "remove it, or name another surface"
            problems.append(Problem(message, base.place_of("patches", name, "on", key), remedy, Code.CONFLICT))
        return None if wrong else tuple(face for _, face in surface.islands)
    largest = "{:.4g} x {:.4g} m".format(*surface.size)
    if on.size is None:
        message = f"{where}: a patch on the surface {surface.name} needs a size"
        remedy = f"add size: {{width: ..., height: ...}}, at most {largest}"
        problems.append(Problem(message, base.place_of("patches", name, "on"), remedy, Code.MISSING_KEY))
        return None
    middle = surface.middle
    x, z = (middle[0] if on.at.x is None else on.at.x), (middle[1] if on.at.z is None else on.at.z)
    wide, high = surface.room(x, z)
    title = f"the {surface.name} of {surface.body}"
    if wide <= 0 or high <= 0:
        limits = (
            f"x from {surface.x[0]:.4g} to {surface.x[1]:.4g} and z from {surface.z[0]:.4g} to {surface.z[1]:.4g} m"
        )
        message = f"{where}.at: x = {x:g}, z = {z:g} m is not on {title}, which has {limits}"
        remedy = f"write at: {{x: {middle[0]:.4g}, z: {middle[1]:.4g}}} for its middle"
        problems.append(Problem(message, base.place_of("patches", name, "on", "at"), remedy, Code.OUT_OF_RANGE))
        return None
    if on.size.width > wide + 1e-9 or on.size.height > high + 1e-9:
        message = f"{where}.size: {on.size.width:g} x {on.size.height:g} m does not fit {title}"
        remedy = f"write at most {wide:.4g} x {high:.4g} m at x = {x:.4g}, z = {z:.4g}, or {largest} in the middle"
        problems.append(Problem(message, base.place_of("patches", name, "on", "size"), remedy, Code.OUT_OF_RANGE))
        return None
    return (surface.face(x, z, on.size.width, on.size.height),)


def _texture(
    name: str,
    patch: Patch,
    textures: Mapping[Key, Sequence[AssetFile]],
    base: Value,
    frames: int,
    problems: list[Problem],
) -> PatchTexture | None:
    """Return the texture of a patch; None, with a problem, if its sequence is too short."""
    texture = patch.texture
    if texture is None:
        return PatchTexture(colour=GREEN)
    if texture.color is not None:
        return PatchTexture(colour=texture.color.lower())
    kind = "image" if texture.image is not None else "frames"
    value = base.get("patches", name, "texture", kind)
    assert value is not None
    files = [one.file for one in textures[texture_key(value.place, str(value.data), kind)]]
    if kind == "image" and texture.sha256 not in (None, files[0].sha256):
        place = base.place_of("patches", name, "texture", "sha256")
        problems.append(other_file(f"patches.{name}.texture.image", str(value.data), files[0].sha256, place))
        return None
    if kind == "image":
        return PatchTexture(image=files[0])
    if len(files) < frames:
        numbers = f"{count(len(files), 'image')} for {count(frames, 'frame')}"
        message = f"patches.{name}.texture.frames: {show(value.plain)} has {numbers}"
        remedy = f"add images, one for each frame, or lower clock.frames to {len(files)}"
        problems.append(Problem(message, value.place, remedy, Code.OUT_OF_RANGE))
        return None
    return PatchTexture(frames=tuple(files[:frames]))
