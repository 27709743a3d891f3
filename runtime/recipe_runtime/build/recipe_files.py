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
class Replaced:
    """The dataset that a build replaces; its lockfile may be the only copy."""

    root: Path
    manifest: Manifest
    used: Collection[Path]  # the recipe's files and its lockfile, which may be in this dataset
    keep_lock: bool  # whether an only copy must not be lost

    def lock(self, plan: DatasetPlan) -> Lockfile | None:
        """Return its lockfile; None if there is none, or it is damaged or differs from its row in the manifest."""
        path = layout.recipe_lockfile(plan.recipe)
        try:
            if not has_content(self.root, path, *listed_files(self.manifest)[path]):
                return None
            found = lockfile.read(self.root / path, plan)
        except (InputError, OSError, *DAMAGE):
            return None
        return found if found.sealed else None

    def holds_used(self, path: str) -> bool:
        """Return whether one of the used files is the file at a path in this dataset."""
        if regular_file(self.root, path) is None:
            return False
        return any(file.exists() and file.samefile(self.root / path) for file in self.used)


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

    def with_lock_of(
        self, there: Replaced, plan: DatasetPlan, identity: str, trace_of: Callable[[ScenePlan], Trace]
    ) -> tuple[RecipeFiles, tuple[str, ...]]:
        """Return these files with a lockfile of the dataset to be built, if there is one, and lines to report.

        It is the recipe's own, or that of the dataset to be replaced. The latter is left out if its rows of bodies,
        which no identity covers, contradict this build's motion.

        Args:
            there: the dataset to be replaced.
            plan: the plan to build.
            identity: the identity of the dataset to be built.
            trace_of: returns the motion of a scene.

        Raises:
            InputError: the lockfile there is of another identity and would be removed, and may be the only copy.
        """
        path = layout.recipe_lockfile(plan.recipe)
        lock = None if there.holds_used(path) else self.lock
        if lock is not None and lock.sealed and lock.identity == identity:
            return self, ()
        files, earlier = replace(self, lock=None), there.lock(plan)
        if earlier is None:
            return files, ()
        if earlier.identity == identity:
            if _contradicts(earlier, plan, trace_of):
                return files, (f"{path} contradicts the motion of this build, and was left out",)
            return replace(self, lock=earlier), ()
        copied = lock is not None and lock.sealed and lock.plan == plan.digest
        if there.keep_lock and earlier.plan == plan.digest and not copied:
            raise InputError(
                f"{there.root} has a lockfile, {path}, of {earlier.identity}, and this host makes"
                f" {identity}: the lockfile would be removed",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
        return files, ()


def _contradicts(lock: Lockfile, plan: DatasetPlan, trace_of: Callable[[ScenePlan], Trace]) -> bool:
    """Return whether a lockfile has rows of bodies other than those of this plan's motion."""
    left = set(lock.bodies)
    for scene in simulations(plan) if left else ():
        motions = {(scene.digest, actor): row for actor, row in body_motions(trace_of(scene)).items()}
        left -= {key for key, row in motions.items() if lock.bodies.get(key) == row}
    return bool(left)


def asset_places(dataset: Dataset) -> dict[str, Path]:
    """Return the possible paths of a dataset's assets in its own folder, by digest; readers check the digests."""
    return {
        sha256: dataset.root / path
        for path, (_, sha256) in dataset.files.items()
        if layout.is_recipe_file(path) and regular_file(dataset.root, path) is not None
    }
