"""`recipe check`: every mistake of a recipe, in one run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count

from recipe_cli.arguments import JSON, RECIPES, LocalPath, opened, worker_count
from recipe_cli.console import print_json, row, say, warn
from recipe_cli.host_limits import memory

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem


@click.command("check")
@click.argument("recipes", nargs=-1, required=True, type=LocalPath(path_type=Path), shell_complete=RECIPES)
@JSON
def command(recipes: tuple[Path, ...], as_json: bool) -> None:
    """Read RECIPES and report every mistake in them, each with its place, its line of text and a remedy."""
    from recipe_compiler.ir.errors import InputError

    problems: list[tuple[Path, Problem]] = []
    warnings: list[tuple[Path, Problem]] = []
    for path in recipes:
        try:
            with opened(path) as recipe:
                variants, found = _checked(recipe)
        except InputError as error:
            problems += [(path, problem) for problem in error.problems]
            continue
        warnings += [(path, warning) for warning in found]
        if not as_json:
            warn(*found)
            say(f"{path}: valid, {count(variants, 'variant')}")
    if as_json:
        errors = [_row(*each) for each in problems]
        rows = {"errors": errors, "problems": errors, "warnings": [_row(*each) for each in warnings]}
        print_json({"ok": not problems, **rows})
        raise click.exceptions.Exit(2 if problems else 0)
    if problems:
        raise InputError([problem for _, problem in problems])


def _checked(path: Path) -> tuple[int, list[Problem]]:
    """Return the number of variants of a recipe and its warnings; a large size is not a mistake."""
    from recipe_compiler.compile import compile_recipe
    from recipe_compiler.estimate import TooLargeError

    try:
        compiled = compile_recipe(path, memory=memory(worker_count(None)))
    except TooLargeError as large:
        note = replace(large.problems[0], help="`recipe plan` and `recipe build` need --allow-large")
        return large.variants, [note, *large.warnings]
    return len(compiled.plan.variants), list(compiled.warnings)


def _row(path: Path, problem: Problem) -> dict[str, object]:
    found = row(problem)
    return found if problem.place else found | {"file": str(path)}
