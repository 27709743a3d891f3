"""Records which recipe a dataset was built from, so that no recipe replaces the dataset of another by mistake.

    datasets/rain_bench/                 the dataset, which contains no path of this machine
    datasets/.rain_bench.source.json     the recipe's name, its path relative to datasets/, the dataset's identity

A recipe is identified by its name and its file. The record is valid only for the dataset whose identity it contains: a
dataset copied to that place from elsewhere has no recorded recipe.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection
from contextlib import suppress
from glob import escape
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.core import layout
from recipe_runtime.core.files import has_content, regular_file, resolved, write_atomic
from recipe_runtime.dataset.manifest_types import Manifest

_FORMAT = "recipe/source/1"
_MAX_BYTES = 1 << 16


def record_path(out: Path) -> Path:
    """Return the path of a dataset's record, next to the dataset's folder."""
    return out.with_name(f".{out.name}.source.json")


def record(out: Path, manifest: Manifest, source: Path | None) -> None:
    """Record that the dataset in `out` was built from the recipe file `source`, unless a recipe is recorded already.

    A failure to write the record is not an error, because the dataset is complete. Without a record, the next change of
    the recipe requires `--replace`.
    """
    if source is None or _recorded(out, manifest) is not None:
        return
    row = {"format": _FORMAT, "recipe": manifest["recipe"], "identity": manifest["identity"]}
    path = record_path(out)
    with suppress(OSError):
        for unfinished in sorted(
            out.parent.glob(f"{escape(f'.{path.name}')}.*.tmp")
        ):  # left by a build that was killed here
            unfinished.unlink(missing_ok=True)
        write_atomic(path, pretty({**row, "source": _from(out, source)}).encode())


def check_replaceable(out: Path, manifest: Manifest | None, plan: DatasetPlan, source: Path | None) -> None:
    """Check that the dataset in `out`, if there is one, belongs to the recipe that is about to be built there.

    Args:
        out: the dataset's folder.
        manifest: its manifest; None if there is no dataset.
        plan: the plan to build.
        source: the recipe's file. None if the caller has only a plan; recipes are then distinguished by name alone.

    Raises:
        InputError: the dataset belongs, or may belong, to another recipe.
    """
    if manifest is None:
        return
    name, ours = str(manifest.get("recipe"))[:100], str(source) if source else plan.recipe
    remedy = f"choose another folder, or replace it with {ours}'s"
    if name != plan.recipe:
        raise InputError(
            f"{out} holds the dataset of another recipe, {name!r}, and this is {plan.recipe!r}; {remedy}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if source is None or manifest.get("plan") == plan.digest:
        return
    there = _recorded(out, manifest)
    if there is None:
        raise InputError(
            f"{out} holds a dataset named {name!r} that is not known to be built from {source}; {remedy}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if there != _from(out, source):
        other = os.path.relpath(out.resolve().parent / there)
        raise InputError(
            f"{out} holds the dataset of {other}, another recipe that is named {name!r} as {source} is; {remedy}",
            code=Code.OUTPUT_IN_THE_WAY,
        )


def check_recipe_kept(
    out: Path,
    manifest: Manifest | None,
    plan: DatasetPlan,
    source: Path | None,
    files: RecipeFiles | None,
    *,
    repaired: bool,
) -> None:
    """Check that a dataset to be replaced by one of the same plan does not lose its recipe, or changes of it.

    Args:
        out: the dataset's folder.
        manifest: its manifest; None if there is no dataset.
        plan: the plan to build.
        source: the recipe's file; None if the caller has only a plan.
        files: the recipe's files, which the new dataset contains; None: none.
        repaired: whether files that differ from the manifest are damage to repair.

    Raises:
        InputError: a file would be lost. A file that the recorded recipe's build wrote may be replaced.
    """
    if manifest is None or manifest.get("plan") != plan.digest:
        return
    own = files is not None and (source is None or _recorded(out, manifest) == _from(out, source))
    new = files.contents(plan.recipe, "") if files else {}
    for path, row in manifest["files"].items():
        if not layout.is_recipe_file(path) or path == layout.recipe_lockfile(plan.recipe):
            continue
        if regular_file(out, path) is None:
            continue
        body = new.get(path)
        if body is not None and has_content(out, path, len(body), hashlib.sha256(body).hexdigest()):
            continue
        intact = has_content(out, path, row["size"], row["sha256"])
        if not (own if intact else repaired):
            what = "was changed after the build" if not intact else "is not this recipe's"
            raise InputError(
                f"{out / path} {what}, and would be {'removed' if body is None else 'replaced'}",
                help="copy it, and build in another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )


def check_outside(
    out: Path,
    manifest: Manifest | None,
    plan: DatasetPlan,
    source: Path | None,
    files: RecipeFiles | None,
    used: Collection[Path] = (),
) -> None:
    """Check that the dataset to be replaced does not hold the recipe, or a file that it uses, and would lose files.

    These are the recipe's files at their present paths, images that the recipe no longer uses and, if the plan has
    changed, the lockfile.

    Args:
        out: the dataset's folder.
        manifest: its manifest; None if there is no dataset.
        plan: the plan to build.
        source: the recipe's file, if known.
        files: the recipe's files, which the new dataset holds.
        used: the paths of the recipe's files.

    Raises:
        InputError: it does.
    """
    if manifest is None:
        return
    kept = {f"{layout.RECIPE}/{path}" for path in files.files} if files else set()
    lost = {path for path in manifest["files"] if layout.is_recipe_file(path)} - kept
    if manifest.get("plan") == plan.digest and lost <= {layout.recipe_lockfile(plan.recipe)}:
        return
    check_apart(out, [*([] if source is None else [source]), *used])


def check_apart(out: Path, used: Collection[Path]) -> None:
    """Check that a dataset to be replaced holds none of the files that its recipe uses.

    Raises:
        InputError: it does.
    """
    for path in used:
        if resolved(path).is_relative_to(resolved(out)):
            raise InputError(
                f"{path} is a file of the dataset {out}, which would be replaced, with all files beside the recipe",
                help=f"copy {path.parent} out of the dataset and use the copy, or choose another folder",
                code=Code.OUTPUT_IN_THE_WAY,
            )


def _recorded(out: Path, manifest: Manifest) -> str | None:
    """Return the recorded path of this dataset's own recipe, or None."""
    try:
        row = json.loads(read_regular(record_path(out), _MAX_BYTES))
        known = (row["format"], row["recipe"], row["identity"]) == (_FORMAT, manifest["recipe"], manifest["identity"])
        return str(row["source"]) if known else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _from(out: Path, source: Path) -> str:
    """Return the path of a recipe relative to the folder of `out`; it stays valid if both are moved together."""
    return Path(os.path.relpath(source.resolve(), out.resolve().parent)).as_posix()
