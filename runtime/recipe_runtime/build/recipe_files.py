"""The recipe in its dataset's folder: the YAML files and assets that were compiled, and the lockfile.

    recipe/
        rain_bench.yaml, towns/base.yaml, crate.glb     the recipe and the files that it uses, at their relative paths
        lockfiles/rain_bench.lock                       the lockfile, if it has the dataset's identity

A copied dataset can therefore be verified and built again without other files. All assets are included; the compiler
limits their total size to 128 MiB. The manifest lists the files, and `verify` checks that the recipe compiles to the
dataset's plan.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.lockfile import Lockfile

from recipe_runtime.core import layout
from recipe_runtime.core.files import regular_file
from recipe_runtime.dataset.manifest import MAX_PARTS, stays_inside
from recipe_runtime.dataset.reader import Dataset

MAX_BYTES = 256 << 20


@dataclass(frozen=True)
class RecipeFiles:
    """The files of a recipe by path relative to its folder, as read when it was compiled, and its lockfile `lock`."""

    recipe: str
    files: Mapping[str, bytes]
    lock: Lockfile | None = None

    def __post_init__(self) -> None:
        """Check the names and the total size of the files.

        Raises:
            InputError: a file cannot be part of a dataset.
        """
        for path in self.files:
            if not stays_inside(path):
                raise InputError(f"{path!r} cannot be a file of a dataset; rename it with plain, printable characters")
            if path.count("/") + 2 > MAX_PARTS:
                raise InputError(f"{path!r} is in more than {MAX_PARTS - 2} folders; use fewer")
        size = sum(map(len, self.files.values()))
        if size > MAX_BYTES:
            raise InputError(f"the recipe's files have {size:,} bytes, over {MAX_BYTES:,}; use smaller ones")

    @property
    def place(self) -> str:
        """The recipe's path in the dataset."""
        return f"{layout.RECIPE}/{self.recipe}"

    def contents(self, name: str, identity: str) -> dict[str, bytes]:
        """Return the content of every file, by path in the dataset with that name and identity."""
        found = {f"{layout.RECIPE}/{path}": body for path, body in self.files.items()}
        lock = self.lock
        if lock is not None and lock.sealed and lock.identity == identity:
            digests = {path: hashlib.sha256(body).hexdigest() for path, body in self.files.items()}
            moved = replace(lock, source=f"../{self.recipe}", files=digests)
            found[layout.recipe_lockfile(name)] = moved.dumps().encode()
        return found


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Return the possible paths of a dataset's assets in its own folder, by digest; readers check the digests."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }
