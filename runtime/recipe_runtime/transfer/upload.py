"""A dataset copied to where fsspec leads: S3, Google Cloud Storage, another folder, memory.

A prefix holds a dataset if it holds its manifest, which is written last. While files are on their way a note stands in
its place, `.recipe-upload.json`. What is there already with the same digest is left; files that are equal are sent
once, and copied over there. A copy that was stopped goes on: what was sent is noted beside the dataset, here.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fsspec
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, RecipeError, RunError

from recipe_runtime.core import layout, urls
from recipe_runtime.core.files import file_sha256, host_errors
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.nonce import fresh_nonce
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import DAMAGE, listed_files
from recipe_runtime.dataset.manifest_types import Manifest

NOTE = ".recipe-upload.json"
SCHEMES = (
    "s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "file", "local", "memory", "ftp", "sftp", "ssh", "hdfs",
    "webhdfs", "smb", "oci", "oss", "http", "https",
)  # fmt: skip
_MOST_NOTE = 10_000  # bytes
_AT_ONCE = 8  # files on their way
_S3, _GCS = "s3fs>=2024.6", "gcsfs>=2024.6"  # as the extras s3 and gcs of pyproject.toml require them
_LIBRARIES = {"s3": _S3, "s3a": _S3, "gs": _GCS, "gcs": _GCS}
Rows = dict[str, tuple[int, str]]  # path -> size, SHA-256


@dataclass(frozen=True)
class Copied:
    """How many files were sent, how many copied over there, and how many were there already."""

    sent: int
    copied: int
    kept: int


class Target:
    """A place for one dataset. InputError at once for a URL that leads nowhere, RunError if it is refused."""

    def __init__(self, url: str) -> None:
        self._full = url.rstrip("/")
        self.url = urls.shown(self._full)
        with self._reported():
            self._fs, self._prefix = located(self._full)
            self._there = self._manifest()
        found = self._sizes()
        if found and self._there is None and NOTE not in found:
            raise InputError(f"{self.url} holds files but no {layout.MANIFEST} of a dataset; name another place")
        if not found:
            with self._reported():
                self._write(NOTE, b"{}")  # now rather than after the build: may we write here at all?

    def check_replaceable(self, recipe: str) -> None:
        """InputError if the dataset that is here is of a recipe of another name."""
        name = str(self._there.get("recipe"))[:100] if self._there else recipe
        if name != recipe:
            raise InputError(
                f"{self.url} holds the dataset of another recipe, {name!r}, and this is {recipe!r};"
                " choose another place with --out, or replace that dataset (--replace)"
            )

    def put(self, root: Path, progress: Progress, *, replace: bool = False) -> Copied:
        """Copy the dataset in a folder here, in place of an earlier one of the same recipe that is here.

        Raises:
            InputError: what is here is no dataset or, unless `replace`, the dataset of another recipe.
            RunError: the copy failed; the next goes on from there.
        """
        body = (root / layout.MANIFEST).read_bytes()
        manifest: Manifest = json.loads(body)
        if not replace:
            self.check_replaceable(manifest["recipe"])
        rows, sizes = listed_files(manifest), self._sizes()
        if self._there == manifest and self._is_whole(rows, sizes):
            return Copied(0, 0, len(rows))
        journal = _Journal(root, self._full)
        known = listed_files(self._there) if self._there else journal.rows(self._note())
        foreign = sorted(set(sizes) - set(known) - set(rows) - {layout.MANIFEST, NOTE})
        if foreign:
            raise InputError(f"{self.url} holds a file that is not the dataset's, {foreign[0]!r}; move it away first")
        missing = [path for path, row in rows.items() if known.get(path) != row or sizes.get(path) != row[0]]
        with self._reported():
            token = journal.begin({path: row for path, row in known.items() if sizes.get(path) == row[0]})
            self._write(NOTE, canonical_bytes({"dataset": manifest["identity"], "copy": token}))
            if self._there is not None:
                self._fs.rm_file(self._at(layout.MANIFEST))
            copied = self._send(root, rows, missing, journal, progress)
            for path in sorted(set(sizes) - set(rows) - {layout.MANIFEST, NOTE}):
                self._fs.rm_file(self._at(path))
            if self._note() != token:
                raise RunError(f"{self.url}: another copy was made here meanwhile; copy again when it is done")
            self._write(layout.MANIFEST, body)
            self._fs.rm_file(self._at(NOTE))
        journal.close()
        return Copied(len(missing) - copied, copied, len(rows) - len(missing))

    def _send(self, root: Path, rows: Rows, missing: list[str], journal: _Journal, progress: Progress) -> int:
        """Send what is missing, each content once, then copy the others over there; how many those were."""
        firsts: dict[tuple[int, str], str] = {}
        for path in missing:
            firsts.setdefault(rows[path], path)
        seconds = [path for path in missing if firsts[rows[path]] != path]
        done = 0
        for batch in (list(firsts.values()), seconds):
            with ThreadPoolExecutor(_AT_ONCE) as threads:
                tasks = [threads.submit(self._bring, root, path, firsts[rows[path]], rows[path]) for path in batch]
                try:
                    for task in as_completed(tasks):
                        journal.note(*task.result())
                        done += 1
                        progress("copy", done, len(missing))
                except BaseException:
                    threads.shutdown(wait=True, cancel_futures=True)
                    for task in tasks:  # what arrived all the same
                        if not task.cancelled() and task.exception() is None:
                            journal.note(*task.result())
                    raise
        return len(seconds)

    def _bring(self, root: Path, path: str, first: str, row: tuple[int, str]) -> tuple[str, tuple[int, str]]:
        """Send a file, or copy over there the one that was sent `first` and is equal; which one is in place now."""
        if path != first:
            self._make_room(path)
            self._fs.cp_file(self._at(first), self._at(path))
        elif file_sha256(root / path) != row[1]:
            raise InputError(f"{root / path} has other bytes than the manifest says; build the dataset again")
        else:
            self._make_room(path)
            self._fs.put_file(str(root / path), self._at(path))
        return path, row

    def _write(self, path: str, body: bytes) -> None:
        self._make_room(path)
        self._fs.pipe_file(self._at(path), body)

    def _make_room(self, path: str) -> None:
        """On a disk: a folder for the file, and no file there, for that may be one with another."""
        if "file" in self._fs.protocol:
            place = self._at(path)
            self._fs.makedirs(place.rpartition("/")[0], exist_ok=True)
            with suppress(FileNotFoundError):
                self._fs.rm_file(place)

    def _note(self) -> str | None:
        """Which copy is under way here, by the note that it left; None if none is known."""
        try:
            return str(json.loads(self._fs.cat_file(self._at(NOTE), end=_MOST_NOTE))["copy"])
        except (FileNotFoundError, *DAMAGE):
            return None

    def _is_whole(self, rows: Rows, sizes: Mapping[str, int]) -> bool:
        return set(sizes) == {*rows, layout.MANIFEST} and all(sizes[path] == size for path, (size, _) in rows.items())

    def _sizes(self) -> dict[str, int]:
        """Every file below the prefix, and its size."""
        with self._reported():
            try:
                found = self._fs.find(self._prefix, detail=True)
            except FileNotFoundError:
                return {}
        head = self._prefix.rstrip("/") + "/"
        return {name[len(head) :]: int(row["size"]) for name, row in found.items() if name.startswith(head)}

    def _manifest(self) -> Manifest | None:
        """The manifest that is there; None if there is none of this project."""
        try:
            place = self._at(layout.MANIFEST)
            if (self._fs.size(place) or 0) > manifest_reader.MAX_BYTES:
                return None
            with self._fs.open(place, "rb") as file:
                return manifest_reader.parse(file)
        except (FileNotFoundError, *DAMAGE):
            return None

    def _at(self, path: str) -> str:
        return f"{self._prefix.rstrip('/')}/{path}"

    def _reported(self) -> AbstractContextManager[None]:
        return reported_errors(self._full, "try again: what was copied is kept")


def scheme_of(url: str) -> str:
    """A URL's scheme, in small letters; InputError for one that is not in `SCHEMES`, and for a chain of several.

    fsspec would unpack what a chain such as `zip::https://host/file` names, without a bound.
    """
    scheme = url.partition("://")[0].lower()
    if "::" in url.partition("?")[0]:
        raise InputError(f"{urls.shown(url)} chains several schemes with `::`; name one place, without a chain")
    if scheme not in SCHEMES:
        known = ", ".join(f"{name}://" for name in SCHEMES)
        raise InputError(f"{urls.shown(url)}: {scheme}:// is no scheme for a dataset; use one of {known}")
    return scheme


def located(url: str) -> tuple[Any, str]:
    """The file system that a URL leads to, and the place in it; InputError if it names none."""
    if not url.partition("://")[2].strip("/"):
        raise InputError(f"{urls.shown(url)} names no place; write for example s3://bucket/name")
    scheme_of(url)
    fs, prefix = fsspec.core.url_to_fs(url.rstrip("/"), use_listings_cache=False)
    return fs, prefix


@contextmanager
def reported_errors(url: str, remedy: str) -> Iterator[None]:
    """Report any error of a store or its library with the URL and a remedy: `remedy`, unless a better one is known.

    The message holds no password of a URL.
    """
    shown = urls.shown(url)
    try:
        yield
    except RecipeError:
        raise
    except ImportError as error:
        library = _LIBRARIES.get(url.partition("://")[0].lower())
        help = f"install it: pip install '{library}'" if library else _plain(error, url)
        raise InputError(f"{shown}: its library is not installed", help=help, code=Code.MISSING_LIBRARY) from None
    except FileNotFoundError:
        raise InputError(
            f"{shown}: there is no such place (a bucket must be there already)", code=Code.REMOTE
        ) from None
    except PermissionError as error:
        raise RunError(
            f"{shown}: access was refused ({_plain(error, url)}); see to credentials and rights", code=Code.REMOTE
        ) from None
    except ValueError as error:
        raise InputError(f"{shown}: {_plain(error, url)}", code=Code.REMOTE) from None
    except Exception as error:  # each store has errors of its own
        if type(error).__name__ == "NoCredentialsError":
            found = "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE"
            raise RunError(f"{shown}: there are no credentials; {found}", code=Code.REMOTE) from None
        raise RunError(
            f"{shown}: {type(error).__name__}: {_plain(error, url)}; {remedy}", code=Code.REMOTE
        ) from None  # its text may hold secrets


def _plain(error: Exception, url: str) -> str:
    return urls.without_secrets(str(error), url)


class _Journal:
    """What was sent to a place so far, noted beside the dataset's folder: it outlives the process.

    Its first line names the copy; what it says holds only where the note at the place names the same.
    """

    def __init__(self, root: Path, url: str) -> None:
        name = hashlib.sha256(url.encode()).hexdigest()[:16]
        self._path = root.with_name(f".{root.name}.sent-{name}")

    def rows(self, token: str | None) -> Rows:
        """The files noted of that copy; a last line that was cut off is none."""
        found: Rows = {}
        with suppress(OSError):
            first, *lines = self._path.read_text().splitlines() or [""]
            for line in lines if first == token else ():
                with suppress(ValueError):
                    path, size, sha256 = json.loads(line)
                    found[path] = int(size), str(sha256)
        return found

    def begin(self, rows: Rows) -> str:
        """A new copy, of which these files are in place already; its name."""
        token = f"{fresh_nonce():x}"
        with host_errors(str(self._path), "free some space or allow writing"):
            self._path.write_text(f"{token}\n")
        for path, row in rows.items():
            self.note(path, row)
        return token

    def note(self, path: str, row: tuple[int, str]) -> None:
        """Add a file."""
        with host_errors(str(self._path), "free some space or allow writing"), self._path.open("a") as file:
            file.write(f"{json.dumps([path, *row])}\n")

    def close(self) -> None:
        """All is sent."""
        self._path.unlink(missing_ok=True)
