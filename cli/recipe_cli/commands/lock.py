"""`recipe lock`: a digest for every frame."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from recipe_cli.arguments import ALLOW_LARGE, DEVICE, WORKERS, LocalPath, compile_quietly, engines_for, worker_count
from recipe_cli.console import say
from recipe_cli.places import lockfile_path, source_of
from recipe_cli.progress import Progress

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_runtime.trace import Trace


@click.command("lock")
@click.argument("recipes", nargs=-1, required=True, type=LocalPath(path_type=Path))
@click.option("--update", is_flag=True, help="Replace a lockfile that says something else.")
@click.option(
    "--with-traces",
    is_flag=True,
    help="Write lockfiles/<recipe>.traces too: hosts that simulate otherwise start from it.",
)
@DEVICE
@WORKERS
@ALLOW_LARGE
def command(
    recipes: tuple[Path, ...], update: bool, with_traces: bool, device: str, workers: int | None, allow_large: bool
) -> None:
    """Render every frame of RECIPES and write its digest into lockfiles/<recipe>.lock; nothing else is kept."""
    from recipe_compiler import lockfile
    from recipe_compiler.errors import InputError
    from recipe_runtime import traces
    from recipe_runtime.locking import lock

    count = worker_count(workers, device)
    compiled = [compile_quietly(recipe, allow_large=allow_large) for recipe in recipes]
    places = [lockfile_path(recipe, one.plan.recipe) for recipe, one in zip(recipes, compiled, strict=True)]
    for recipe, one, path in zip(recipes, compiled, places, strict=True):
        _check_before(recipe, one, path, update)
    for recipe, one, path in zip(recipes, compiled, places, strict=True):
        source = source_of(recipe, path)
        motion: dict[str, Trace] = {}
        with Progress() as progress:
            made = lock(
                one.plan,
                source,
                one.files,
                workers=count,
                progress=progress,
                engines=engines_for(one),
                device=device,
                traces=motion,
            )
        if path.exists() and not update and not lockfile.read(path).says_the_same(made):
            raise InputError(_otherwise(path, recipe))
        written = made.write(path)
        if with_traces or traces.beside(path).exists():  # a file that is there must not fall behind
            written |= traces.write(traces.beside(path), motion)
        say(f"{path} {'written' if written else 'is up to date'}")
        say(lockfile.read(path).identity)


def _check_before(recipe: Path, compiled: Compiled, path: Path, update: bool) -> None:
    """What can be known before anything is rendered: that the file can be written, and would not say otherwise."""
    import os

    from recipe_compiler import lockfile
    from recipe_compiler.errors import InputError, RunError

    try:
        str(recipe).encode()
    except UnicodeEncodeError:
        raise InputError(f"{str(recipe)!r}: a lockfile names its recipe in UTF-8; rename the file") from None
    if path.exists() and not update:
        there = lockfile.read(path)
        if there.plan != compiled.plan.digest or there.files != compiled.files:
            raise InputError(_otherwise(path, recipe))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"{path.parent}: cannot be made: {error.strerror}") from error
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise RunError(f"{path}: cannot be written; make the folder writable, or move what is in the way")


def _otherwise(path: Path, recipe: Path) -> str:
    return f"{path} says something else than {recipe} makes now; --update replaces it"
