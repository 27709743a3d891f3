"""Uploads a dataset to any store that fsspec supports, such as S3, Google Cloud Storage or another folder.

A prefix contains a dataset if it contains its manifest, which is written last. During an upload, a marker file
`.recipe-upload.json` takes its place. Files that exist with the same digest are kept; files with equal content are sent
once and then copied within the store. An interrupted upload is resumed: sent files are recorded next to the local
dataset.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import fsspec
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, RecipeError, RunError

from recipe_runtime.core import layout, urls
from recipe_runtime.core.files import file_sha256, regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import DAMAGE, listed_files
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.transfer import local_place
from recipe_runtime.transfer.upload_journal import UNKNOWN, Rows, UploadJournal

MARKER = ".recipe-upload.json"
_NEW_MARKER = f"{MARKER}.new"  # on a local disk, until it is renamed
_OWN = {layout.MANIFEST, MARKER, _NEW_MARKER}  # files that no manifest lists
SCHEMES = (
    "s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "file", "local", "memory", "ftp", "sftp", "ssh", "hdfs",
    "webhdfs", "smb", "oci", "oss", "http", "https",
)  # fmt: skip
_MAX_MARKER = 10_000  # bytes
_AT_ONCE = 8  # concurrent transfers
_ONE_CONNECTION = "ftp"  # fsspec's file system for it has one connection, which two threads cannot use at once
_S3, _GCS = "s3fs>=2024.6", "gcsfs>=2024.6"  # must equal the extras s3 and gcs of pyproject.toml
_LIBRARIES = {"s3": _S3, "s3a": _S3, "gs": _GCS, "gcs": _GCS}


@dataclass(frozen=True)
class Copied:
    """The numbers of files that were sent, copied within the store, and kept."""

    sent: int
    copied: int
    kept: int


class Target:
    """A remote place for one dataset.

    Args:
        url: the place.
        root: the dataset's folder, which may not exist yet.

    Attributes:
        folder: the place, if it is on a local disk; else None.
        existing: the manifest of the dataset at the place; None if there is none.

    Raises:
        InputError: the URL does not lead to a usable place, or to one within a dataset or in the way of `root`.
        RunError: access is refused.
    """

    def __init__(self, url: str, root: Path) -> None:
        self._root = root.absolute()
        self._full = url.rstrip("/")
        self.url = urls.shown(self._full)
        if self._full.partition("://")[0].lower() in ("http", "https"):
            raise InputError(
                f"{self.url}: a web server does not accept files", help="name a store, such as s3://bucket/name"
            )
        with self._reported():
            self._fs, self._prefix = located(self._full)
        self.folder = Path(self._prefix) if "file" in self._fs.protocol else None
        if self.folder is not None:
            local_place.check_local_place(self.folder, root)
        with self._reported():
            self.existing = self._manifest()
        found = self._sizes()
        if found and self.existing is None and not found.keys() & {MARKER, _NEW_MARKER}:
            raise InputError(f"{self.url} holds files but no {layout.MANIFEST} of a dataset; name another place")
        if not found:
            with self._reported():
                self._write_marker(b"{}")  # fail before the build, not after it, if the place is not writable

    def check_replaceable(self, recipe: str) -> None:
        """Check that an existing dataset here belongs to a recipe with this name.

        Raises:
            InputError: it belongs to another recipe.
        """
        name = str(self.existing.get("recipe"))[:100] if self.existing else recipe
        if name != recipe:
            raise InputError(
                f"{self.url} holds the dataset of another recipe, {name!r}, and this is {recipe!r}",
                help="choose another place, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )

    def put(self, progress: Progress, *, replace: bool = False) -> Copied:
        """Upload the dataset, in place of an existing one of the same recipe.

        Args:
            progress: reports progress in bytes.
            replace: whether the dataset of another recipe may be replaced.

        Returns:
            How many files were sent, copied and kept.

        Raises:
            InputError: the existing content is not a dataset or, unless `replace`, the dataset of another recipe.
            RunError: the upload failed, and the next one resumes it; or another one to this place runs or has run.
        """
        if self.folder is None:
            return self._put(progress, replace=replace)
        with self._reported(), local_place.locked(self.folder):
            return self._put(progress, replace=replace)

    def _put(self, progress: Progress, *, replace: bool) -> Copied:
        root = self._root
        body = (root / layout.MANIFEST).read_bytes()
        manifest: Manifest = json.loads(body)
        with self._reported():
            self.existing = self._manifest()  # again: another upload may have ended during the build
        if not replace:
            self.check_replaceable(manifest["recipe"])
        rows, sizes = listed_files(manifest), self._sizes()
        if self.existing == manifest and self._is_complete(rows, sizes):
            self._remove_empty_folders()
            return Copied(0, 0, len(rows))
        journal = UploadJournal(root, self._full)
        with self._reported():
            known = listed_files(self.existing) if self.existing else journal.rows(self._marker_token())
        foreign = sorted(set(sizes) - set(known) - set(rows) - _OWN)
        if foreign:
            raise InputError(f"{self.url} holds a file that is not the dataset's, {foreign[0]!r}; move it away first")
        missing = [path for path, row in rows.items() if known.get(path) != row or sizes.get(path) != row[0]]
        with self._reported():
            there = {p: row if sizes[p] == row[0] else UNKNOWN for p, row in known.items() if p in sizes}
            token = journal.begin(there | dict.fromkeys(missing, UNKNOWN))
            self._write_marker(canonical_bytes({"dataset": manifest["identity"], "copy": token}))
            if self.existing is not None:
                self._fs.rm_file(self._at(layout.MANIFEST))
            copied = self._send(token, rows, missing, journal, progress)
            for path in sorted(set(sizes) - set(rows) - _OWN):
                self._fs.rm_file(self._at(path))
            self._remove_empty_folders()
            self._check_alone(token)
            if self._fs.exists(self._at(layout.MANIFEST)):
                raise self._overtaken()
            self._write(layout.MANIFEST, body)
            self._fs.rm_file(self._at(MARKER))
        journal.close()
        return Copied(len(missing) - copied, copied, len(rows) - len(missing))

    def _check_alone(self, token: str) -> None:
        """Raise RunError if another upload to this place began or ended since this one wrote its marker."""
        if self._marker_token() != token:
            raise self._overtaken()

    def _overtaken(self) -> RunError:
        message = "another upload to this place ran at the same time; upload again when it has ended"
        return RunError(f"{self.url}: {message}")

    def _send(self, token: str, rows: Rows, missing: list[str], journal: UploadJournal, progress: Progress) -> int:
        """Send missing files, each distinct content once, then copy the others within the store.

        Return the number of copies.
        """
        firsts: dict[tuple[int, str], str] = {}
        for path in missing:
            firsts.setdefault(rows[path], path)
        duplicates = [path for path in missing if firsts[rows[path]] != path]
        done = 0
        for batch in (list(firsts.values()), duplicates):
            with ThreadPoolExecutor(connections(self._fs)) as threads:
                tasks = [
                    threads.submit(self._place_file, token, path, firsts[rows[path]], rows[path]) for path in batch
                ]
                try:
                    for task in as_completed(tasks):
                        journal.record(*task.result())
                        done += 1
                        progress("copy", done, len(missing))
                except BaseException:
                    threads.shutdown(wait=True, cancel_futures=True)
                    for task in tasks:  # record what was sent nevertheless
                        if not task.cancelled() and task.exception() is None:
                            journal.record(*task.result())
                    raise
        return len(duplicates)

    def _place_file(self, token: str, path: str, first: str, row: tuple[int, str]) -> tuple[str, tuple[int, str]]:
        """Send a file, or copy the equal file `first` within the store.

        Return the path and row of the file now in place.
        """
        root = self._root
        self._check_alone(token)  # for each file: a program that was suspended must not write over a newer upload
        if path != first:
            with suppress(NotImplementedError):  # some stores do not copy, and get the file again
                self._prepare(path)
                self._fs.cp_file(self._at(first), self._at(path))
                return path, row
        if file_sha256(root / path) != row[1]:
            raise InputError(
                f"{root / path} differs from its SHA-256 in the manifest",
                help="repair the dataset",
                code=Code.INVALID_DATASET,
            )
        self._prepare(path)
        self._fs.put_file(str(root / path), self._at(path))
        return path, row

    def _write(self, path: str, body: bytes) -> None:
        self._prepare(path)
        self._fs.pipe_file(self._at(path), body)

    def _write_marker(self, body: bytes) -> None:
        """Write the marker in one step: files without a marker and a manifest are not taken for a dataset's."""
        if self.folder is None:
            self._write(MARKER, body)
            return
        self._write(_NEW_MARKER, body)
        (self.folder / _NEW_MARKER).replace(self.folder / MARKER)

    def _prepare(self, path: str) -> None:
        """Create the folder of a file on a local disk, and remove an existing file, which may be a hard link.

        Raises:
            InputError: a folder below the prefix is a symbolic link.
        """
        if "file" not in self._fs.protocol:
            return
        folder = Path(self._prefix)
        for name in PurePosixPath(path).parent.parts:
            folder /= name
            if folder.is_symlink():
                raise InputError(
                    f"{folder} is a symbolic link, and datasets are not written through links",
                    help="remove the link, or choose another place",
                    code=Code.OUTPUT_IN_THE_WAY,
                )
        folder.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            self._fs.rm_file(self._at(path))

    def _remove_empty_folders(self) -> None:
        """Remove folders without a file on a local disk, which `verify` reports; interrupted uploads leave them."""
        for folder, _, _ in os.walk(self.folder, topdown=False) if self.folder else ():
            if Path(folder) != self.folder:
                with suppress(OSError):  # it is not empty
                    Path(folder).rmdir()

    def _is_file(self, path: str) -> bool:
        """Return whether a path can be read; on a local disk pipes and links cannot."""
        return "file" not in self._fs.protocol or regular_file(Path(self._prefix), path) is not None

    def _marker_token(self) -> str | None:
        """Return the token of the unfinished upload in the marker file, or None."""
        if not self._is_file(MARKER):
            return None
        try:
            return str(json.loads(self._fs.cat_file(self._at(MARKER), end=_MAX_MARKER))["copy"])
        except (FileNotFoundError, *DAMAGE):
            return None

    def _is_complete(self, rows: Rows, sizes: Mapping[str, int]) -> bool:
        return set(sizes) == {*rows, layout.MANIFEST} and all(sizes[path] == size for path, (size, _) in rows.items())

    def _sizes(self) -> dict[str, int]:
        """Return the sizes of all files below the prefix."""
        with self._reported():
            try:
                found = self._fs.find(self._prefix, detail=True)
            except FileNotFoundError:
                return {}
        head = self._prefix.rstrip("/") + "/"
        return {name[len(head) :]: int(row["size"] or 0) for name, row in found.items() if name.startswith(head)}

    def _manifest(self) -> Manifest | None:
        """Return the manifest below the prefix; None if there is no valid one."""
        if not self._is_file(layout.MANIFEST):
            return None
        try:
            place = self._at(layout.MANIFEST)
            if (self._fs.size(place) or 0) > manifest_reader.MAX_BYTES:
                return None
            with self._fs.open(place, "rb") as file:
                manifest = manifest_reader.parse(file)
            listed_files(manifest)
            return manifest
        except (FileNotFoundError, *DAMAGE):
            return None

    def _at(self, path: str) -> str:
        return f"{self._prefix.rstrip('/')}/{path}"

    def _reported(self) -> AbstractContextManager[None]:
        return reported_errors(self._full, "try again: uploaded files are kept")


def scheme_of(url: str) -> str:
    """Return the scheme of a URL in lower case.

    fsspec would unpack the parts of a chain such as `zip::https://host/file` without a limit.

    Raises:
        InputError: the scheme is not in `SCHEMES`, or the URL chains several schemes.
    """
    scheme = url.partition("://")[0].lower()
    if "::" in url.partition("?")[0]:
        raise InputError(f"{urls.shown(url)} chains several schemes with `::`; name one place, without a chain")
    if scheme not in SCHEMES:
        known = ", ".join(f"{name}://" for name in SCHEMES)
        raise InputError(f"{urls.shown(url)}: {scheme}:// is not a supported scheme; use one of {known}")
    return scheme


def located(url: str) -> tuple[Any, str]:
    """Return the file system of a URL and the path in it.

    Raises:
        InputError: the URL has no path.
    """
    if not url.partition("://")[2].strip("/"):
        raise InputError(f"{urls.shown(url)} has no path; write for example s3://bucket/name")
    url = scheme_of(url) + url[url.index("://") :].rstrip("/")  # fsspec knows schemes in lower case only
    fs, prefix = fsspec.core.url_to_fs(url, use_listings_cache=False)
    return fs, prefix


def connections(fs: Any) -> int:
    """Return how many files of a store are transferred at once."""
    protocols = (fs.protocol,) if isinstance(fs.protocol, str) else fs.protocol
    return 1 if _ONE_CONNECTION in protocols else _AT_ONCE


@contextmanager
def reported_errors(url: str, remedy: str) -> Iterator[None]:
    """Convert any error of a store or its library to one with the URL, without passwords, and a remedy.

    Args:
        url: the URL.
        remedy: the remedy, unless a more specific one is known.
    """
    shown = urls.shown(url)
    try:
        yield
    except (RecipeError, MemoryError):
        raise
    except ImportError as error:
        library = _LIBRARIES.get(url.partition("://")[0].lower())
        help = f"install it: pip install '{library}'" if library else _plain(error, url)
        raise InputError(f"{shown}: its library is not installed", help=help, code=Code.MISSING_LIBRARY) from None
    except FileNotFoundError:
        raise InputError(f"{shown}: there is no such place (a bucket must exist already)", code=Code.REMOTE) from None
    except PermissionError as error:
        raise RunError(
            f"{shown}: access was refused ({_plain(error, url)}); check credentials and permissions", code=Code.REMOTE
        ) from None
    except ValueError as error:
        raise InputError(f"{shown}: {_plain(error, url)}", code=Code.REMOTE) from None
    except Exception as error:  # every store has its own exception types
        if type(error).__name__ == "NoCredentialsError":
            found = "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
            raise RunError(f"{shown}: there are no credentials; {found}", code=Code.REMOTE) from None
        raise RunError(
            f"{shown}: {type(error).__name__}: {_plain(error, url)}; {remedy}", code=Code.REMOTE
        ) from None  # the original text may contain secrets


def _plain(error: Exception, url: str) -> str:
    return urls.without_secrets(str(error), url)
