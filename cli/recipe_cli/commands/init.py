"""`recipe init`: a new recipe, commented, ready to edit."""

from __future__ import annotations

import errno
import os
import re
import shlex
from pathlib import Path

import click

from recipe_cli.arguments import JSON, REPLACE, LocalPath
from recipe_cli.console import print_json, say


@click.command("init")
@click.argument("name")
@click.option(
    "--dir",
    "folder",
    type=LocalPath(path_type=Path, file_okay=False),
    default=Path(),
    show_default=True,
    help="The output folder; created if it does not exist.",
)
@REPLACE
@JSON
def command(name: str, folder: Path, replace: bool, as_json: bool) -> None:
    """Write NAME.yaml: a street with people and cars, a camera, three weathers; and what to run next."""
    from recipe_compiler.ir.errors import Code, InputError, RunError
    from recipe_compiler.schema import template
    from recipe_runtime.core.outputs import write_output

    _check_name(name)
    path = folder / f"{name}.yaml"
    try:
        if not replace and os.path.lexists(path):
            raise InputError(
                f"{path} exists already; choose another name, or add --replace to overwrite it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
        folder.mkdir(parents=True, exist_ok=True)
        write_output(path, template(name).encode(), replace=replace)
    except OSError as error:
        space = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        remedy = "free some space, or choose another --dir" if space else "choose another --dir"
        raise RunError(f"{path} cannot be written: {error.strerror or error}", help=remedy) from None
    if as_json:
        print_json({"file": str(path)})
        return
    say(f"{path} written. Next:")
    shown = shlex.quote(str(path))
    for line in (f"recipe plan {shown}", f"recipe shot {shown} -o shot.png", f"recipe build {shown}"):
        say(f"  {line}")


def _check_name(name: str) -> None:
    """InputError unless the language allows the name."""
    from recipe_compiler.ir.errors import InputError
    from recipe_compiler.schema.fields import NAME, NAME_LENGTH

    def allowed(text: str) -> bool:
        return re.fullmatch(NAME.strip("^$"), text) is not None and len(text) <= NAME_LENGTH

    if not allowed(name):
        stem, folder = Path(name).stem, str(Path(name).parent)
        rule = f"letters, digits, _ and - only, a letter or digit first, at most {NAME_LENGTH}"
        remedy = f"try {stem if allowed(stem) else 'rain_bench'!r}"
        remedy += f" with --dir {shlex.quote(folder)}" if folder != "." else ""
        raise InputError(f"{name!r} cannot name a recipe: {rule}; {remedy}")
