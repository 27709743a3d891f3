"""Records which recipe a dataset was built from, so that no recipe replaces the dataset of another by mistake.

    datasets/rain_bench/                 the dataset, which contains no path of this machine
    datasets/.rain_bench.source.json     the recipe's name, its path relative to datasets/, the dataset's identity

A recipe is identified by its name and its file. The record is valid only for the dataset whose identity it contains: a
dataset copied to that place from elsewhere has no recorded recipe.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import layout
from recipe_runtime.core.files import write_atomic
from recipe_runtime.core.staged_folder import is_free
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
        write_atomic(path, pretty({**row, "source": _from(out, source)}).encode())


def check_replaceable(out: Path, manifest: Manifest | None, plan: DatasetPlan, source: Path | None) -> None:
    """Check that the folder `out`, if there is one, is a dataset of the recipe that is about to be built there.

    Args:
        out: the dataset's folder.
        manifest: its manifest; None if there is no dataset, or a damaged one.
        plan: the plan to build.
        source: the recipe's file. None if the caller has only a plan; recipes are then distinguished by name alone.

    Raises:
        InputError: the folder is not a dataset, or belongs, or may belong, to another recipe.
    """
    if manifest is None:
        if is_free(out):
            return
        damaged = (out / layout.MANIFEST).exists()
        what = f"its {layout.MANIFEST} cannot be read" if damaged else f"it has no {layout.MANIFEST}"
        raise InputError(
            f"{out} holds files that are not known to be a dataset: {what}",
            help="choose another folder, or replace it",
            code=Code.OUTPUT_IN_THE_WAY,
        )
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
