"""Compares the recipe in a dataset's folder with the dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError

from recipe_runtime.core import layout
from recipe_runtime.core.files import regular_file
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.loading import TooLargeError, compiled_with_files
from recipe_runtime.verify.excuses import excuse_of
from recipe_runtime.verify.verdict import Difference


def recipe_differences(dataset: Dataset, allow_large: bool = False) -> list[Difference]:
    """Compare the recipe in a dataset's folder with the dataset: its plans, files and identity.

    The bytes of the files are not compared with the manifest; `damaged_files` does that.
    """
    place = dataset.recipe_file
    if place is None or regular_file(dataset.root, place) is None:
        return []
    try:
        plan, files = compiled_with_files(dataset.root / place, allow_large)
    except InputError as error:
        excuse = (
            "it is over the size limits, and large recipes are not allowed"
            if isinstance(error, TooLargeError)
            else None
        )
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("recipe", f"{place} cannot be compiled: {first}", excuse, path=place)]
    found = [Difference("recipe", message, path=path) for path, message in _surplus(dataset, files)]
    made, excuse = {v.variant: v.digest for v in plan.variants}, excuse_of("plan", dataset.lock)
    other = [v.variant for v in dataset.plan.variants if made.get(v.variant) != v.digest]
    names = [variant.variant for variant in plan.variants]
    if plan.recipe != dataset.plan.recipe:
        message = f"{place} is the recipe {plan.recipe!r}, and the dataset is named {dataset.plan.recipe!r}"
        found.append(Difference("recipe", message))
    if plan.description != dataset.plan.description:
        found.append(Difference("recipe", f"{place} has another description than the dataset", path=place))
    if not other and names != [variant.variant for variant in dataset.plan.variants]:
        found.append(Difference("recipe", f"{place} has other variants than the dataset, or in another order", excuse))
    if other:
        found.append(Difference("recipe", f"{place} is not the recipe of {other[0]}: its plan is another", excuse))
    elif (plan.annotations, plan.depth) != (dataset.plan.annotations, dataset.plan.depth):
        found.append(Difference("recipe", f"{place} asks for other outputs than the dataset has"))
    return found + _lockfile_differences(dataset)


def _surplus(dataset: Dataset, files: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield files in the recipe's folder that the recipe does not use."""
    known = {f"{layout.RECIPE}/{path}" for path in files} | {layout.recipe_lockfile(dataset.plan.recipe)}
    for path in dataset.files:
        if layout.is_recipe_file(path) and path not in known:
            yield path, f"{path} is not a file of the recipe"


def _lockfile_differences(dataset: Dataset) -> list[Difference]:
    path = layout.recipe_lockfile(dataset.plan.recipe)
    if path not in dataset.files or regular_file(dataset.root, path) is None:
        return []
    try:
        lock = lockfile.read(dataset.root / path, dataset.plan)
    except InputError as error:
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("lockfile", first, path=path)]
    if lock.sealed and lock.identity == dataset.lock.identity:
        return []
    return [Difference("lockfile", f"{path} is not the lockfile of this dataset", path=path)]
