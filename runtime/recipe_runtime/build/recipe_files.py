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
from recipe_runtime.dataset.manifest import DAMAGE, listed_files, stays_inside
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.reader import Dataset

MAX_BYTES = 256 << 20


@dataclass(frozen=True)
class RecipeFiles:
    """The files of a recipe by path relative to its folder, as read when it was compiled, and its lockfile `lock`.

    `earlier_lock` is that of the dataset to be replaced, and `must_keep_lock` whether it may be the only copy.
    """

    recipe: str
    files: Mapping[str, bytes]
    lock: Lockfile | None = None
    earlier_lock: Lockfile | None = None
    must_keep_lock: bool = False

    def __post_init__(self) -> None:
        """Check the names and the total size of the files.

        Raises:
            InputError: a file cannot be part of a dataset.
        """
        for path in self.files:
            if not stays_inside(path):
                raise InputError(f"{path!r} cannot be a file of a dataset; rename it with plain, printable characters")
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
        for lock in (self.lock, self.earlier_lock):
            if lock is not None and lock.sealed and lock.identity == identity:
                digests = {path: hashlib.sha256(body).hexdigest() for path, body in self.files.items()}
                moved = replace(lock, source=f"../{self.recipe}", files=digests)
                found[layout.recipe_lockfile(name)] = moved.dumps().encode()
                break
        return found

    def with_lock_of(
        self, out: Path, manifest: Manifest | None, plan: DatasetPlan, used: Collection[Path]
    ) -> RecipeFiles:
        """Return these files with the lockfile in the dataset at `out`, if it is intact; it may be the only copy.

        Args:
            out: the dataset's folder.
            manifest: its manifest; None if there is no dataset.
            plan: the plan to build.
            used: the paths of the recipe's files and of its lockfile `lock`.
        """
        path = layout.recipe_lockfile(plan.recipe)
        if manifest is None or regular_file(out, path) is None:
            return self
        own = any(file.exists() and file.samefile(out / path) for file in used)
        files = replace(self, lock=None) if own else self
        try:
            if not has_content(out, path, *listed_files(manifest)[path]):
                return files
            earlier = lockfile.read(out / path, plan)
        except (InputError, OSError, *DAMAGE):
            return files
        copied = files.lock is not None and files.lock.sealed and files.lock.plan == plan.digest
        must_keep = not copied and earlier.sealed and earlier.plan == plan.digest
        return replace(files, earlier_lock=earlier, must_keep_lock=must_keep)

    def check_lock_kept(self, out: Path, identity: str) -> None:
        """Check that a dataset with that identity, in place of the one at `out`, has the lockfile there.

        Raises:
            InputError: the lockfile is of another identity and would be removed, and may be the only copy.
        """
        if self.must_keep_lock and self.earlier_lock and self.earlier_lock.identity != identity:
            path = layout.recipe_lockfile(self.earlier_lock.recipe)
            raise InputError(
                f"{out} has a lockfile, {path}, of {self.earlier_lock.identity}, and this host makes {identity}: the"
                " lockfile would be removed",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Return the possible paths of a dataset's assets in its own folder, by digest; readers check the digests."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }
