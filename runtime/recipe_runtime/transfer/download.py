"""Downloads a dataset from a store into a temporary folder.

What the store contains is not trusted. Only the files listed in the manifest are read, each up to its listed size, and
nothing is written outside the folder. Unlisted files are represented by empty files of the same name, and files of
another size by files of that size, so that verification of the folder reports them. A `file://` URL is read in place.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core import layout
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import listed_files
from recipe_runtime.dataset.manifest_reader import MAX_BYTES
from recipe_runtime.transfer.stores import PIECE, Store

MAX_SHOWN = 1_000  # limit of surplus files that are represented


@contextmanager
def fetched(url: str, progress: Progress) -> Iterator[Path]:
    """Yield a folder with the content of the dataset at a URL.

    Args:
        url: the URL of a dataset's folder.
        progress: reports progress in files.

    Raises:
        InputError: there is no dataset, or its manifest is damaged.
        RunError: the store or this host fails.
    """
    store = Store(url)
    if store.folder is not None:
        yield store.folder
        return
    with tempfile.TemporaryDirectory(prefix="recipe-fetch-") as folder:
        root = Path(folder) / "dataset"
        root.mkdir()
        with store.reported("try again"):
            _Download(store, root).all(progress)
        yield root


class _Download:
    def __init__(self, store: Store, root: Path) -> None:
        self._store, self._url, self._root = store, store.url, root

    def all(self, progress: Progress) -> None:
        rows, sizes = self._manifest(), self._store.sizes()
        self._check_free_space(sum(size for path, (size, _) in rows.items() if sizes.get(path) == size))
        wanted = [path for path in rows if path in sizes and path != layout.MANIFEST]
        progress("fetch", 0, len(wanted))
        self._store.each(
            lambda path: self._fetch(path, rows[path][0], sizes[path]),
            wanted,
            lambda done: progress("fetch", done, len(wanted)),
        )
        self._represent_surplus(sorted(sizes.keys() - {*rows, layout.MANIFEST}))

    def _manifest(self) -> dict[str, tuple[int, str]]:
        """Download the manifest and return the files that it lists."""
        try:
            self._copy(layout.MANIFEST, MAX_BYTES)
        except FileNotFoundError:
            raise InputError(
                f"{self._url} is not a dataset: it holds no {layout.MANIFEST}", code=Code.INVALID_DATASET
            ) from None
        try:
            rows = listed_files(manifest_reader.read(self._root))
            if any(path.startswith(f"{layout.MANIFEST}/") for path in rows):
                raise ValueError(f"{layout.MANIFEST} is listed as a folder")
            return rows
        except manifest_reader.NotAManifestError:
            raise InputError(
                f"{self._url} is not a dataset: its {layout.MANIFEST} is not from this project",
                code=Code.INVALID_DATASET,
            ) from None
        except ValueError as error:
            raise InputError(
                f"{self._url}: its {layout.MANIFEST} is damaged ({error})", code=Code.INVALID_DATASET
            ) from None

    def _check_free_space(self, total: int) -> None:
        free = shutil.disk_usage(self._root).free
        if total > free:
            raise RunError(
                f"{self._url}: its files take {total / 2**20:,.1f} MiB, and {tempfile.gettempdir()} has"
                f" {free / 2**20:,.1f} MiB left; set TMPDIR to a folder with more space"
            )

    def _fetch(self, path: str, listed: int, size: int) -> None:
        """Download a file, at most its listed size."""
        if size == listed:
            self._copy(path, listed)
        else:
            self._make(path).close()
            os.truncate(self._root / path, size)  # sparse, so it takes no space

    def _copy(self, path: str, most: int) -> None:
        """Copy a file, at most one byte more than its limit."""
        with self._store.open(path) as source, self._make(path) as target:
            for piece in _pieces(source, most):
                target.write(piece)

    def _represent_surplus(self, surplus: list[str]) -> None:
        """Create an empty file for each one that the manifest does not list.

        Raises:
            InputError: an object store has both `a` and `a/b`, which no folder can represent.
        """
        for path in surplus[:MAX_SHOWN]:
            try:
                self._make(path).close()
            except (FileExistsError, NotADirectoryError):
                raise InputError(f"{self._url} holds {path} twice: as a file and as a folder; remove it") from None

    def _make(self, path: str) -> BinaryIO:
        place = self._root / path
        place.parent.mkdir(parents=True, exist_ok=True)
        return place.open("xb")


def _pieces(file: BinaryIO, most: int) -> Iterator[bytes]:
    """Yield the content of a file, at most one byte more than its limit."""
    left = most + 1
    while left and (piece := file.read(min(left, PIECE))):
        yield piece
        left -= len(piece)
