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
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import layout
from recipe_runtime.core.files import has_content, regular_file
from recipe_runtime.dataset.manifest import MAX_PARTS, listed_files, stays_inside
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.reader import Dataset

MAX_BYTES = 256 << 20


@dataclass(frozen=True)
class RecipeFiles:
    """The files of a recipe by path relative to its folder, as read when it was compiled, and its lockfile `lock`.

    `only_lock` is whether the lockfile is in the dataset to be replaced, and must not be lost with it.
    """

    recipe: str
    files: Mapping[str, bytes]
    lock: Lockfile | None = None
    only_lock: bool = False

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

    def in_place_of(
        self,
        out: Path,
        manifest: Manifest,
        plan: DatasetPlan,
        used: Collection[Path],
        *,
        repaired: bool,
        replaced: bool,
    ) -> RecipeFiles:
        """Return the files for a dataset that replaces the one at `out`, whose lockfile may be the only copy.

        A lockfile there that is not the recipe's is never taken over: its rows may be anyone's.

        Args:
            out: the dataset's folder.
            manifest: its manifest.
            plan: the plan to build.
            used: the paths of the recipe's files and of its lockfile, which may be in `out`.
            repaired: whether a lockfile there that differs from the manifest may be lost.
            replaced: whether any may be lost.

        Raises:
            InputError: a lockfile at `out` would be lost.
        """
        path = layout.recipe_lockfile(plan.recipe)
        if regular_file(out, path) is None:
            return self
        own = any(file.exists() and file.samefile(out / path) for file in used)
        intact = has_content(out, path, *listed_files(manifest).get(path, (-1, "")))
        if not intact and (repaired or replaced):
            return replace(self, lock=None) if own else self
        if own:
            if not intact:
                raise _lost(out, path, "which differs from its digest in the manifest")
            return replace(self, only_lock=not replaced)
        if not replaced:
            try:
                there = lockfile.read(out / path, plan)
            except InputError:
                raise _lost(out, path, "which cannot be read") from None
            copied = self.lock is not None and self.lock.sealed and self.lock.identity == there.identity
            if there.sealed and there.plan == plan.digest and not copied:
                raise _lost(out, path, f"of {there.identity}, which {self.recipe} lacks")
        return self

    def check_lock_kept(self, out: Path, identity: str) -> None:
        """Check that a dataset with that identity keeps the only copy of the lockfile.

        Raises:
            InputError: the lockfile has another identity.
        """
        if self.only_lock and self.lock is not None and self.lock.identity != identity:
            what = f"of {self.lock.identity}, and this host makes {identity}"
            raise _lost(out, layout.recipe_lockfile(self.lock.recipe), what)


def _lost(out: Path, path: str, what: str) -> InputError:
    return InputError(
        f"{out} has a lockfile, {path}, {what}: it would be removed",
        help="copy it to the recipe's lockfiles/, or choose another folder, or replace it",
        code=Code.OUTPUT_IN_THE_WAY,
    )


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Return the possible paths of a dataset's assets in its own folder, by digest; readers check the digests."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }
