"""`recipe blueprints`: the library of actors, as a table, as JSON, and in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import JSON, REPLACE, LocalPath, writing
from recipe_cli.console import print_json, say, say_table

if TYPE_CHECKING:
    from recipe_compiler.library.blueprints import Blueprint


@click.command("blueprints")
@click.argument("pattern", default="*")
@click.option(
    "--pictures",
    metavar="FOLDER",
    type=LocalPath(path_type=Path, file_okay=False),
    help="Also render each into FOLDER, as a PNG, and all of them on one sheet, blueprints.jpg.",
)
@REPLACE
@JSON
def command(pattern: str, pictures: Path | None, replace: bool, as_json: bool) -> None:
    """List the blueprints whose id matches PATTERN, a glob such as `vehicle.*`; all of them by default.

    `dashcam` is a mount on the vehicle, in metres, that sees the road ahead: `mount: {on: car, x: 1.15, z: 1.3}`.
    """
    found = _matching(pattern)
    if not as_json:
        _print_table(found)
    if pictures is not None:
        _draw(found, pictures, replace)
    if as_json:  # last: a run that fails prints its errors as the one document
        print_json([_row(blueprint) for blueprint in found])


def _matching(pattern: str) -> tuple[Blueprint, ...]:
    from recipe_compiler.checks.references import blueprint_remedy
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.library import blueprints
    from recipe_compiler.source.yaml_reader import show

    found = blueprints.match(pattern) if len(pattern) <= 64 else ()
    if not found:
        message = f"{show(pattern)} matches no blueprint"
        raise InputError(message, help=blueprint_remedy(pattern), code=Code.UNKNOWN_NAME)
    return found


def _row(blueprint: Blueprint) -> dict[str, object]:
    from recipe_compiler.ir.semantic_tags import Tag
    from recipe_runtime.meshes.dashcam import dashcam_mount

    shape, mount = blueprint.shape, dashcam_mount(blueprint.shape)
    return {
        "id": blueprint.id,
        "category": blueprint.category,
        "tag": blueprint.tag,
        "class": Tag(blueprint.tag).label,
        "attributes": blueprint.attributes,
        "size": {key: shape[key] for key in ("length", "width", "height") if key in shape},
        "speed": blueprint.default_speed,
        "dashcam": dict(zip("xyz", mount, strict=True)) if mount else None,
        "look": {slot: list(colours) for slot, colours in sorted(blueprint.palette.items())},
    }


def _print_table(found: tuple[Blueprint, ...]) -> None:
    from recipe_compiler.ir.semantic_tags import Tag
    from recipe_runtime.meshes.dashcam import dashcam_mount

    rows = [("blueprint", "kind", "size, m", "tag", "m/s", "dashcam", "colours")]
    for blueprint in found:
        kind = blueprint.attributes.get("base_type") or blueprint.attributes["generation"]
        size = " x ".join(f"{blueprint.shape[k]:.2f}" for k in ("length", "width", "height") if k in blueprint.shape)
        tag = f"{blueprint.tag} {Tag(blueprint.tag).label}"
        slots = ", ".join(sorted(blueprint.palette))
        mount = dashcam_mount(blueprint.shape)
        dashcam = f"x: {mount[0]:g}, z: {mount[2]:g}" if mount else "-"
        rows.append((blueprint.id, kind, size, tag, f"{blueprint.default_speed:g}", dashcam, slots))
    say_table(rows)


def _draw(found: tuple[Blueprint, ...], folder: Path, replace: bool) -> None:
    from recipe_compiler.library.blueprints import specimen
    from recipe_runtime.core import codecs
    from recipe_runtime.core.outputs import check_output, write_output
    from recipe_runtime.frames.portrait import portrait
    from recipe_runtime.report.catalogue import sheet

    from recipe_cli.progress import Progress

    drawn = []
    for path in (*(folder / f"{blueprint.id}.png" for blueprint in found), folder / "blueprints.jpg"):
        check_output(path, replace=replace, help="choose another folder (--pictures), or replace its files (--replace)")
    with writing(folder), Progress() as progress:
        folder.mkdir(exist_ok=True)
        for number, blueprint in enumerate(found):
            progress("pictures", number, len(found))
            pixels = portrait(*specimen(blueprint))
            write_output(folder / f"{blueprint.id}.png", codecs.png(pixels), replace=replace)
            drawn.append((blueprint.id, pixels))
        progress("pictures", len(found), len(found))
        write_output(folder / "blueprints.jpg", sheet(drawn), replace=replace)
    say(f"{folder}: {count(len(found), 'picture')}, and blueprints.jpg", err=True)
