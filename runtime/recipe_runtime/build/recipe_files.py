"""The recipe in its dataset: a pack of the recipe, the files that it uses, and its lockfile.

A copied dataset can therefore be verified and built again without other files. All assets are included; the compiler
limits their total size to 128 MiB. The manifest lists the pack, and `verify` checks that its recipe compiles to the
dataset's plan.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

from recipe_compiler.ir.lockfile import Lockfile

from recipe_runtime.transfer.bundle import Pack


@dataclass(frozen=True)
class RecipeFiles:
    """The files of a recipe by path relative to its folder, as read when it was compiled, and its lockfile `lock`."""

    recipe: str
    files: Mapping[str, bytes]
    lock: Lockfile | None = None

    def __post_init__(self) -> None:
        """Raise InputError, before any work, if a file cannot be part of a pack."""
        self.pack("", "")

    def pack(self, name: str, identity: str) -> bytes:
        """Return the pack for the dataset with that name and identity; it holds the lockfile if that has them, too."""
        found, lock = dict(self.files), self.lock
        if lock is not None and lock.sealed and lock.identity == identity:
            digests = {path: hashlib.sha256(body).hexdigest() for path, body in self.files.items()}
            packed = replace(lock, source=f"../{self.recipe}", files=digests)
            found[f"lockfiles/{name}.lock"] = packed.dumps().encode()
        return Pack(self.recipe, found).dumps()
