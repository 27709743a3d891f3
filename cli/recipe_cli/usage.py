"""Messages for wrong command lines, in plain words: click's own name Python's types and ranges."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

_REWORDED = (  # click's words -> ours
    (r"'(.*)' is not a valid integer( range)?", r"'\1' is not a whole number"),
    (r"'(.*)' is not a valid float( range)?", r"'\1' is not a number"),
    (r"(\S+) is not in the range (\S+)<=x<=(\S+)", r"\1 is not from \2 to \3"),
    (r"(\S+) is not in the range x>=(\S+)", r"\1 is below \2"),
    (r"File '(.*)' is a directory", r"'\1' is a folder"),
    (r"Directory '(.*)' is a file", r"'\1' is a file, not a folder"),
)


def problem_of(error: click.ClickException) -> Problem:
    """Return the problem of a wrong command line, with a remedy or a reference to the help."""
    from recipe_compiler.ir.errors import Code, Problem

    message = " ".join(error.format_message().split()).rstrip(".")
    for theirs, ours in _REWORDED:
        message = re.sub(f"{theirs}\\Z", ours, message)
    if not message[1:2].isupper():
        message = message[:1].lower() + message[1:]
    context = error.ctx if isinstance(error, click.UsageError) else None
    command = context.command_path if context else "recipe"
    if isinstance(error, click.NoSuchOption) and error.option_name == "--frames":
        remedy = "the recipe sets the number of frames: change `frames` in its `clock`"
        return Problem("no such option '--frames'", help=remedy, code=Code.USAGE)
    found = Problem(message, code=Code.USAGE)
    return found if found.help else Problem(message, help=f"see `{command} --help`", code=Code.USAGE)
