"""The record of a running upload, from which another process resumes it."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from itertools import islice
from pathlib import Path

from recipe_compiler.ir.bounded_reads import open_regular

from recipe_runtime.core.files import host_errors, write_atomic
from recipe_runtime.core.host import fresh_nonce
from recipe_runtime.dataset.plan_checks import MAX_FILES

Rows = dict[str, tuple[int, str]]  # path -> size, SHA-256

UNKNOWN = (-1, "")  # the row of a file that is about to be sent: its content there is unknown until it is recorded

_MAX_LINE = 8192  # bytes
_MAX_LINES = 3 * MAX_FILES  # files that are there, those to be sent, and those that were
_REMEDY = "free some space or allow writing"


class UploadJournal:
    """The files uploaded to a URL so far, recorded next to the dataset's folder. Links are not followed.

    Its first line is the upload's token, and that of the upload that it resumes, which the marker file at the URL has
    until it is replaced. The record is valid only if the marker file has one of them.
    """

    def __init__(self, root: Path, url: str) -> None:
        name = hashlib.sha256(os.fsencode(url)).hexdigest()[:16]
        self._path = root.with_name(f".{root.name}.sent-{name}")
        self._resumed = ""  # the token of the upload that is resumed

    def rows(self, token: str | None) -> Rows:
        """Return the recorded files of the upload with that token; damaged lines are ignored."""
        found: Rows = {}
        with suppress(OSError, ValueError), open_regular(self._path, follow_links=False) as file:
            if token is None or token.encode() not in file.readline(_MAX_LINE).split():
                return {}
            self._resumed = token
            for line in islice(iter(lambda: file.readline(_MAX_LINE), b""), _MAX_LINES):
                with suppress(ValueError, TypeError, OverflowError, RecursionError):
                    path, size, sha256 = json.loads(line)
                    found[str(path)] = int(size), str(sha256)
        return found

    def begin(self, rows: Rows) -> str:
        """Start the record of a new upload and return its token.

        Args:
            rows: files that exist at the URL already, and those to be sent (`UNKNOWN`).
        """
        token = f"{fresh_nonce():x}"
        with host_errors(str(self._path), _REMEDY):
            lines = [f"{token} {self._resumed}\n", *(_line(path, row) for path, row in rows.items())]
            write_atomic(self._path, "".join(lines).encode())
        return token

    def record(self, path: str, row: tuple[int, str]) -> None:
        """Record a file."""
        with host_errors(str(self._path), _REMEDY):
            handle = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            with os.fdopen(handle, "ab") as file:
                file.write(_line(path, row).encode())

    def close(self) -> None:
        """Remove the record after a complete upload."""
        self._path.unlink(missing_ok=True)


def _line(path: str, row: tuple[int, str]) -> str:
    return f"{json.dumps([path, *row])}\n"
