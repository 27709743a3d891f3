"""Compares the files of a dataset with its manifest, to find what `recipe build --repair` must render again.

A manifest is trusted if it belongs to the same plan and its digests match its identity. Frames with a file that differs
are rendered again, under all of their names. All text files and contact sheets are written again. The other files are
linked.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.build.workspace import Workspace
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset.manifest import is_of, listed_files
from recipe_runtime.dataset.manifest_reader import read_or_none
from recipe_runtime.dataset.reader import Dataset, check_rows, damaged_files, lock_of, recipe_file_of


@dataclass(frozen=True)
class Examined:
    """A dataset, and one line for each problem of its files."""

    held: Dataset
    damage: tuple[str, ...]

    def check(self, identity: str, work: Workspace) -> None:
        """Check that the repaired dataset has the identity of the original.

        Raises:
            RunError: the identity differs; the workspace is removed.
        """
        if identity != self.held.lock.identity:
            work.abandon()
            out = self.held.root
            raise RunError(
                f"{out}: its manifest says {self.held.lock.identity}, and this host makes {identity}; nothing was"
                f" changed. `recipe verify {out}` reports the first difference; to build it again, move it away"
            )


def examine(plan: DatasetPlan, out: Path, progress: Progress) -> Examined | None:
    """Hash every file of a dataset.

    None unless `out` is a dataset built from this plan by these tool versions, which can be read and is not too large.
    """
    manifest = read_or_none(out)
    try:
        if manifest is None or not is_of(manifest, plan):
            return None
        files = listed_files(manifest)
        check_rows(manifest, files, plan)
        held = Dataset(out, plan, lock_of(manifest), files, str(out), recipe_file_of(manifest, files))
    except ValueError:
        return None
    return Examined(held, tuple(line for _, line in damaged_files(held, progress)))
