"""`recipe lock`: a digest for every frame."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click
from recipe_compiler.ir.plurals import count as counted

from recipe_cli.arguments import (
    ALLOW_LARGE,
    DEVICE,
    JSON,
    RECIPES,
    WORKERS,
    LocalPath,
    compile_quietly,
    engines_for,
    replace_option,
    worker_count,
)
from recipe_cli.console import print_json, say
from recipe_cli.lockfile_paths import check_lockfile_is_of, lockfile_path, source_of
from recipe_cli.places import check_utf8, used_files
from recipe_cli.progress import Progress, interruptible

if TYPE_CHECKING:
    from recipe_compiler.compile import Compiled
    from recipe_compiler.ir.errors import InputError
    from recipe_compiler.ir.lockfile import Lockfile
    from recipe_runtime.build.known_frames import Known
    from recipe_runtime.core.trace import Trace


@click.command("lock")
@click.argument("recipes", nargs=-1, required=True, type=LocalPath(path_type=Path), shell_complete=RECIPES)
@click.option("--update", is_flag=True, help="Replace the recipe's lockfile if it differs.")
@replace_option("Replace the lockfile of another recipe, or a file that is not a lockfile.")
@click.option(
    "--with-traces",
    is_flag=True,
    help="Also write lockfiles/<recipe>.traces, for hosts whose simulation differs.",
)
@DEVICE
@WORKERS
@ALLOW_LARGE
@JSON
def command(
    recipes: tuple[Path, ...],
    update: bool,
    replace: bool,
    with_traces: bool,
    device: str,
    workers: int | None,
    allow_large: bool,
    as_json: bool,
) -> None:
    """Write a digest of every frame of RECIPES into lockfiles/<recipe>.lock.

    Frames are rendered and not kept. Frames of the dataset that `recipe build` made from the same plan here are reused,
    once its files have been hashed. An interrupted lock is resumed.
    """
    from recipe_compiler.ir.errors import Code, InputError

    for recipe in recipes:
        if recipe.suffix == ".recipe":
            remedy = "unpack it (it is a ZIP file), lock the recipe and pack it again"
            raise InputError(f"{recipe} is a pack", help=remedy, code=Code.USAGE)
    count = worker_count(workers, device)
    compiled = [(recipe, compile_quietly(recipe, allow_large=allow_large, workers=count)) for recipe in recipes]
    work = [(recipe, one, lockfile_path(recipe, one.plan.recipe)) for recipe, one in compiled]
    _check_apart(recipes, [path for _, _, path in work])
    options = Options(update or replace, replace, with_traces, device, count)
    inputs = [file for recipe, one in compiled for file in used_files(recipe, one)]
    for recipe, one, path in work:
        _check_before(recipe, one, path, options, inputs)
    rows = []
    for recipe, one, path in work:
        locked = _lock(recipe, one, path, options)
        rows.append(locked.row())
        if not as_json:
            _print(locked)
    if as_json:
        print_json({"lockfiles": rows})


@dataclass(frozen=True)
class Options:
    """How recipes are locked."""

    update: bool
    replace: bool
    with_traces: bool
    device: str
    workers: int


@dataclass(frozen=True)
class Locked:
    """One locked recipe."""

    recipe: Path
    path: Path
    lock: Lockfile
    previous: Lockfile | None  # the lockfile that was there, unless it was to be replaced
    renamed: bool  # the recipe that `previous` names does not exist; the lockfile names this one now
    written: bool
    taken_frames: int
    resumed_frames: int

    def row(self) -> dict[str, object]:
        """The JSON row of this recipe."""
        return {
            "recipe": str(self.recipe),
            "lockfile": str(self.path),
            "identity": self.lock.identity,
            "written": self.written,
            "taken_frames": self.taken_frames,
            "resumed_frames": self.resumed_frames,
        }


def _lock(recipe: Path, compiled: Compiled, path: Path, options: Options) -> Locked:
    """Render what is not known yet, and write the lockfile and, if they are wanted, the traces.

    Raises:
        InputError: there is a lockfile with other digests, and `options.update` is not set.
    """
    from recipe_compiler.ir import lockfile
    from recipe_runtime.build.known_frames import known_frames
    from recipe_runtime.core.files import host_errors
    from recipe_runtime.verify import trace_bundle
    from recipe_runtime.verify.locking import lock

    source = source_of(recipe, path)
    motion: dict[str, Trace] = {}
    known = known_frames(compiled.plan)
    with interruptible(partial(_interruption, recipe, known)), Progress() as progress:
        made = lock(
            compiled.plan,
            source,
            compiled.files,
            workers=options.workers,
            progress=progress,
            engines=engines_for(compiled),
            device=options.device,
            traces=motion,
            known=known,
        )
    previous = lockfile.read(path) if path.exists() and not options.update else None
    if previous is not None and not previous.equals_but_for_text(made):
        raise _outdated(path, recipe)
    renamed = previous is not None and previous.source != source and not os.path.lexists(path.parent / previous.source)
    traces, written = trace_bundle.beside(path), False
    if options.with_traces or traces.exists():  # an existing file of traces must not become outdated
        written = trace_bundle.write(traces, motion)  # first: a full disk then keeps both old
    with host_errors(str(path), "free some space or allow writing, then lock again"):
        written |= (previous is None or renamed) and made.write(path)
    known.close()
    return Locked(recipe, path, made, previous, renamed, written, known.taken_frames, known.resumed_frames)


def _print(locked: Locked) -> None:
    """Print a locked recipe for a person."""
    if locked.renamed and locked.previous is not None:
        say(f"{locked.path} now names {locked.lock.source}; {locked.previous.source}, which it named, does not exist")
    else:
        note = _note(locked.previous, locked.lock)
        say(f"{locked.path} {'written' if locked.written else 'is up to date'}{note}")
    say(locked.lock.identity)
    for number, origin in (
        (locked.taken_frames, "the dataset built here"),
        (locked.resumed_frames, "a stopped lock"),
    ):
        if number:
            say(f"{counted(number, 'frame')} reused from {origin}")


def _note(previous: Lockfile | None, made: Lockfile) -> str:
    """A note if the text of the recipe changed since it was locked, but not its plan."""
    from recipe_runtime.verify.compare import text_note

    note = text_note(previous, made.plan, made.files) if previous is not None else None
    return f"; {note} (--update records the new text)" if note else ""


def _check_apart(recipes: tuple[Path, ...], places: list[Path]) -> None:
    """InputError if two recipes would write one lockfile."""
    from recipe_compiler.ir.errors import InputError

    for number, place in enumerate(places):
        first = places.index(place)
        if first != number and recipes[first].resolve() != recipes[number].resolve():
            raise InputError(
                f"{recipes[first]} and {recipes[number]} have one name, and so one lockfile, {place};"
                " give one of them another name (`recipe: NAME`)"
            )


def _interruption(recipe: Path, known: Known) -> tuple[str, str]:
    """Return what an interrupted lock has kept, and how to continue."""
    kept = known.kept_frames()
    if not kept:
        return "interrupted", f"lock {recipe} again to start over"
    return f"interrupted; {counted(kept, 'frame')} kept", f"lock {recipe} again to continue"


def _check_before(recipe: Path, compiled: Compiled, path: Path, options: Options, inputs: list[Path]) -> None:
    """Raise what is known before anything is rendered.

    Raises:
        InputError: the file is not this recipe's lockfile, or has another plan; or it is one of `inputs`, the files
            that the recipes use.
        RunError: the folder cannot be written.
    """

    from recipe_compiler.ir.errors import Code, InputError, RunError
    from recipe_runtime.core.outputs import check_not_input
    from recipe_runtime.verify import trace_bundle

    check_utf8(recipe)
    dangling = path.is_symlink() and not path.exists() and not options.replace
    if dangling or path.parent.is_symlink():
        raise InputError(
            f"{path if dangling else path.parent} is a symbolic link, and lockfiles are not written through links",
            help=f"replace the link with a {'file' if dangling else 'folder'}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if path.is_file() and not options.replace:
        _check_is_of_recipe(recipe, compiled, path, options.update)
    traces = trace_bundle.beside(path)
    for output in (path, traces):
        check_not_input(output, inputs)
    if options.with_traces or traces.exists():
        trace_bundle.check_replaceable(traces, replace=options.replace)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "allow writing there, or lock a copy of the recipe in another folder"
        raise RunError(f"{path.parent}: cannot be created: {error.strerror}", help=remedy) from error
    if path.is_dir() or not os.access(path.parent, os.W_OK):
        raise RunError(f"{path}: cannot be written; make the folder writable, or move what is in the way")


def _check_is_of_recipe(recipe: Path, compiled: Compiled, path: Path, update: bool) -> None:
    """InputError unless the existing file is a lockfile of this recipe and, without `update`, of this plan."""
    from recipe_compiler.ir import lockfile
    from recipe_compiler.ir.errors import Code, InputError

    if update and not lockfile.is_lockfile(path):
        raise InputError(
            f"{path} exists already and is not a lockfile; move it away, or add --replace",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    try:
        there = lockfile.read(path)
    except InputError:
        if not update:
            raise
        return  # damaged, and about to be rewritten
    check_lockfile_is_of(recipe, compiled.plan, path, there)
    gone = there.missing_recipe(path, recipe, compiled.plan.digest) if update else None
    if gone is not None:
        raise InputError(
            f"{path} is the lockfile of {gone}, which does not exist, and has another plan than {recipe}",
            help=f"if {gone.name} was renamed, lock it under its new name first (`recipe lock NEW.yaml`), and give"
            f" {recipe} another name (`recipe: NAME`); else --replace takes the lockfile for {recipe}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if not update and there.plan != compiled.plan.digest:
        raise _outdated(path, recipe)


def _outdated(path: Path, recipe: Path) -> InputError:
    from recipe_compiler.ir.errors import Code, InputError

    what = f"{path} differs from what {recipe} compiles to now; --update replaces it"
    return InputError(what, code=Code.OUTDATED_LOCKFILE)
