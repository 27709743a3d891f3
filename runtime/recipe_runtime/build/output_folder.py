"""Checks that a dataset may be put in place of a folder, so that no file is removed that is not a dataset's."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core import layout
from recipe_runtime.core.files import entries_below, holds_current_folder, is_folder, remove_tree, resolved
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import listed_files
from recipe_runtime.dataset.manifest_types import Manifest


def check_out(out: Path, caches: Collection[Path] = ()) -> None:
    """Check that a dataset can be put in place of `out`.

    Args:
        out: the dataset's folder.
        caches: folders in which files are created during a build.

    Raises:
        InputError: `out` exists and is not a dataset of this program, or contains other files as well; or a parent of
            it is a file; or it contains the current folder, or is to contain a cache.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise InputError(f"{out} is not a folder", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    above = next((folder for folder in out.absolute().parents if os.path.lexists(folder)), None)
    if above is not None and not above.is_dir():
        what = "a symbolic link that leads to no folder" if above.is_symlink() else "a file"
        raise InputError(f"{out}: {above} is {what}", help="choose another folder", code=Code.OUTPUT_IN_THE_WAY)
    if out.is_mount():  # publishing is a rename, which cannot replace a mount point
        remedy = f"choose a folder in it, such as {out / 'dataset'}"
        raise InputError(f"{out} is a mount point", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
    if holds_current_folder(out):
        raise InputError(
            f"{out} is the current folder or contains it, and a build cannot replace that",
            help="build from another folder, or choose another one",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    for cache in caches:
        if resolved(cache).is_relative_to(resolved(out)):
            remedy = "choose another folder, or set RECIPE_CACHE to a folder outside of it"
            raise InputError(f"{out} contains the cache {cache}", help=remedy, code=Code.OUTPUT_IN_THE_WAY)
    if out.is_dir():
        check_files(out, out)


def check_files(folder: Path, name: Path) -> None:
    """Check that a folder is empty, or a dataset that contains no files but its own; some may be missing.

    Args:
        folder: the folder.
        name: its name in messages.

    Raises:
        InputError: it is no folder, or contains another file.
    """
    if not is_folder(folder):
        raise InputError(f"{name} is not a folder", help="move it away", code=Code.OUTPUT_IN_THE_WAY)
    if not any(folder.iterdir()):
        return
    manifest = read_manifest(folder)
    if manifest is None:
        raise _no_manifest(folder, name)
    try:
        known = {layout.MANIFEST, *listed_files(manifest)}
    except ValueError:
        known = {layout.MANIFEST}  # damaged: no other file here is then known to belong to the dataset
    found = (p.relative_to(folder).as_posix() for p in entries_below(folder) if p.is_symlink() or not p.is_dir())
    foreign = [path for path in found if path not in known]
    if foreign:
        raise InputError(
            f"{name} holds a file that is not the dataset's, {foreign[0]}; move it away before it is replaced"
        )


def remove_dataset(folder: Path) -> None:
    """Delete a dataset; its manifest goes last, so that `check_files` recognises what an interruption leaves."""
    for child in sorted(folder.iterdir()):
        if child.name != layout.MANIFEST:
            remove_tree(child)
    shutil.rmtree(folder)


def read_manifest(out: Path) -> Manifest | None:
    """Return the manifest in a folder; None if there is none, it is damaged, or another program wrote it."""
    try:
        return manifest_reader.read(out)
    except (OSError, ValueError):
        return None


def _no_manifest(folder: Path, name: Path) -> InputError:
    """Return the error for a folder with files in which no manifest of a dataset can be read."""
    message = f"{name} holds files but no {layout.MANIFEST} of a dataset"
    remedy = "move it away, or choose another folder"
    if (folder / layout.MANIFEST).exists():
        message = f"{name}: its {layout.MANIFEST} is damaged, or another program's"
        if not os.access(folder / layout.MANIFEST, os.R_OK):
            message = f"{name}: its {layout.MANIFEST} cannot be read: permission denied"
            remedy = "allow this user to read it"
    return InputError(message, help=remedy, code=Code.OUTPUT_IN_THE_WAY)
