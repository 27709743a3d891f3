"""Downloads a dataset from any store that fsspec supports into a temporary folder.

The store is not trusted. It is read in a child process with limits (`download_process`). Only the files listed in the
manifest are read, each up to its listed size, and nothing is written outside the folder. Unlisted files are represented
by empty files of the same name, and files of another size by files of that size, so that verification of the folder
reports them. A `file://` URL is read in place.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath
from typing import Any

from recipe_compiler.ir.errors import Code, InputError, RunError

from recipe_runtime.core import layout, urls
from recipe_runtime.core.files import file_sha256
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import listed_files, stays_inside
from recipe_runtime.dataset.manifest_reader import MAX_BYTES
from recipe_runtime.dataset.plan_checks import MAX_FILES
from recipe_runtime.transfer import download_process
from recipe_runtime.transfer.upload import connections, located, reported_errors, scheme_of

MAX_LISTED_BEYOND = 100_000  # limit of entries in a dataset's folders, beyond the number of listed files
MAX_SURPLUS = 1_000  # limit of surplus files that are represented
_PIECE = 1 << 20
_UNKNOWN = -1  # size of a file whose store does not report it
_LARGEST = 1 << 40  # files of at least this size are not downloaded
_LISTLESS = ("http", "https")
_LOCAL = ("file", "local")
_OF_THIS_PROCESS = ("memory",)  # other stores are read in a child process


@contextmanager
def fetched(url: str, progress: Progress) -> Iterator[Path]:
    """Yield a folder with the content of the dataset at a URL.

    Args:
        url: an fsspec URL of a dataset's folder.
        progress: reports progress in bytes.

    Raises:
        InputError: there is no dataset, or its manifest is damaged.
        RunError: the store or this host fails, or the dataset is replaced while it is read.
    """
    shown = urls.shown(url)
    if scheme_of(url) in _LISTLESS:
        raise InputError(f"{shown}: a web server does not list its files; download the dataset, then name its folder")
    if scheme_of(url) in _LOCAL:
        with reported_errors(url, "try again"):
            place = Path(located(url)[1])
        with manifest_reader.not_replaced(place, shown):
            yield place
        return
    with tempfile.TemporaryDirectory(prefix="recipe-fetch-") as folder:
        root = Path(folder) / "dataset"
        root.mkdir()
        if scheme_of(url) in _OF_THIS_PROCESS:
            download(url, root, progress)
        else:
            download_process.run(url, root, progress)
        yield root


def download(url: str, root: Path, progress: Progress, beat: Callable[[], None] = lambda: None) -> None:
    """Download the dataset at a URL into a folder, in this process.

    Args:
        url: an fsspec URL of a dataset's folder.
        root: an empty folder.
        progress: reports progress in files.
        beat: called after each listing and each MiB.
    """
    with reported_errors(url, "try again"):
        fs, prefix = located(url)
        _Fetch(urls.shown(url), fs, prefix.rstrip("/"), root, beat).all(progress)


class _Fetch:
    def __init__(self, url: str, fs: Any, prefix: str, root: Path, beat: Callable[[], None]) -> None:
        self._url, self._fs, self._prefix, self._root, self._beat = url, fs, prefix, root, beat

    def all(self, progress: Progress) -> None:
        rows = self._manifest()
        folders = {parent.as_posix() for path in rows for parent in PurePosixPath(path).parents}
        for path in sorted(folders & {*rows, layout.MANIFEST}):
            raise InputError(f"{self._url}: {path} cannot be a file and a folder; its manifest is damaged")
        sizes = dict(self._entries(folders))
        self._check_free_space(sum(size for path, (size, _) in rows.items() if sizes.get(path) in (size, _UNKNOWN)))
        wanted = [path for path in rows if sizes.get(path) is not None and path != layout.MANIFEST]
        progress("fetch", 0, len(wanted))
        with ThreadPoolExecutor(connections(self._fs)) as threads:
            tasks = [threads.submit(self._download_file, path, rows[path][0], sizes[path] or 0) for path in wanted]
            try:
                for done, task in enumerate(as_completed(tasks), start=1):
                    task.result()
                    progress("fetch", done, len(wanted))
            except BaseException:
                threads.shutdown(wait=True, cancel_futures=True)
                raise
        if not self._has_manifest():
            raise manifest_reader.replaced(self._url)
        self._represent_surplus(sizes, {*rows, layout.MANIFEST})

    def _manifest(self) -> dict[str, tuple[int, str]]:
        """Download the manifest and return the files that it lists."""
        size = None
        with suppress(FileNotFoundError, NotImplementedError):  # not every store reports sizes
            size = self._fs.size(f"{self._prefix}/{layout.MANIFEST}")
        if size is not None and size > MAX_BYTES:
            raise InputError(
                f"{self._url}: its {layout.MANIFEST} has {size:,} bytes, and at most {MAX_BYTES:,} are fetched"
            )
        try:
            self._copy(layout.MANIFEST, MAX_BYTES)
        except FileNotFoundError:
            raise InputError(
                f"{self._url} is not a dataset: it holds no {layout.MANIFEST}", code=Code.INVALID_DATASET
            ) from None
        try:
            return listed_files(manifest_reader.read(self._root))
        except manifest_reader.NotAManifestError:
            raise InputError(
                f"{self._url} is not a dataset: its {layout.MANIFEST} is not from this project",
                code=Code.INVALID_DATASET,
            ) from None
        except ValueError as error:
            raise InputError(
                f"{self._url}: its {layout.MANIFEST} is damaged ({error})", code=Code.INVALID_DATASET
            ) from None

    def _has_manifest(self) -> bool:
        """Return whether the store still has the manifest that was downloaded; an upload removes it first."""
        left, found = MAX_BYTES + 1, hashlib.sha256()
        place = f"{self._prefix}/{layout.MANIFEST}"
        with suppress(FileNotFoundError), self._fs.open(place, "rb", block_size=_PIECE) as file:
            while left and (piece := file.read(min(left, _PIECE))):
                found.update(piece)
                left -= len(piece)
                self._beat()
        return found.hexdigest() == file_sha256(self._root / layout.MANIFEST)

    def _entries(self, folders: set[str]) -> Iterator[tuple[str, int | None]]:
        """Yield every entry of the manifest's folders, with the size of a file, or None for a further folder."""
        waiting, left = ["."], MAX_FILES + MAX_LISTED_BEYOND
        while waiting:
            folder = waiting.pop()
            head = f"{self._prefix}/" if folder == "." else f"{self._prefix}/{folder}/"
            try:
                rows = self._fs.ls(head.rstrip("/"), detail=True)
            except (FileNotFoundError, NotADirectoryError):
                continue
            self._beat()
            left -= len(rows)
            if left < 0:
                raise InputError(f"{self._url} holds far more files than a dataset; remove the others")
            for row in rows:
                name = str(row["name"]).rstrip("/")
                if name == head.rstrip("/"):  # some stores keep an empty object for a folder
                    continue
                path = ("" if folder == "." else f"{folder}/") + name.removeprefix(head)
                if not name.startswith(head) or "/" in name[len(head) :] or not stays_inside(path):
                    raise InputError(
                        f"{self._url} holds {ascii(name)[:200]}, which is not a path in a dataset; remove it"
                    )
                if row["type"] == "directory":
                    waiting += [path] if path in folders else []
                    yield path, None
                else:
                    yield path, _UNKNOWN if row.get("size") is None else min(max(int(row["size"]), 0), _LARGEST)

    def _check_free_space(self, total: int) -> None:
        free = shutil.disk_usage(self._root).free
        if total > free:
            raise RunError(
                f"{self._url}: its files take {total / 2**20:,.1f} MiB, and {tempfile.gettempdir()} has"
                f" {free / 2**20:,.1f} MiB left; set TMPDIR to a folder with more space"
            )

    def _download_file(self, path: str, listed: int, size: int) -> None:
        """Download a file, at most its listed size; a file that has disappeared is skipped."""
        if size in (listed, _UNKNOWN):
            try:
                self._copy(path, max(listed, 0))
            except FileNotFoundError:  # deleted since it was listed; verification of the folder reports it
                (self._root / path).unlink(missing_ok=True)
        else:
            self._make(path).close()
            os.truncate(self._root / path, size)  # sparse, so it takes no space

    def _copy(self, path: str, most: int) -> None:
        """Copy a file, at most one byte more than its limit."""
        with self._fs.open(f"{self._prefix}/{path}", "rb", block_size=_PIECE) as source, self._make(path) as target:
            left = most + 1
            while left and (piece := source.read(min(left, _PIECE))):
                target.write(piece)
                left -= len(piece)
                self._beat()

    def _make(self, path: str) -> Any:
        place = self._root / path
        place.parent.mkdir(parents=True, exist_ok=True)
        return place.open("xb")

    def _represent_surplus(self, sizes: dict[str, int | None], known: set[str]) -> None:
        """Create an empty file or folder for each entry that the manifest does not list."""
        surplus = [path for path in sorted(sizes) if path not in known and not (self._root / path).exists()]
        for path in surplus[:MAX_SURPLUS]:
            if sizes[path] is None:
                (self._root / path).mkdir(parents=True, exist_ok=True)
            else:
                self._make(path).close()
