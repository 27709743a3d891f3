"""`recipe check`: every mistake of a recipe, in one run."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import JSON, compile_quietly, print_json


@click.command("check")
@click.argument("recipes", nargs=-1, required=True, type=click.Path(path_type=Path))
@JSON
def command(recipes: tuple[Path, ...], as_json: bool) -> None:
    """Read RECIPES and report every mistake in them, each as one line: file:line:column, what, remedy."""
    from recipe_compiler.errors import InputError, Problem

    problems: list[Problem] = []
    for path in recipes:
        try:
            compiled = compile_quietly(path)
        except InputError as error:
            problems += error.problems
            continue
        if not as_json:
            count = len(compiled.plan.variants)
            click.echo(f"{path}: in order, {count} variant{'s' if count != 1 else ''}")
    if as_json:
        rows = [
            {
                "message": p.message,
                "file": p.place and p.place.file,
                "line": p.place and p.place.line,
                "column": p.place and p.place.column,
            }
            for p in problems
        ]
        print_json({"ok": not problems, "problems": rows})
        raise click.exceptions.Exit(2 if problems else 0)
    if problems:
        raise InputError(problems)
