"""`recipe diff`: the differences between two recipes, lockfiles, plans or datasets, in causal order."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from recipe_cli.arguments import (
    ALLOW_LARGE,
    JSON,
    LocalPath,
    compile_quietly,
    opened,
    output_option,
    replace_option,
)
from recipe_cli.console import held_notes, print_json, say
from recipe_cli.host_limits import check_bytes
from recipe_cli.lockfile_paths import lockfile_path
from recipe_cli.progress import Progress
from recipe_cli.suggestions import check_exists

if TYPE_CHECKING:
    from recipe_runtime.verify.compare import Side

_MAX_SHOWN = 40


@click.command("diff")
@click.argument("first", type=LocalPath(path_type=Path))
@click.argument("second", type=LocalPath(path_type=Path))
@output_option(
    LocalPath(path_type=Path, file_okay=False),
    "Write a delta dataset: the files of SECOND that FIRST lacks. Both are datasets.",
)
@replace_option("Replace another delta, or a folder with other files.")
@ALLOW_LARGE
@JSON
def command(first: Path, second: Path, output: Path | None, replace: bool, allow_large: bool, as_json: bool) -> None:
    """Report the differences between FIRST and SECOND, in the order of the stages, without rendering.

    Each is a recipe (with its lockfile, if that is up to date), a pack, a lockfile, a dataset folder, or an
    expanded plan (`recipe plan --variant`, plans/*.json of a dataset). Datasets are compared by their
    manifests, which hold a digest of every frame and the SHA-256 of every file; `recipe verify --integrity`
    checks the files themselves. Exit code 0: nothing differs, 1: something does.

    With --output, the files of the dataset SECOND that the dataset FIRST lacks are written to a folder instead, from
    which `recipe merge FIRST FOLDER` makes SECOND.
    """
    for path in (first, second):
        check_exists(path)
    if output is not None:
        _write_delta(first, second, output, replace, allow_large, as_json)
        return
    from recipe_runtime.verify.diff import differences, left_out

    a, b = _side(first, allow_large), _side(second, allow_large)
    found, notes = differences(a, b), left_out(a, b)
    if as_json:
        rows = [{"stage": finding.stage, "message": finding.message} for finding in found]
        print_json({"first": str(first), "second": str(second), "differences": rows, "left_out": notes})
    else:
        for finding in found[:_MAX_SHOWN]:
            say(str(finding))
        if len(found) > _MAX_SHOWN:
            say(f"... and {len(found) - _MAX_SHOWN} more; --json lists all")
        if not found:
            say("nothing differs")
        for note in notes:
            say(note, err=True)
    raise click.exceptions.Exit(1 if found else 0)


def _write_delta(first: Path, second: Path, output: Path, replace: bool, allow_large: bool, as_json: bool) -> None:
    from recipe_compiler.estimate import size
    from recipe_compiler.ir.plurals import count
    from recipe_runtime.dataset import reader
    from recipe_runtime.lifecycle.delta import write_delta

    before, after = reader.read(first), reader.read(second)
    check_bytes(after, copies=1, allow_large=allow_large)
    with held_notes() as notice, Progress(quiet=as_json) as progress:
        delta = write_delta(before, after, output, progress, replace=replace, notice=notice)
    if as_json:
        print_json({"folder": str(output), **delta, "files": len(delta["files"])})
        return
    say(f"{output}: {count(len(delta['files']), 'file')}, {size(sum(delta['files'].values()))}")
    say(f"from {delta['before']}")
    say(f"to   {delta['after']}")


def _side(path: Path, allow_large: bool) -> Side:
    """Read a path as a recipe, a lockfile or a dataset, by its kind."""
    from dataclasses import replace

    from recipe_compiler.ir import lockfile
    from recipe_runtime.dataset import reader
    from recipe_runtime.dataset.digests import bare
    from recipe_runtime.verify.compare import Side

    if path.is_dir():
        held = reader.read(path)
        listed = {name: sha256 for name, (_, sha256) in held.files.items()}
        return Side(str(path), held.lock, held.plan, listed, held.plan_digests, finished=True)
    if path.suffix == ".lock":
        return Side(str(path), lockfile.read(path), None, finished=True)
    if path.suffix == ".json":
        plan = reader.plan_alone(path)
        return Side(str(path), bare(plan, "", {}), plan)
    with opened(path) as recipe:
        compiled = compile_quietly(recipe, allow_large=allow_large)
        found, note = lockfile_path(recipe, compiled.plan.recipe), None
        if found.exists():  # so motion and pixels are compared too
            lock = lockfile.read(found)
            if lock.plan == compiled.plan.digest:
                return Side(str(path), replace(lock, files=compiled.files), compiled.plan)
            other = lock.other_recipe(found, recipe, compiled.plan.digest)
            without = f"{path} is compared without it"
            note = f"{found} is not what {path} compiles to now, so {without}; `recipe lock --update` updates it"
            if other is not None:  # an update would replace that recipe's lockfile
                note = f"{found} is the lockfile of {other}, a recipe of the same name, so {without}"
        return Side(str(path), bare(compiled.plan, "", compiled.files), compiled.plan, note=note)
