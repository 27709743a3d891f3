"""Compares the recipe in a dataset with the dataset."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.files import host_errors, regular_file
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.loading import TooLargeError, compiled_with_files, named_files
from recipe_runtime.transfer import bundle
from recipe_runtime.verify.compare import compare_rows
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.motion_comparison import body_differences
from recipe_runtime.verify.verdict import Difference


def recipe_differences(
    dataset: Dataset, allow_large: bool = False, traces: Mapping[str, Trace] = MappingProxyType({})
) -> list[Difference]:
    """Compare the recipe and the lockfile in a dataset's pack with the dataset: plans, files, identity and motion.

    The bytes of the pack are not compared with the manifest; `damaged_files` does that.

    Args:
        dataset: the dataset.
        allow_large: whether a recipe over the size limits is compiled.
        traces: by scene, the motion that has the locked digest; the lockfile's rows of bodies are compared with it.
    """
    place = dataset.recipe_file
    if place is None or regular_file(dataset.root, place) is None:
        return []
    try:
        with bundle.unpacked(dataset.root / place, named_files) as recipe:
            found, files = _compare_recipe(dataset, recipe, allow_large)
            found += _lockfile_differences(dataset, recipe, files, traces)
    except InputError as error:
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        found = [Difference("recipe", f"the recipe cannot be read: {first}")]
    return [replace(difference, path=place) for difference in found]


def unpacked_assets(dataset: Dataset | None, folder: Path) -> Assets:
    """Write the assets of a dataset's plan, which are in its pack, into a folder."""
    place = None if dataset is None else dataset.recipe_file
    if dataset is None or place is None or regular_file(dataset.root, place) is None:
        return Assets()
    wanted, places = {sha256 for variant in dataset.plan.variants for sha256 in variant.files}, dict[str, Path]()
    with (
        suppress(InputError),  # `recipe_differences` reports it
        host_errors(str(folder), "free some space, or set TMPDIR to another folder"),
    ):
        for body in bundle.read(dataset.root / place).files.values():
            sha256 = hashlib.sha256(body).hexdigest()
            if sha256 in wanted:
                places[sha256] = folder / sha256
                places[sha256].write_bytes(body)
    return Assets(places)


def _compare_recipe(
    dataset: Dataset, recipe: Path, allow_large: bool
) -> tuple[list[Difference], Mapping[str, str] | None]:
    """Compare the recipe with the dataset; return also the SHA-256 of its files, or None if it was not compiled."""
    place, found = dataset.recipe_file, list[Difference]()
    try:
        plan, files = compiled_with_files(recipe, allow_large)
    except InputError as error:
        too_large = isinstance(error, TooLargeError)
        excuse = "it is over the size limits, and large recipes are not allowed" if too_large else None
        first = str(error).splitlines()[0].replace(f"{recipe.parent}/", "")
        return [Difference("recipe", f"{place} cannot be compiled: {first}", excuse)], None
    made, excuse = {v.variant: v.digest for v in plan.variants}, excuse_of("plan", dataset.lock)
    other = [v.variant for v in dataset.plan.variants if made.get(v.variant) != v.digest]
    names = [variant.variant for variant in plan.variants]
    if plan.recipe != dataset.plan.recipe:
        message = f"{place} is the recipe {plan.recipe!r}, and the dataset is named {dataset.plan.recipe!r}"
        found.append(Difference("recipe", message))
    for key in ("description", "about"):
        if getattr(plan, key) != getattr(dataset.plan, key):
            found.append(Difference("recipe", f"{place} has a different {key} than the dataset"))
    if not other and names != [variant.variant for variant in dataset.plan.variants]:
        found.append(
            Difference("recipe", f"{place} has different variants than the dataset, or a different order", excuse)
        )
    if other:
        found.append(Difference("recipe", f"{place} is not the recipe of {other[0]}: the plans differ", excuse))
    elif plan.outputs != dataset.plan.outputs:
        found.append(Difference("recipe", f"{place} requests different outputs than the dataset has"))
    return found, files


def _lockfile_differences(
    dataset: Dataset, recipe: Path, files: Mapping[str, str] | None, traces: Mapping[str, Trace]
) -> list[Difference]:
    """Compare the lockfile in a dataset's pack, also its rows that the identity does not cover."""
    place, path = dataset.recipe_file, recipe.parent / "lockfiles" / f"{dataset.plan.recipe}.lock"
    if not path.exists():
        return []
    try:
        lock = lockfile.read(path)
    except InputError as error:
        first = str(error).splitlines()[0].replace(f"{recipe.parent}/", f"{place}/")
        return [Difference("lockfile", first)]
    name = f"{place}/lockfiles/{path.name}"
    if not lock.sealed or lock.identity != dataset.lock.identity:
        return [Difference("lockfile", f"{name} is not the lockfile of this dataset")]
    found = compare_rows(dataset.plan, lock)
    if files is not None and (lock.files, lock.source) != (files, f"../{recipe.name}"):
        found.append(Difference("lockfile", "its rows of files are not those of the recipe in the dataset"))
    found += body_differences(dataset.plan, lock, lambda scene: traces.get(scene.digest))
    return [replace(difference, message=f"{name}: {difference.message}") for difference in found]
