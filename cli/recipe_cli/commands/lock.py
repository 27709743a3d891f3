"""`recipe lock`: a digest for every frame."""

from __future__ import annotations

from pathlib import Path

import click

from recipe_cli.arguments import ALLOW_LARGE, WORKERS, compile_quietly, worker_count
from recipe_cli.places import lockfile_path, source_of
from recipe_cli.progress import Progress


@click.command("lock")
@click.argument("recipes", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--update", is_flag=True, help="Replace a lockfile that says something else.")
@WORKERS
@ALLOW_LARGE
def command(recipes: tuple[Path, ...], update: bool, workers: int | None, allow_large: bool) -> None:
    """Render every frame of RECIPES and write its digest into lockfiles/<recipe>.lock; nothing else is kept."""
    from recipe_compiler import lockfile
    from recipe_compiler.errors import InputError
    from recipe_runtime.locking import lock

    compiled = [compile_quietly(recipe, allow_large=allow_large) for recipe in recipes]
    for recipe, one in zip(recipes, compiled, strict=True):
        path = lockfile_path(recipe, one.plan.recipe)
        with Progress() as progress:
            made = lock(one.plan, source_of(recipe, path), one.files, workers=worker_count(workers), progress=progress)
        if path.exists() and not update and not _agrees(path, made):
            raise InputError(f"{path} says something else than {recipe} makes now; --update replaces it")
        written = made.write(path)
        click.echo(f"{path} {'written' if written else 'is up to date'}\n{lockfile.read(path).identity}")


def _agrees(path: Path, made: object) -> bool:
    from dataclasses import replace

    from recipe_compiler import lockfile
    from recipe_compiler.errors import InputError

    try:
        there = lockfile.read(path)
    except InputError:
        return False
    return there.sealed and replace(there, tools={}) == replace(made, tools={})  # type: ignore[type-var]
