"""`recipe shot`: one frame, to look at."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.modalities import MODALITIES

from recipe_cli import completion
from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    REPLACE,
    VARIANT,
    LocalPath,
    compile_quietly,
    engines_for,
    output_option,
    unpacks,
    writing,
)
from recipe_cli.console import print_json, say
from recipe_cli.places import used_files
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_runtime.frames.shot import Shot

_LONGEST = 140  # characters of recipe and variant in the name of a picture, as file systems end at 255 bytes


@click.command("shot")
@click.argument("recipe", type=LocalPath(path_type=Path), shell_complete=completion.recipe_or_town)
@VARIANT
@click.option("--sensor", metavar="NAME", shell_complete=completion.sensors, help="The sensor; the first by default.")
@click.option("--frame", type=click.IntRange(0), help="The frame; the middle one by default.")
@click.option(
    "--modality",
    metavar="NAME",
    shell_complete=completion.modalities,
    help=f"{', '.join(MODALITIES[:-1])} or {MODALITIES[-1]}; rgb if it is captured.",
)
@output_option(LocalPath(path_type=Path, dir_okay=False), "The PNG file to write.")
@click.option("--map", "as_map", is_flag=True, help="Draw the town from above instead; RECIPE may be a town's name.")
@REPLACE
@DEVICE
@ALLOW_LARGE
@JSON
@unpacks("recipe")
def command(
    recipe: Path,
    variant: str | None,
    sensor: str | None,
    frame: int | None,
    modality: str | None,
    output: Path | None,
    as_map: bool,
    replace: bool,
    device: str,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Render one frame of RECIPE into a PNG: exactly the pixels of the full build (depth and labels in colours).

    With --map draw its town from above: lanes, sidewalks, crossings, parking places, spawn points, and the recipe's
    actors and sensors, with coordinates in metres.
    """
    from recipe_compiler.ir.errors import InputError

    if output is not None and output.suffix.lower() != ".png":
        raise InputError(f"{output}: a shot is a PNG; give --output a name that ends in .png")
    if as_map:
        if (sensor, frame, modality) != (None, None, None):
            raise InputError("--map draws a town, not a frame; leave out --sensor, --frame and --modality")
        _draw_map(recipe, variant, output, replace, allow_large, as_json)
        return
    _check_not_a_town(recipe)
    compiled = compile_quietly(recipe, allow_large=allow_large)
    plan = compiled.plan
    scenario = plan.named(variant)
    from recipe_runtime.core.outputs import check_not_input, check_output, unused_names
    from recipe_runtime.frames.shot import shot

    with writing(output or Path("shot.png")):  # a folder that is not there is said before the work
        if output is not None:
            check_output(output, replace=replace)
            check_not_input(output, used_files(recipe, compiled))
        with Progress(quiet=as_json) as progress:
            engines = engines_for(compiled, partial(progress, "simulate"))
            made = shot(scenario, sensor, frame, modality, engines=engines, device=device, progress=progress)
        name = _name(plan.recipe, scenario.variant, made)
        if output is None and not replace:
            body = made.encoded()
            (path,) = unused_names(lambda suffix: {Path(f"{name}{suffix}.png"): body})
        else:
            path = output or Path(f"{name}.png")
        check_not_input(path, used_files(recipe, compiled))
        made.write(path, replace=replace or output is None)
    if as_json:
        print_json(
            {"file": str(path), "variant": scenario.variant, "sensor": made.sensor, "frame": made.frame}
            | {"modality": made.modality, "digest": made.digest}
        )
    else:
        say(f"{path}: {scenario.variant}, {made.sensor}, {made.modality}, frame {made.frame}")
        say(f"pixels sha256:{made.digest}")


def _name(recipe: str, variant: str, made: Shot) -> str:
    """Return the name of a picture without its suffix, after what it shows."""
    return f"{recipe}-{variant.replace('.', '_')}"[:_LONGEST] + f"-{made.sensor}-{made.modality}-{made.frame:06d}"


def _check_not_a_town(recipe: Path) -> None:
    """Raise InputError if a town is named, and no file has that name: only a map can be drawn of it."""
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.library import towns

    if str(recipe) in towns.NAMES and not recipe.exists():
        what = f"{recipe}: there is no such file"
        raise InputError(what, help="add --map to draw the town of that name", code=Code.FILE_NOT_FOUND)


def _check_town_name(recipe: Path) -> None:
    """Raise InputError if there is no such file, and the name has no suffix, as names of towns have none."""
    from recipe_compiler.ir.errors import Code, InputError
    from recipe_compiler.library import towns
    from recipe_compiler.schema.messages import near

    if recipe.exists() or recipe.suffix:
        return
    close = near(str(recipe), towns.NAMES)
    remedy = f'did you mean "{close}"?' if close else f"towns are {', '.join(sorted(towns.NAMES))}; or name a recipe"
    raise InputError(f"{recipe}: there is no such file or town", help=remedy, code=Code.FILE_NOT_FOUND)


def _draw_map(
    recipe: Path, variant: str | None, output: Path | None, replace: bool, allow_large: bool, as_json: bool
) -> None:
    """Write a map of a recipe's town, or of the town of that name where there is no such file."""
    from recipe_compiler.library import towns

    if str(recipe) in towns.NAMES and not recipe.exists():
        town, scenario, name, inputs = towns.build(str(recipe), 0, {}), None, str(recipe), list[Path]()
        title = f"{name}, as it is without parameters"
    else:
        _check_town_name(recipe)
        compiled = compile_quietly(recipe, allow_large=allow_large)
        scenario = compiled.plan.named(variant)
        town, name = compiled.towns[scenario.scene.town.digest], compiled.plan.recipe
        title, inputs = f"{name}: {town.plan.name}", used_files(recipe, compiled)
    from recipe_runtime.core.outputs import check_not_input, check_output, unused_names, write_output
    from recipe_runtime.report.town_map import Spots, town_map

    with writing(output or Path("map.png")):
        if output is not None:
            check_output(output, replace=replace)
        spots = Spots(town.spots["vehicle"], town.spots["pedestrian"], town.parking, town.streets.bounds)
        body = town_map(town.plan, spots, title, scenario)
        path = output or Path(f"{name}-map.png")
        if output is None and not replace:
            (path,) = unused_names(lambda suffix: {Path(f"{name}-map{suffix}.png"): body})
        check_not_input(path, inputs)
        write_output(path, body, replace=replace or output is None)
    if as_json:
        print_json({"file": str(path), "town": town.plan.name, "variant": scenario.variant if scenario else None})
    else:
        say(f"{path}: {town.plan.name} from above")
