"""Packs: a recipe and all files that it needs in one file, whose digest is the pack's identity.

    small.recipe            an uncompressed ZIP file with sorted entries and without dates
        small.yaml          the recipe, the files it extends and its assets, at their paths below its folder
        lockfiles/small.lock, small.traces    if they exist
        pack.json           format, the recipe's path, SHA-256 of every file

The content determines the bytes: a pack is read entry by entry, and must equal what packing the content again writes. A
pack can therefore contain no link, no duplicate name, no compression bomb and no data between its entries. Names and
sizes are checked before contents are read.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import tempfile
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import BinaryIO, TypedDict

from recipe_compiler.ir.bounded_reads import open_regular
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, Place, Problem
from recipe_compiler.ir.lockfile import is_lockfile

from recipe_runtime.core.documents import Sha256, decode
from recipe_runtime.core.files import host_errors, sha256_of

SUFFIX = ".recipe"
MAX_BYTES = 512 << 20
MAX_FILES = 65_534  # a ZIP file has at most 65,535 entries, one of which is the index
MAX_FOLDERS = 2_000
_INDEX = "pack.json"
_LOCKFILES = "lockfiles"  # a folder
_MAX_PATH = 200  # characters
_MAX_INDEX = 4096 + MAX_FILES * (_MAX_PATH + 70)  # bytes: a row holds a path and a SHA-256
_FORMAT = "recipe/pack/1"
_UNIX = 3
_REGULAR_FILE = 0o100644 << 16  # for everyone to read
_HEADER_BYTES = 30  # of a ZIP entry, before its name
_SIZE_AT = 22
_NO_SPACE = "free some space, or set TMPDIR to another folder"
_PART = re.compile(r"[A-Za-z0-9_+=,@ -][A-Za-z0-9._+=,@ -]*")


class _Index(TypedDict):
    """`pack.json`."""

    format: str
    recipe: str
    files: dict[str, Sha256]


@dataclass(frozen=True)
class Pack:
    """The content of a pack: files by path below the recipe's folder, and the path of the recipe."""

    recipe: str
    files: Mapping[str, bytes]

    def dumps(self) -> bytes:
        """Return the bytes of the pack.

        Raises:
            InputError: a name is not allowed in a pack, or the pack is too large.
        """
        _check(self.recipe, {path: len(body) for path, body in self.files.items()})
        packed = io.BytesIO()
        self.write(packed)
        return packed.getvalue()

    def write(self, file: BinaryIO) -> None:
        """Write the bytes of the pack to a file."""
        with zipfile.ZipFile(file, "w") as archive:
            for path, body in [(_INDEX, self.index()), *sorted(self.files.items())]:
                entry = zipfile.ZipInfo(path)
                entry.create_system, entry.external_attr = _UNIX, _REGULAR_FILE
                archive.writestr(entry, body)

    def index(self) -> bytes:
        """Return the bytes of `pack.json`."""
        digests = {path: hashlib.sha256(body).hexdigest() for path, body in sorted(self.files.items())}
        return canonical_bytes({"format": _FORMAT, "recipe": self.recipe, "files": digests})


def is_pack(path: Path) -> bool:
    """Return whether a path has the file name extension of packs."""
    return path.suffix == SUFFIX


def identity(body: bytes) -> str:
    """Return the identity of a pack's bytes."""
    return f"sha256:{hashlib.sha256(body).hexdigest()}"


def read(path: Path) -> Pack:
    """Read a pack.

    Raises:
        InputError: the file is missing, is not a pack, is damaged, or is not in canonical form.
    """
    try:
        with open_regular(path) as file:
            return _load(file)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; `recipe pack` makes one", code=Code.FILE_NOT_FOUND) from None
    except (OSError, InputError, ValueError) as error:
        lines = str(error).splitlines() or [type(error).__name__]
        reason = (isinstance(error, OSError) and error.strerror) or lines[0]
        refused = isinstance(error, PermissionError)
        raise InputError(
            f"{path}: is not a valid pack: {reason}",
            help="allow this user to read it" if refused else "copy it again, or make it again with `recipe pack`",
            code=Code.INVALID_PACK,
        ) from None


UsedFiles = tuple[str, Collection[str]]  # a recipe's name, and the files that it uses


@contextmanager
def unpacked(path: Path, find_used: Callable[[Path], UsedFiles | None] = lambda recipe: None) -> Iterator[Path]:
    """Unpack a pack into a temporary folder and yield the path of its recipe. Errors inside refer to the pack.

    Args:
        path: the pack.
        find_used: returns the files that a recipe uses, or None for an invalid recipe, which the compiler reports.

    Raises:
        InputError: the pack is invalid, or contains files other than those, the recipe's lockfile and its traces.
    """
    pack = read(path)
    with tempfile.TemporaryDirectory(prefix="recipe-pack-") as folder:
        root = Path(folder)
        with host_errors(folder, _NO_SPACE):
            for name, body in pack.files.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_bytes(body)
            (root / _LOCKFILES).mkdir(exist_ok=True)  # lockfiles in parent folders are then ignored
        if is_lockfile(root / pack.recipe):  # which `recipe verify` would verify, whatever else the pack holds
            raise InputError(f"{path}: its recipe {pack.recipe!r} is a lockfile; pack the recipe again")
        _check_used(path, pack, find_used(root / pack.recipe))
        try:
            yield root / pack.recipe
        except InputError as error:
            raise InputError(_placed(error, folder, str(path))) from error.__cause__


def _load(file: BinaryIO) -> Pack:
    """Read the entries in order, and compare the file with `Pack.write`. No content is in memory twice."""
    size = os.fstat(file.fileno()).st_size
    if size > MAX_BYTES:
        raise ValueError(f"it is larger than {MAX_BYTES >> 20} MiB")
    index = decode(_read_entry(file, _INDEX, min(size, _MAX_INDEX)), _Index)
    if index["format"] != _FORMAT:
        raise ValueError(f"its {_INDEX} is not of format {_FORMAT}")
    _check(index["recipe"], dict.fromkeys(index["files"], 0))  # names; the file's own size limits the sum
    files = {name: _read_entry(file, name, size - file.tell()) for name in sorted(index["files"])}
    pack = Pack(index["recipe"], files)
    with host_errors("a temporary file", _NO_SPACE), tempfile.TemporaryFile() as again:
        pack.write(again)
        again.seek(0)
        file.seek(0)
        if sha256_of(again) != sha256_of(file):
            raise ValueError("its bytes are not the canonical form of its content")
    return pack


def _read_entry(file: BinaryIO, name: str, limit: int) -> bytes:
    """Return the content of the next entry; its header and checksum are not checked.

    Raises:
        ValueError: the entry has another name, or more than `limit` bytes.
    """
    header = file.read(_HEADER_BYTES + len(name))
    if header[_HEADER_BYTES:] != name.encode():
        raise ValueError(f"{name!r} is missing, or not at its place")
    size = int.from_bytes(header[_SIZE_AT : _SIZE_AT + 4], "little")
    if size > limit:
        raise ValueError(f"{name!r} has {size:,} bytes, and at most {limit:,} are read")
    return file.read(size)


def _check(recipe: str, sizes: Mapping[str, int]) -> None:
    if recipe not in sizes:
        raise InputError("the recipe is not among its files")
    if len(sizes) > MAX_FILES or sum(sizes.values()) > MAX_BYTES:
        raise InputError(f"a pack holds at most {MAX_FILES:,} files and {MAX_BYTES >> 20} MiB")
    folders = set[str]()
    for path in sizes:
        parts = path.split("/")
        if path in (_INDEX, _LOCKFILES) or len(path) > _MAX_PATH or not all(_PART.fullmatch(part) for part in parts):
            raise InputError(
                f"{path!r} cannot be a file of a pack; use letters, digits and ._+=,@- in names, and no dot first"
            )
        folders |= {"/".join(parts[:n]) for n in range(1, len(parts))}
        if len(folders) > MAX_FOLDERS:
            raise InputError(f"a pack holds at most {MAX_FOLDERS:,} folders")
    both = min(folders & sizes.keys(), default=None)
    if both is not None:
        raise InputError(f"{both!r} cannot be a file and a folder of a pack")


def _check_used(path: Path, pack: Pack, used_files: UsedFiles | None) -> None:
    if used_files is None:
        return
    name, files = used_files
    below = PurePosixPath(pack.recipe).parent  # paths are relative to the recipe's folder
    used = {str(below / file) for file in files}
    if not used <= set(pack.files):
        return  # the compiler reports the missing file and its place
    used |= {str(below / _LOCKFILES / f"{name}{ending}") for ending in (".lock", ".traces")}
    unused = sorted(set(pack.files) - used)
    if unused:
        more = f" and {len(unused) - 1:,} more" if len(unused) > 1 else ""
        raise InputError(f"{path}: holds {unused[0]!r}{more}, which its recipe does not use; pack the recipe again")


def _placed(error: InputError, folder: str, pack: str) -> list[Problem]:
    """Return the same problems, with places in the pack instead of the temporary folder."""
    found = []
    spellings = sorted((folder, os.path.relpath(folder)), key=len, reverse=True)  # one may contain the other

    def named(text: str) -> str:
        return text.replace(spellings[0], pack).replace(spellings[1], pack)

    for problem in error.problems:
        place = problem.place
        if place is not None:
            place = Place(named(place.file), place.line, place.column)
        found.append(replace(problem, message=named(problem.message), place=place))
    return found
