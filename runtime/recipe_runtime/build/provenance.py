"""Which recipe a dataset's folder belongs to, so that no recipe replaces the dataset of another.

    datasets/rain_bench/                 the dataset: no path of this machine is in it
    datasets/.rain_bench.source.json     format, the recipe's name, its path from datasets/, the dataset's identity

A recipe is known by its name and its file. The record counts only for the dataset whose identity it names: one that
was copied to that place from elsewhere has no recorded recipe.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from glob import escape
from pathlib import Path

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core.files import write_atomic
from recipe_runtime.dataset.manifest_types import Manifest

_FORMAT = "recipe/source/1"
_MAX_BYTES = 1 << 16


def record_path(out: Path) -> Path:
    """Where the record of a dataset lies: beside the dataset's folder."""
    return out.with_name(f".{out.name}.source.json")


def record(out: Path, manifest: Manifest, source: Path | None) -> None:
    """Note that the dataset in `out` was built from the recipe file `source`, unless a recipe is noted already.

    The dataset is whole and in its place, so that a disk that takes no record stops nothing: without one, the next
    change of the recipe asks for `--replace`.
    """
    if source is None or _recorded(out, manifest) is not None:
        return
    row = {"format": _FORMAT, "recipe": manifest["recipe"], "identity": manifest["identity"]}
    path = record_path(out)
    with suppress(OSError):
        for unfinished in sorted(
            out.parent.glob(f"{escape(f'.{path.name}')}.*.tmp")
        ):  # of a build that was killed here
            unfinished.unlink(missing_ok=True)
        write_atomic(path, pretty({**row, "source": _from(out, source)}).encode())


def check_replaceable(out: Path, manifest: Manifest | None, plan: DatasetPlan, source: Path | None) -> None:
    """InputError if the dataset in `out` is of another recipe than the one about to be built there.

    Args:
        out: the dataset's folder.
        manifest: the manifest that is there; None where there is no dataset.
        plan: what is to be built.
        source: the recipe's file; None where the caller has only a plan. Then the name alone tells recipes apart.
    """
    if manifest is None:
        return
    name, ours = str(manifest.get("recipe"))[:100], str(source) if source else plan.recipe
    remedy = f"choose another folder with --out, or replace that dataset with {ours}'s (--replace)"
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
    """The path of the recipe that is noted for this very dataset; None if there is none."""
    try:
        row = json.loads(read_regular(record_path(out), _MAX_BYTES))
        known = (row["format"], row["recipe"], row["identity"]) == (_FORMAT, manifest["recipe"], manifest["identity"])
        return str(row["source"]) if known else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _from(out: Path, source: Path) -> str:
    """The path from the folder of `out` to a recipe: a project that is moved as a whole keeps it."""
    return Path(os.path.relpath(source.resolve(), out.resolve().parent)).as_posix()
