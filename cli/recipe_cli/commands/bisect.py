"""`recipe bisect`: the commits at which a frame changed."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from recipe_cli import completion
from recipe_cli.arguments import JSON, RECIPE, VARIANT, compile_quietly
from recipe_cli.console import print_json, say
from recipe_cli.lockfile_paths import lockfile_path
from recipe_cli.suggestions import check_exists


@click.command("bisect")
@RECIPE
@VARIANT
@click.option("--sensor", metavar="NAME", shell_complete=completion.sensors, help="The sensor; the first by default.")
@click.option(
    "--modality",
    default="rgb",
    show_default=True,
    shell_complete=completion.modalities,
    help="The modality, or `labels`.",
)
@click.option("--frame", type=click.IntRange(0), default=0, show_default=True, help="The number of the frame.")
@click.option("--since", metavar="REVISION", help="Compare with this revision; by default, with the first one.")
@JSON
def command(
    recipe: Path, variant: str | None, sensor: str | None, modality: str, frame: int, since: str | None, as_json: bool
) -> None:
    """Name the commits at which a frame of RECIPE, a recipe or its lockfile, changed, without rendering.

    The lockfile is read at each commit of its git repository. Commits are listed from the oldest, each with what else
    changed in the lockfile: the plan, the motion, or the code alone.
    """
    from recipe_compiler.ir import lockfile
    from recipe_compiler.ir.errors import InputError
    from recipe_runtime.lifecycle import history

    check_exists(recipe)
    path = recipe
    if not lockfile.is_lockfile(recipe):
        path = lockfile_path(recipe, compile_quietly(recipe).plan.recipe)
    lock = lockfile.read(path)
    variant = next(iter(lock.variants)) if variant is None else variant
    sensor = min(key[1] for key in lock.frames) if sensor is None else sensor
    pixel = history.Pixel(variant, sensor, modality, frame)
    found = list(history.changes(path, pixel, since))
    if not found and pixel.digest(lock) is None:
        raise InputError(
            f"{path} has no frame {frame} of {modality} of {sensor} in {variant!r}, now or earlier",
            help=f"its variants: {', '.join(list(lock.variants)[:3])}; its sensors: "
            + ", ".join(sorted({key[1] for key in lock.frames})[:5]),
        )
    if as_json:
        print_json({"lockfile": str(path), **asdict(pixel), "changes": [asdict(change) for change in found]})
        return
    say(f"{variant}, {sensor}, {modality}, frame {frame}")
    for change in found:
        say(f"{change.commit[:10]}  {change.date}  {change.subject}")
        say(f"            {change.cause}")
    if not found:
        say("no commit changed it" + (f" since {since}" if since else ""))
