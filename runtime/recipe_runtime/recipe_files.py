"""The recipe in its dataset's folder: the YAML files and assets that were compiled, and the lockfile.

    recipe/
        rain_bench.yaml, towns/base.yaml, crate.glb     the recipe and all that it uses, at their places
        lockfiles/rain_bench.lock                       the lockfile, if the dataset is the one that it stands for

A copied dataset can thus be verified and built again from itself. All assets are included: the compiler holds them to
128 MiB together. Files are in the manifest, and are compared with the plan: the recipe must compile to it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from recipe_compiler import lockfile
from recipe_compiler.errors import InputError
from recipe_compiler.lockfile import Lockfile

from recipe_runtime import layout
from recipe_runtime.dataset import Dataset
from recipe_runtime.excuses import excuse_of
from recipe_runtime.manifest import stays_inside
from recipe_runtime.opening import TooLargeError, compiled_with_files
from recipe_runtime.store import regular_file
from recipe_runtime.verdict import Difference

MAX_BYTES = 256 << 20


@dataclass(frozen=True)
class RecipeFiles:
    """The files of a recipe, by their paths below its folder, read when it was compiled; `lock`: its lockfile."""

    recipe: str
    files: Mapping[str, bytes]
    lock: Lockfile | None = None

    def __post_init__(self) -> None:
        """InputError for a file that cannot be in a dataset's folder."""
        for path in self.files:
            if not stays_inside(path):
                raise InputError(f"{path!r} cannot be a file of a dataset; rename it with plain, printable characters")
        size = sum(map(len, self.files.values()))
        if size > MAX_BYTES:
            raise InputError(f"the recipe's files have {size:,} bytes, over {MAX_BYTES:,}; bring smaller ones")

    @property
    def place(self) -> str:
        """The recipe's path in the dataset."""
        return f"{layout.RECIPE}/{self.recipe}"

    def contents(self, name: str, identity: str) -> dict[str, bytes]:
        """Every file by its path in the dataset of that name and identity."""
        found = {f"{layout.RECIPE}/{path}": body for path, body in self.files.items()}
        if self.lock is not None and self.lock.sealed and self.lock.identity == identity:
            digests = {path: hashlib.sha256(body).hexdigest() for path, body in self.files.items()}
            lock = replace(self.lock, source=f"../{self.recipe}", files=digests)
            found[layout.recipe_lockfile(name)] = lock.dumps().encode()
        return found


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Where the assets of a dataset's plan may lie in its folder, by digest; readers hold them to it."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }


def recipe_differences(dataset: Dataset, allow_large: bool = False) -> list[Difference]:
    """How the recipe in a dataset's folder disagrees with the dataset: with its plans, files or identity.

    Whether its files have the manifest's bytes is for `damaged_files` to say.
    """
    place = dataset.recipe_file
    if place is None or regular_file(dataset.root, place) is None:
        return []
    try:
        plan, files = compiled_with_files(dataset.root / place, allow_large)
    except InputError as error:
        excuse = "it is over the size limits; --allow-large compiles it" if isinstance(error, TooLargeError) else None
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("recipe", f"{place} cannot be compiled: {first}", excuse, path=place)]
    found = [Difference("recipe", message, path=path) for path, message in _surplus(dataset, files)]
    made, excuse = {v.variant: v.digest for v in plan.variants}, excuse_of("plan", dataset.lock)
    other = [v.variant for v in dataset.plan.variants if made.get(v.variant) != v.digest]
    if other:
        found.append(Difference("recipe", f"{place} is not the recipe of {other[0]}: its plan is another", excuse))
    elif (plan.annotations, plan.depth) != (dataset.plan.annotations, dataset.plan.depth):
        found.append(Difference("recipe", f"{place} asks for other outputs than the dataset has"))
    return found + _lockfile_differences(dataset)


def _surplus(dataset: Dataset, files: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Files beside the recipe that it does not use."""
    known = {f"{layout.RECIPE}/{path}" for path in files} | {layout.recipe_lockfile(dataset.plan.recipe)}
    for path in dataset.files:
        if layout.is_recipe_file(path) and path not in known:
            yield path, f"{path} is not a file of the recipe"


def _lockfile_differences(dataset: Dataset) -> list[Difference]:
    path = layout.recipe_lockfile(dataset.plan.recipe)
    if path not in dataset.files or regular_file(dataset.root, path) is None:
        return []
    try:
        lock = lockfile.read(dataset.root / path)
    except InputError as error:
        first = str(error).splitlines()[0].replace(f"{dataset.root}/", "")
        return [Difference("lockfile", first, path=path)]
    if lock.sealed and lock.identity == dataset.lock.identity:
        return []
    return [Difference("lockfile", f"{path} is not the lockfile of this dataset", path=path)]
