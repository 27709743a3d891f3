"""Arguments and output that several commands share."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled

RECIPE = click.argument("recipe", type=click.Path(path_type=Path))
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON document for a program to read.")
ALLOW_LARGE = click.option("--allow-large", is_flag=True, help="Go on though the recipe is over the size limit.")
WORKERS = click.option(
    "--workers", type=click.IntRange(1, 256), default=None, help="Worker processes; one a CPU core by default."
)


def compile_quietly(path: Path) -> Compiled:
    """Compile a recipe and print its warnings; InputError with all of its mistakes."""
    from recipe_compiler.compile import compile_recipe

    compiled = compile_recipe(path)
    for warning in compiled.warnings:
        click.echo(f"warning: {warning}", err=True)
    return compiled


def print_json(value: Any) -> None:
    """One JSON document on standard output."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False))


def default_workers() -> int:
    """The number of CPU cores that this process may use."""
    import os

    return max(1, len(os.sched_getaffinity(0)))
