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
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.core import layout
from recipe_runtime.core.files import has_content, regular_file
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.digests import body_motions
from recipe_runtime.dataset.manifest import DAMAGE, listed_files, stays_inside
from recipe_runtime.dataset.manifest_reader import MAX_PARTS
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.schedule import simulations

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

    def for_identity(
        self, identity: str, out: Path, plan: DatasetPlan, trace_of: Callable[[ScenePlan], Trace]
    ) -> RecipeFiles:
        """Return the files for a dataset with that identity, in place of the one at `out`.

        A lockfile there is left out if its rows of bodies, which no identity covers, contradict this build's motion.

        Raises:
            InputError: the lockfile is of another identity and would be removed, and may be the only copy.
        """
        lock = self.earlier_lock
        if lock is None or (self.lock is not None and self.lock.sealed and self.lock.identity == identity):
            return self
        if lock.identity != identity:
            if not self.must_keep_lock:
                return self
            raise InputError(
                f"{out} has a lockfile, {layout.recipe_lockfile(plan.recipe)}, of {lock.identity}, and this host makes"
                f" {identity}: the lockfile would be removed",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
        left = set(lock.bodies)
        for scene in simulations(plan) if left else ():
            motions = {(scene.digest, actor): row for actor, row in body_motions(trace_of(scene)).items()}
            left -= {key for key, row in motions.items() if lock.bodies.get(key) == row}
        return replace(self, earlier_lock=None) if left else self

    def left_out(self, manifest: Manifest) -> tuple[str, ...]:
        """Return a line if the lockfile of the replaced dataset is not in the new one, although it has its identity."""
        path = layout.recipe_lockfile(manifest["recipe"])
        if self.earlier_lock is None or self.earlier_lock.identity != manifest["identity"] or path in manifest["files"]:
            return ()
        return (f"{path} contradicts the motion of this build, and was left out",)


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Return the possible paths of a dataset's assets in its own folder, by digest; readers check the digests."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }
