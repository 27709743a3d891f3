"""Compares the recipe in a dataset's folder with the dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError

from recipe_runtime.core import layout
from recipe_runtime.core.files import regular_file
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.loading import TooLargeError, compiled_with_files
from recipe_runtime.verify.compare import compare_rows
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.motion_comparison import body_differences
from recipe_runtime.verify.verdict import Difference


def recipe_differences(
    dataset: Dataset, allow_large: bool = False, traces: Mapping[str, Trace] = MappingProxyType({})
) -> list[Difference]:
    """Compare the recipe and the lockfile in a dataset's folder with the dataset: plans, files, identity and motion.

    The bytes of the files are not compared with the manifest; `damaged_files` does that.

    Args:
        dataset: the dataset.
        allow_large: whether a recipe over the size limits is compiled.
        traces: by scene, the motion that has the locked digest; the lockfile's rows of bodies are compared with it.
    """
    found, files = _compare_recipe(dataset, allow_large)
    return found + _lockfile_differences(dataset, files, traces)


def _compare_recipe(dataset: Dataset, allow_large: bool) -> tuple[list[Difference], Mapping[str, str] | None]:
    """Compare the recipe with the dataset; return also the SHA-256 of its files, or None if it was not compiled."""
    place = dataset.recipe_file
    if place is None or regular_file(dataset.root, place) is None:
        return [], None
    try:
        plan, files = compiled_with_files(dataset.root / place, allow_large)
    except InputError as error:
        excuse = (
            "it is over the size limits, and large recipes are not allowed"
            if isinstance(error, TooLargeError)
            else None
        )
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("recipe", f"{place} cannot be compiled: {first}", excuse, path=place)], None
    found = [Difference("recipe", message, path=path) for path, message in _surplus(dataset, files)]
    made, excuse = {v.variant: v.digest for v in plan.variants}, excuse_of("plan", dataset.lock)
    other = [v.variant for v in dataset.plan.variants if made.get(v.variant) != v.digest]
    names = [variant.variant for variant in plan.variants]
    if plan.recipe != dataset.plan.recipe:
        message = f"{place} is the recipe {plan.recipe!r}, and the dataset is named {dataset.plan.recipe!r}"
        found.append(Difference("recipe", message))
    if plan.description != dataset.plan.description:
        found.append(Difference("recipe", f"{place} has a different description than the dataset", path=place))
    if not other and names != [variant.variant for variant in dataset.plan.variants]:
        found.append(
            Difference("recipe", f"{place} has different variants than the dataset, or a different order", excuse)
        )
    if other:
        found.append(Difference("recipe", f"{place} is not the recipe of {other[0]}: the plans differ", excuse))
    elif (plan.annotations, plan.depth) != (dataset.plan.annotations, dataset.plan.depth):
        found.append(Difference("recipe", f"{place} requests different outputs than the dataset has"))
    return found, files


def _surplus(dataset: Dataset, files: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield files in the recipe's folder that the recipe does not use."""
    known = {f"{layout.RECIPE}/{path}" for path in files} | {layout.recipe_lockfile(dataset.plan.recipe)}
    for path in dataset.files:
        if layout.is_recipe_file(path) and path not in known:
            yield path, f"{path} is not a file of the recipe"


def _lockfile_differences(
    dataset: Dataset, files: Mapping[str, str] | None, traces: Mapping[str, Trace]
) -> list[Difference]:
    """Compare the lockfile in a dataset's folder, also its rows that the identity does not cover."""
    path = layout.recipe_lockfile(dataset.plan.recipe)
    if path not in dataset.files or regular_file(dataset.root, path) is None:
        return []
    try:
        lock = lockfile.read(dataset.root / path, dataset.plan)
    except InputError as error:
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("lockfile", first, path=path)]
    if not lock.sealed or lock.identity != dataset.lock.identity:
        return [Difference("lockfile", f"{path} is not the lockfile of this dataset", path=path)]
    found = compare_rows(dataset.plan, lock)
    source = (dataset.recipe_file or "").removeprefix(layout.RECIPE)
    if files is not None and (lock.files, lock.source) != (files, f"..{source}"):
        found.append(Difference("lockfile", "its rows of files are not those of the recipe in the dataset"))
    found += body_differences(dataset.plan, lock, lambda scene: traces.get(scene.digest))
    return [replace(difference, message=f"{path}: {difference.message}", path=path) for difference in found]
