"""`recipe surfaces`: lists the surfaces for patches as a table, as JSON and in pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count

from recipe_cli import completion
from recipe_cli.arguments import ALLOW_LARGE, JSON, REPLACE, VARIANT, LocalPath, compile_quietly, writing
from recipe_cli.console import print_json, say, say_table
from recipe_cli.places import used_files
from recipe_cli.texture_painting import Painter, painter

if TYPE_CHECKING:
    from recipe_compiler.ir.patches import PatchFace, PatchPlan
    from recipe_compiler.ir.plan import ActorPlan, Looks, ScenePlan
    from recipe_compiler.library.surfaces import Surface, WholeSurface

    from recipe_cli.progress import Progress

_PICTURES_PER_SHEET = 48


@dataclass(frozen=True)
class _Body:
    """A body that a recipe can name in a patch's `on`, and its surfaces."""

    key: str  # town, actor or prop
    name: str
    surfaces: tuple[Surface, ...]
    actor: ActorPlan | None = None


@dataclass(frozen=True)
class _Scene:
    """A scene to draw, its colours, the files of its props, and all files of its recipe."""

    plan: ScenePlan
    looks: Looks
    places: Mapping[str, Path] = field(default_factory=dict)
    used: Sequence[Path] = ()


@click.command("surfaces")
@click.argument("where", metavar="TOWN|BLUEPRINT|RECIPE", shell_complete=completion.surface_owner)
@click.argument("pattern", default="*")
@VARIANT
@click.option(
    "-o",
    "--output",
    "--out",
    "output",
    metavar="FOLDER",
    type=LocalPath(path_type=Path, file_okay=False),
    help="Also write pictures into FOLDER: of flat surfaces on sheets, and each texture map as a PNG to paint on.",
)
@click.option(
    "--paint",
    metavar="PNG",
    type=LocalPath(path_type=Path, dir_okay=False),
    help="Paint the texture maps with this image: repeated from all sides, or with --model as on that model.",
)
@click.option(
    "--metres",
    type=click.FloatRange(0.01, 100),
    default=1.0,
    show_default=True,
    help="Width of the repeated image on the body.",
)
@click.option(
    "--model",
    metavar="MESH",
    type=LocalPath(path_type=Path, dir_okay=False),
    help="The .obj, .glb or .gltf model, with texture coordinates, that the image of --paint was made for.",
)
@click.option("--up", type=click.Choice(["y", "z"]), default="z", show_default=True, help="The model's upward axis.")
@click.option(
    "--turn",
    type=click.Choice(["0", "90", "180", "270"]),
    default="0",
    show_default=True,
    help="Degrees by which the model is turned to the left, so that its front is ahead.",
)
@REPLACE
@ALLOW_LARGE
@JSON
def command(
    where: str,
    pattern: str,
    variant: str | None,
    output: Path | None,
    paint: Path | None,
    metres: float,
    model: Path | None,
    up: str,
    turn: str,
    replace: bool,
    allow_large: bool,
    as_json: bool,
) -> None:
    """List the surfaces of a town, of a blueprint or of a recipe's scene to which patches can be applied.

    PATTERN is a glob of names, such as `wall.*`; by default all are listed. `body` and `shirt` are texture maps, which
    cover the entire body or shirt; a patch on another surface is a rectangle, at most of the listed size. The yaw that
    a surface faces is counter-clockwise from +x.

    --paint writes texture maps with a texture that was made for another model: an image that is repeated over the body
    (as DTA and ACTIVE do), or one for the texture coordinates of --model (as RAUCA and CARLA have them).
    """
    if paint is not None and output is None:
        raise click.UsageError(f"--paint {paint} writes pictures: add --output FOLDER")
    painted = painter(paint, metres, model, up, int(turn))
    scene, bodies = _found(where, variant, allow_large)
    bodies = [body for body in bodies if fnmatchcase(body.name, pattern)]
    _check_some(where, pattern, bodies)
    if not as_json:
        _print_table(bodies)
    if output is not None:
        _draw(scene, bodies, output, painted, replace)
    if as_json:
        print_json([_row(body, surface) for body in bodies for surface in body.surfaces])


def _found(where: str, variant: str | None, allow_large: bool) -> tuple[_Scene | None, list[_Body]]:
    """Return the scene of a recipe or a town, and its bodies; of blueprints, only bodies."""
    from recipe_compiler.checks.references import blueprint_remedy
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.ir.plan import Clock, Looks, ScenePlan
    from recipe_compiler.library import blueprints, surfaces, towns
    from recipe_compiler.schema.messages import nearest

    if Path(where).exists() or Path(where).suffix in completion.SUFFIXES:
        compiled = compile_quietly(Path(where), allow_large=allow_large)
        plan, used = compiled.plan.named(variant), used_files(Path(where), compiled)
        scene = _Scene(plan.scene, plan.appearance.looks, compiled.places, used)
        return scene, list(_of_scene(plan.scene))
    if where in towns.NAMES:
        town = towns.build(where, 0, {})
        empty = ScenePlan(clock=Clock(fps=10, frames=1, physics=240), town=town.plan, actors=())
        return _Scene(empty, Looks.model_construct(root=town.looks)), list(_of_scene(empty))
    specimens = [blueprints.specimen(blueprint)[0] for blueprint in blueprints.match(where)]
    if not specimens:
        remedy, family = nearest(where, [*towns.NAMES, *blueprints.names()]), blueprint_remedy(where)
        if family.startswith("did you mean") and not remedy.startswith("did you mean"):
            remedy = family
        raise InputError(f"{where}: there is no such recipe, town or blueprint", help=remedy, code=Code.UNKNOWN_NAME)
    return None, [_Body("actor", a.name, tuple(surfaces.actor_surfaces(a)), a) for a in specimens]


def _of_scene(scene: ScenePlan) -> Iterator[_Body]:
    from recipe_compiler.library import surfaces
    from recipe_compiler.lowering.props import PREFIX

    for actor in scene.actors:
        yield _Body("actor", actor.name, tuple(surfaces.actor_surfaces(actor)), actor)
    for prop in scene.props:
        if prop.name.startswith(PREFIX):
            yield _Body("prop", prop.name.removeprefix(PREFIX), tuple(surfaces.prop_surfaces(prop)))
    for element in scene.town.elements:
        if element.kind in surfaces.KINDS:
            yield _Body("town", element.name, tuple(surfaces.element_surfaces(element)))


def _check_some(where: str, pattern: str, bodies: list[_Body]) -> None:
    from recipe_compiler.ir.errors import Code, InputError

    if not bodies:
        message = f"{where}: no body with a surface matches {pattern!r}"
        raise InputError(message, help="omit the pattern to list all", code=Code.UNKNOWN_NAME)


def _row(body: _Body, surface: Surface) -> dict[str, object]:
    from recipe_compiler.library.surfaces import FlatSurface

    row: dict[str, object] = {"on": body.key, "name": body.name, "surface": surface.name}
    if not isinstance(surface, FlatSurface):
        islands = [{"name": name, "region": face.region} for name, face in surface.islands]
        return {**row, "whole": True, "aspect": round(surface.aspect, 6), "islands": islands}
    face = _face(surface)
    middle = [round(sum(corner[axis] for corner in face.corners) / 4, 3) for axis in range(3)]
    return {
        **row,
        "whole": False,
        "size": [_inward(v) for v in surface.size],
        "x": _inside(surface.x),
        "z": _inside(surface.z),
        "part": surface.part,
        "middle": middle,
        "normal": [round(v, 6) for v in face.normal],
    }


def _print_table(bodies: list[_Body]) -> None:
    from recipe_compiler.ir.exact import atan2_deg
    from recipe_compiler.library.surfaces import FlatSurface

    rows: list[tuple[str, ...]] = [("on", "name", "surface", "size, m", "x, m", "z, m", "place")]
    for body in bodies:
        for surface in body.surfaces:
            head = body.key, body.name, surface.name
            if not isinstance(surface, FlatSurface):
                rows.append((*head, "whole", "-", "-", f"texture map, {surface.aspect:.3f} : 1"))
                continue
            face = _face(surface)
            x, y = (round(sum(corner[axis] for corner in face.corners) / 4, 1) + 0.0 for axis in range(2))
            place = f"on the part {surface.part}"
            if surface.part == "static":
                yaw = round(atan2_deg(face.normal[1], face.normal[0])) % 360
                turned = "upward" if face.normal[2] > 0.7 else f"facing yaw {yaw} degrees"
                place = f"at x {x:.1f}, y {y:.1f}, {turned}"
            ranges = ("{:.3f} to {:.3f}".format(*_inside(limits)) for limits in (surface.x, surface.z))
            rows.append((*head, "{:.3f} x {:.3f}".format(*map(_inward, surface.size)), *ranges, place))
    say_table(rows)


def _inside(limits: tuple[float, float]) -> list[float]:
    """Return a range in whole millimetres that is within a range in metres."""
    return [0.0 - _inward(-limits[0]), _inward(limits[1])]


def _inward(value: float) -> float:
    """Return metres, rounded down to whole millimetres, so that a patch of a listed size fits."""
    return math.floor(value * 1000 + 1e-6) / 1000 + 0.0


def _face(surface: object) -> PatchFace:
    from recipe_compiler.library.surfaces import FlatSurface

    assert isinstance(surface, FlatSurface)
    return surface.face(*surface.middle, *surface.size)


def _draw(scene: _Scene | None, bodies: list[_Body], folder: Path, painted: Painter | None, replace: bool) -> None:
    from recipe_runtime.core.outputs import check_not_input, check_output, write_output
    from recipe_runtime.meshes.actors import actor_body
    from recipe_runtime.report.texture_maps import texture_map

    from recipe_cli.progress import Progress

    mapped = _texture_maps(bodies)
    flat = _static_patches(bodies)
    sheets = [flat[n : n + _PICTURES_PER_SHEET] for n in range(0, len(flat), _PICTURES_PER_SHEET)]
    maps = {folder / f"{body.name}.{surface.name}.png": (body, surface) for body, surface in mapped}
    pages = [folder / f"surfaces-{number}.jpg" for number in range(1, len(sheets) + 1)]
    for path in (*maps, *pages):
        check_output(path, replace=replace, help="choose another folder (--output), or replace its files (--replace)")
        check_not_input(path, scene.used if scene else ())
    with writing(folder), Progress() as progress:
        folder.mkdir(exist_ok=True)
        for done, (path, (body, surface)) in enumerate(maps.items()):
            progress("maps", done, len(maps))
            assert body.actor is not None
            if painted is not None:
                picture = painted(surface)
            else:
                picture = texture_map(surface.islands, surface.aspect, actor_body(body.actor), surface.slots)
            write_output(path, picture, replace=replace)
        if scene is not None:
            _draw_sheets(scene, dict(zip(pages, sheets, strict=True)), progress, replace)
    say(f"{folder}: {count(len(maps), 'texture map')}, {count(len(pages), 'sheet')}", err=True)


def _texture_maps(bodies: list[_Body]) -> list[tuple[_Body, WholeSurface]]:
    """The surfaces of actors that are texture maps."""
    from recipe_compiler.library.surfaces import WholeSurface

    return [(b, s) for b in bodies if b.actor is not None for s in b.surfaces if isinstance(s, WholeSurface)]


def _static_patches(bodies: list[_Body]) -> list[PatchPlan]:
    """A patch on each flat surface of the town and of props, as large as fits."""
    from recipe_compiler.ir.patches import GREEN, PatchPlan, PatchTexture
    from recipe_compiler.library.surfaces import FlatSurface

    texture = PatchTexture(colour=GREEN)
    return [
        PatchPlan(name=f"{c.name} {s.name}", body=s.body, faces=(_face(s),), texture=texture)
        for c in bodies
        for s in c.surfaces
        if c.actor is None and isinstance(s, FlatSurface)
    ]


def _draw_sheets(scene: _Scene, sheets: dict[Path, list[PatchPlan]], progress: Progress, replace: bool) -> None:
    from recipe_runtime.core.asset_files import Assets
    from recipe_runtime.core.outputs import write_output
    from recipe_runtime.frames.surface_views import surface_views
    from recipe_runtime.report.catalogue import sheet

    every = [patch for patches in sheets.values() for patch in patches]
    views, done = surface_views(scene.plan, scene.looks, every, assets=Assets(scene.places)), 0
    for path, patches in sheets.items():
        drawn = []
        for patch in patches:
            progress("pictures", done, len(every))
            drawn.append((patch.name, next(views)))
            done += 1
        write_output(path, sheet(drawn), replace=replace)
    progress("pictures", done, len(every))
