"""`recipe why`: where a pixel of a frame comes from."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from recipe_cli import completion
from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    VARIANT,
    LocalPath,
    compile_quietly,
    engines_for,
    opened,
)
from recipe_cli.console import print_json, say
from recipe_cli.progress import Progress
from recipe_cli.suggestions import check_exists


@click.command("why")
@click.argument("recipe", type=LocalPath(path_type=Path), shell_complete=completion.files(*completion.SUFFIXES))
@click.argument("frame", type=click.IntRange(0))
@click.argument("x", type=click.IntRange(0))
@click.argument("y", type=click.IntRange(0))
@VARIANT
@click.option("--sensor", metavar="NAME", shell_complete=completion.sensors, help="The sensor; the first by default.")
@DEVICE
@ALLOW_LARGE
@JSON
def command(
    recipe: Path,
    frame: int,
    x: int,
    y: int,
    variant: str | None,
    sensor: str | None,
    device: str,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Say where the pixel in column X and row Y of FRAME comes from: body, surface, place, patch and light.

    RECIPE is a recipe, a pack or a dataset with its recipe. The frame is rendered again. Each part of the answer names
    the fields of the variant's plan that it follows from, as in `recipe plan --variant`.
    """
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.dataset import reader
    from recipe_runtime.lifecycle.pixel_origin import pixel_origin

    check_exists(recipe)
    if recipe.is_dir():
        held = reader.read(recipe)
        if held.recipe_file is None:
            raise InputError(f"{recipe} does not contain its recipe", help="name the recipe instead of the dataset")
        recipe = recipe / held.recipe_file
    with opened(recipe) as source:
        compiled = compile_quietly(source, allow_large=allow_large)
        with Progress(quiet=as_json) as progress:
            engines = engines_for(compiled, partial(progress, "simulate"))
            scenario = compiled.plan.named(variant)
            found = pixel_origin(scenario, frame, x, y, sensor, engines=engines, device=device, progress=progress)
    if as_json:
        print_json(found)
        return
    for name, value in found.items():
        say(f"{name:8} {_words(value)}")


def _words(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_words(v)}" for key, v in value.items() if v not in (None, [], {}))
    if isinstance(value, list):
        return " ".join(map(_words, value))
    return str(value)
