"""Uploads a dataset to a store, or copies it to another folder of this host.

A place contains a dataset if it contains its manifest, which is written last. During an upload to a store, the file
`.recipe-upload.json` takes its place: a manifest whose files have the listed content if they have the listed size.
That is true because files that differ from the new dataset are deleted after the old manifest has become this file,
and before the new one does. From it an interrupted upload is resumed, on any host.

Files with equal content are sent once and then copied within the store. Files that are there with the same digest are
kept. A folder of this host is written next to its place and put there by a rename (`StagedFolder`).
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core import layout
from recipe_runtime.core.files import file_sha256, regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import StagedFolder, check_apart, check_place, ignore
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import listed_files
from recipe_runtime.dataset.manifest_reader import FILES
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.transfer.stores import Store

MARKER = ".recipe-upload.json"
_OWN = {layout.MANIFEST, MARKER}  # files that no manifest lists

Rows = Mapping[str, tuple[int, str]]  # size and SHA-256 by path


@dataclass(frozen=True)
class Copied:
    """The numbers of files that were sent, copied within the store, and kept."""

    sent: int
    copied: int
    kept: int


class Target:
    """A place for one dataset.

    Args:
        url: the place.
        root: the dataset's folder, which may not exist yet.

    Attributes:
        url: the place, without secrets.
        folder: the place, if it is on a disk of this host; else None.

    Raises:
        InputError: the URL does not lead to a usable place, or to one that contains `root` or is in it.
        RunError: access is refused.
    """

    def __init__(self, url: str, root: Path) -> None:
        self._store, self._root = Store(url), root.absolute()
        self.url, self.folder = self._store.url, self._store.folder
        if self.folder is not None:
            check_apart(self.folder, root, "where the dataset is built")
            check_place(self.folder)
        with self._reported():
            self._look()
            if self.folder is not None:  # fail before the build, not after it, if the place is not writable
                tempfile.TemporaryFile(dir=next(above for above in self.folder.parents if above.is_dir())).close()
            elif not self._sizes:
                self._store.write(MARKER, b"{}")

    def check_replaceable(self, recipe: str) -> None:
        """Check that an existing dataset here, complete or not, belongs to a recipe with this name.

        Raises:
            InputError: it belongs to another recipe.
        """
        name = str(self._existing["recipe"])[:100] if self._existing else recipe
        if name != recipe:
            raise InputError(
                f"{self.url} holds the dataset of another recipe, {name!r}, and this is {recipe!r}",
                help="choose another place, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )

    def put(self, progress: Progress, *, replace: bool = False, notice: Callable[[str], None] = ignore) -> Copied:
        """Upload the dataset, in place of an existing one of the same recipe.

        Args:
            progress: reports progress in files.
            replace: whether the dataset of another recipe may be replaced.
            notice: called with a line of text if a replaced folder is kept.

        Returns:
            How many files were sent, copied and kept.

        Raises:
            InputError: the existing content is not a dataset or, unless `replace`, the dataset of another recipe.
            RunError: the upload failed, and the next one resumes it.
        """
        body = (self._root / layout.MANIFEST).read_bytes()
        manifest: Manifest = json.loads(body)
        rows = listed_files(manifest)
        with self._reported():
            self._look()  # again: another upload may have ended during the build
            if not replace:
                self.check_replaceable(manifest["recipe"])
            sizes = {path: size for path, (size, _) in rows.items()} | {
                layout.MANIFEST: self._sizes.get(layout.MANIFEST)
            }
            if self._existing == manifest and self._sizes == sizes:
                return Copied(0, 0, len(rows))
            if self.folder is None:
                return self._put_remote(body, rows, progress)
            recipe, key = manifest["recipe"], hashlib.sha256(body).hexdigest()
            with StagedFolder(self.folder, FILES, owner=recipe, key=key, replace=replace, notice=notice) as staged:
                copied = self._put_staged(self.folder, staged.files, body, rows, progress)
                staged.publish()
            return copied

    def _look(self) -> None:
        """Read which files are at the place, and the manifest of the dataset there, complete or not."""
        if self.folder is not None:
            StagedFolder(self.folder, FILES).settle()
        self._sizes = self._store.sizes()
        self._existing = self._manifest(layout.MANIFEST) or self._manifest(MARKER)
        if self._sizes and self._existing is None and MARKER not in self._sizes:
            raise InputError(f"{self.url} holds files but no {layout.MANIFEST} of a dataset; name another place")

    def _manifest(self, name: str) -> Manifest | None:
        """Return the manifest in a file of the place; None if there is no valid one."""
        if name not in self._sizes or (self.folder is not None and regular_file(self.folder, name) is None):
            return None
        try:
            with self._store.open(name) as file:
                manifest = manifest_reader.parse(file)
            listed_files(manifest)
            return manifest
        except (FileNotFoundError, ValueError):
            return None

    def _put_remote(self, body: bytes, rows: Rows, progress: Progress) -> Copied:
        """Upload to a store, and remove files that only the earlier dataset has."""
        store, there = self._store, listed_files(self._existing) if self._existing else {}
        kept = {path for path, row in rows.items() if there.get(path) == row and self._sizes.get(path) == row[0]}
        others = sorted(self._sizes.keys() - kept - _OWN)
        foreign = [path for path in others if path not in there and path not in rows]
        if foreign:
            raise InputError(f"{self.url} holds a file that is not the dataset's, {foreign[0]!r}; move it away first")
        if layout.MANIFEST in self._sizes:
            store.write(MARKER, json.dumps(self._existing).encode())
            store.remove(layout.MANIFEST)
        store.each(store.remove, others)
        store.write(MARKER, body)
        copied = self._send(store, rows, kept, progress)
        store.write(layout.MANIFEST, body)
        store.remove(MARKER)
        return copied

    def _put_staged(self, there: Path, folder: Path, body: bytes, rows: Rows, progress: Progress) -> Copied:
        """Write the dataset to a work folder, with links to the unchanged files of the one that it replaces."""
        known, written = listed_files(self._existing) if self._existing else {}, regular_file(there, layout.MANIFEST)
        for path, row in rows.items():
            found = regular_file(there, path) if known.get(path) == row else None
            if found and written and found.st_size == row[0] and found.st_mtime_ns <= written.st_mtime_ns:
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                with suppress(OSError):  # it exists, or the file system has no links, and the file is copied
                    os.link(there / path, folder / path)
        store = Store(f"file://{folder}")
        sizes = store.sizes()
        kept = {path for path, (size, _) in rows.items() if sizes.get(path) == size}
        store.each(store.remove, sizes.keys() - kept)
        copied = self._send(store, rows, kept, progress)
        store.write(layout.MANIFEST, body)
        return copied

    def _send(self, store: Store, rows: Rows, kept: set[str], progress: Progress) -> Copied:
        """Send the files that are not kept, each distinct content once, then copy the others within the store."""
        missing, firsts = [path for path in rows if path not in kept], dict[tuple[int, str], str]()
        for path in missing:
            firsts.setdefault(rows[path], path)
        copies = [path for path in missing if firsts[rows[path]] != path]

        def send(path: str) -> None:
            if file_sha256(self._root / path) != rows[path][1]:
                raise InputError(
                    f"{self._root / path} differs from its SHA-256 in the manifest",
                    help="repair the dataset",
                    code=Code.INVALID_DATASET,
                )
            store.send(self._root / path, path)

        def copy(path: str) -> None:
            try:
                store.copy(firsts[rows[path]], path)
            except NotImplementedError:  # some stores do not copy, and get the file again
                send(path)

        store.each(send, firsts.values(), lambda done: progress("copy", done, len(missing)))
        store.each(copy, copies, lambda done: progress("copy", len(firsts) + done, len(missing)))
        return Copied(len(firsts), len(copies), len(kept))

    def _reported(self) -> AbstractContextManager[None]:
        return self._store.reported("try again: uploaded files are kept")
