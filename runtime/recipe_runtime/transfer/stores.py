"""Folders in stores that are reached through fsspec: schemes, time-outs, listings and errors.

What a store contains is not trusted: names that lead out of the folder are refused, and listed sizes are claims.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, cast

import fsspec
from recipe_compiler.ir.errors import Code, InputError, RecipeError, RunError

from recipe_runtime.core import urls
from recipe_runtime.dataset.manifest import stays_inside

PIECE = 1 << 20  # bytes of a file that are read at once
_AT_ONCE = 8  # concurrent transfers


@dataclass(frozen=True)
class Scheme:
    """How the stores of one scheme are reached.

    Attributes:
        library: what pip installs, as in an extra of pyproject.toml; empty if fsspec needs no other library.
        options: options of fsspec's file system, such as time-outs where its library has none.
        at_once: the number of concurrent transfers.
    """

    library: str = ""
    options: Mapping[str, object] = field(default_factory=dict)
    at_once: int = _AT_ONCE


_FRESH = {"use_listings_cache": False}  # each listing is the store's
_AZURE = Scheme("adlfs>=2024.7", _FRESH)
SCHEMES = {
    "s3": Scheme("s3fs>=2024.6", _FRESH),
    "gs": Scheme("gcsfs>=2024.6", _FRESH | {"requests_timeout": 900}),  # seconds of a request, of 50 MiB at most
    "az": _AZURE,
    "abfs": _AZURE,
    "sftp": Scheme("paramiko>=3.4", {"timeout": 60}, at_once=1),  # threads cannot share its one connection
    "file": Scheme(options={"auto_mkdir": True}),
    "memory": Scheme(),
}
_SFTP_TIMEOUT = 60.0  # seconds without an answer


class Store:
    """A folder in a store.

    All methods raise the errors of the store's library; `reported` converts them.

    Args:
        url: its URL.

    Attributes:
        url: its URL, without secrets.
        folder: its path, if it is on a disk of this host; else None.

    Raises:
        InputError: the URL has no path, or a scheme that is not supported, or whose library is not installed.
        RunError: the store refuses access, or cannot be reached.
    """

    def __init__(self, url: str) -> None:
        self.url, self._full = urls.shown(url), url
        name = _scheme_of(url)
        path = url.partition("://")[2].rstrip("/")
        if not path:
            raise InputError(f"{self.url} has no path; write for example s3://bucket/name")
        self._scheme, self._is_sftp = SCHEMES[name], name == "sftp"
        with self.reported("try again"):
            fs, prefix = fsspec.core.url_to_fs(f"{name}://{path}", **self._scheme.options)  # it knows lower case only
            self._fs, self._prefix = fs, prefix.rstrip("/")
            if self._is_sftp:
                fs.ftp.get_channel().settimeout(_SFTP_TIMEOUT)
        self.folder = Path(self._prefix) if name == "file" else None

    def sizes(self) -> dict[str, int]:
        """Return the size of each file, by path, as the store states it.

        Raises:
            InputError: a name leads out of the folder.
        """
        strict = {} if self._fs.async_impl else {"on_error": "raise"}  # else they omit a folder that they cannot list
        try:
            found = self._fs.find(self._prefix, detail=True, **strict)
        except FileNotFoundError:
            return {}
        sizes = dict[str, int]()
        for name, row in found.items():
            if name.rstrip("/") == self._prefix or (name.endswith("/") and row["size"] == 0):  # a folder of some stores
                continue
            path = name.removeprefix(f"{self._prefix}/")
            if path == name or not stays_inside(path):
                raise InputError(f"{self.url} holds {ascii(name)[:200]}, which is not a path in a dataset; remove it")
            sizes[path] = int(row["size"])
        return sizes

    def open(self, path: str) -> BinaryIO:
        """Open a file for reading."""
        return cast(BinaryIO, self._fs.open(self._at(path), "rb", block_size=PIECE))

    def write(self, path: str, body: bytes) -> None:
        """Write a file of the folder itself."""
        if self._is_sftp:  # a server with folders; object stores would create a bucket
            self._fs.makedirs(self._prefix, exist_ok=True)
        self._fs.pipe_file(self._at(path), body)

    def send(self, source: Path, path: str) -> None:
        """Send a file of this host."""
        self._fs.put_file(str(source), self._at(path))

    def copy(self, source: str, path: str) -> None:
        """Copy a file within the store; NotImplementedError if it does not copy."""
        self._fs.cp_file(self._at(source), self._at(path))

    def remove(self, path: str) -> None:
        """Delete a file."""
        self._fs.rm_file(self._at(path))

    def each(
        self, act: Callable[[str], object], paths: Collection[str], done: Callable[[int], object] = lambda _: None
    ) -> None:
        """Call a function for each path, several at once; `done` is called with the number of finished calls.

        The first error ends it as soon as the running calls have ended.
        """
        with ThreadPoolExecutor(self._scheme.at_once) as threads:
            tasks = [threads.submit(act, path) for path in paths]
            try:
                for number, task in enumerate(as_completed(tasks), start=1):
                    task.result()
                    done(number)
            except BaseException:
                threads.shutdown(wait=True, cancel_futures=True)
                raise

    def _at(self, path: str) -> str:
        return f"{self._prefix}/{path}"

    def reported(self, remedy: str) -> AbstractContextManager[None]:
        """Convert errors of the store or its library; see `reported_errors`."""
        return reported_errors(self._full, remedy)


def _scheme_of(url: str) -> str:
    """Return the scheme of a URL in lower case.

    fsspec would unpack the parts of a chain such as `zip::https://host/file` without a limit.

    Raises:
        InputError: the scheme is not in `SCHEMES`, or the URL chains several schemes.
    """
    scheme, shown = url.partition("://")[0].lower(), urls.shown(url)
    if "::" in url.partition("?")[0]:
        raise InputError(f"{shown} chains several schemes with `::`; name one place, without a chain")
    if scheme in ("http", "https"):
        raise InputError(
            f"{shown}: a web server neither lists nor accepts files",
            help="name a store, such as s3://bucket/name, or download the dataset and name its folder",
        )
    if scheme not in SCHEMES:
        known = ", ".join(f"{name}://" for name in SCHEMES)
        raise InputError(f"{shown}: {scheme}:// is not a supported scheme; use one of {known}")
    return scheme


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
        library = SCHEMES.get(url.partition("://")[0].lower(), Scheme()).library
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
