"""`recipe init`: a new recipe, commented, ready to edit."""

from __future__ import annotations

import re
from pathlib import Path

import click


@click.command("init")
@click.argument("name")
@click.option("--dir", "folder", type=click.Path(path_type=Path, file_okay=False), default=Path(), show_default=True)
def command(name: str, folder: Path) -> None:
    """Write NAME.yaml: two pedestrians, a street camera, three weathers; and what to run next."""
    from recipe_compiler.errors import InputError
    from recipe_compiler.schema import template

    if not re.fullmatch(r"[a-z][a-z0-9_]{0,63}", name):
        raise InputError(
            f"{name!r} cannot name a recipe: use a-z, 0-9 and _, starting with a letter, such as rain_bench"
        )
    path = folder / f"{name}.yaml"
    if path.exists():
        raise InputError(f"{path} is there already; choose another name, or remove it")
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(template(name))
    click.echo(f"{path} written. Next:")
    for line in (f"recipe plan {path}", f"recipe shot {path} -o shot.png", f"recipe build {path}"):
        click.echo(f"  {line}")
