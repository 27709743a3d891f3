"""`recipe shot`: one frame, to look at."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    RECIPE,
    LocalPath,
    compile_quietly,
    engines_for,
    unpacks,
    writing,
)
from recipe_cli.console import print_json, say
from recipe_cli.progress import Progress


@click.command("shot")
@RECIPE
@click.option("--variant", metavar="NAME", help="The variant; the first by default.")
@click.option("--sensor", metavar="NAME", help="The sensor; the first by default.")
@click.option("--frame", type=click.IntRange(0), help="The frame; the middle one by default.")
@click.option("--modality", metavar="NAME", help="rgb, depth, instance or semantic; rgb if it is captured.")
@click.option("-o", "--output", type=LocalPath(path_type=Path, dir_okay=False), help="The PNG; by default its name.")
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
    device: str,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Render one frame of RECIPE into a PNG: the very pixels of the full build (depth and labels in colours)."""
    from recipe_compiler.errors import InputError

    if output is not None and output.suffix.lower() != ".png":
        raise InputError(f"{output}: a shot is a PNG; give --output a name that ends in .png")
    compiled = compile_quietly(recipe, allow_large=allow_large)
    plan = compiled.plan
    scenario = plan.named(variant)
    from recipe_runtime.shot import shot

    with writing(output or Path("shot.png")):  # a folder that is not there is said before the work
        with Progress(quiet=as_json) as progress:
            engines = engines_for(compiled, partial(progress, "simulate"))
            made = shot(scenario, sensor, frame, modality, engines=engines, device=device, progress=progress)
        name = f"{plan.recipe}-{scenario.variant.replace('.', '_')}-{made.sensor}-{made.modality}-{made.frame:06d}.png"
        path = output or Path(name)
        made.write(path)
    if as_json:
        print_json(
            {"file": str(path), "variant": scenario.variant, "sensor": made.sensor, "frame": made.frame}
            | {"modality": made.modality, "digest": made.digest}
        )
    else:
        say(f"{path}: {scenario.variant}, {made.sensor}, {made.modality}, frame {made.frame}")
        say(f"pixels sha256:{made.digest}")
