"""Packs: a recipe and all files that it needs in one file, whose digest is the pack's identity.

    small.recipe            an uncompressed ZIP file with sorted entries and without dates
        small.yaml          the recipe, the files it extends and its assets, at their paths below its folder
        lockfiles/small.lock, small.traces    if they exist
        pack.json           format, the recipe's path, SHA-256 of every file

A content has exactly one byte form: a pack that is read is packed again, and must result in the same bytes. A pack
can therefore contain no link, no duplicate name, no compression bomb and no data between its entries. Names and sizes
are checked first.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import tempfile
import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, Place, Problem

from recipe_runtime.core.files import host_errors

SUFFIX = ".recipe"
MOST_BYTES = 512 << 20
MOST_FILES = 2000
_INDEX = "pack.json"
_FORMAT = "recipe/pack/1"
_PART = re.compile(r"[A-Za-z0-9_+=,@ -][A-Za-z0-9._+=,@ -]*")
_DAMAGE = (ValueError, EOFError, KeyError, TypeError, AttributeError, RecursionError, NotImplementedError, RuntimeError)


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
        digests = {path: hashlib.sha256(body).hexdigest() for path, body in sorted(self.files.items())}
        index = canonical_bytes({"format": _FORMAT, "recipe": self.recipe, "files": digests})
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
            for path, body in [(_INDEX, index), *sorted(self.files.items())]:
                entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
                entry.create_system, entry.external_attr = 3, 0o100644 << 16
                archive.writestr(entry, body)
        return out.getvalue()


def is_pack(path: Path) -> bool:
    """Whether a path has the file name extension of packs."""
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
        body = read_regular(path, MOST_BYTES)
        if len(body) > MOST_BYTES:
            raise ValueError(f"it is larger than {MOST_BYTES >> 20} MiB")
        return _loads(body)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; `recipe pack` makes one", code=Code.FILE_NOT_FOUND) from None
    except (OSError, zipfile.BadZipFile, InputError, *_DAMAGE) as error:
        lines = str(error).splitlines() or [type(error).__name__]  # zipfile's EOFError says nothing
        reason = (isinstance(error, OSError) and error.strerror) or lines[0]
        raise InputError(f"{path}: is not a pack that can be used: {reason}", code=Code.INVALID_PACK) from None


Named = tuple[str, Collection[str]]  # a recipe's name, and the files that it uses


@contextmanager
def unpacked(path: Path, named: Callable[[Path], Named | None] = lambda recipe: None) -> Iterator[Path]:
    """Unpack a pack into a temporary folder and yield the path of its recipe. Errors inside refer to the pack.

    Args:
        path: the pack.
        named: returns the files that a recipe uses, or None for an invalid recipe, which the compiler reports.

    Raises:
        InputError: the pack is invalid, or contains files other than those, the recipe's lockfile and its traces.
    """
    pack = read(path)
    with tempfile.TemporaryDirectory(prefix="recipe-pack-") as folder:
        root = Path(folder)
        with host_errors(folder, "free some space, or set TMPDIR to another folder"):
            for name, body in pack.files.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_bytes(body)
            (root / "lockfiles").mkdir(exist_ok=True)  # lockfiles in parent folders are then ignored
        _check_used(path, pack, named(root / pack.recipe))
        try:
            yield root / pack.recipe
        except InputError as error:
            raise InputError(_placed(error, folder, str(path))) from error.__cause__


def _loads(body: bytes) -> Pack:
    with zipfile.ZipFile(io.BytesIO(body)) as archive:
        entries = archive.infolist()
        if len(entries) > MOST_FILES + 1:
            raise ValueError(f"it holds more than {MOST_FILES} files")
        if any(e.compress_type != zipfile.ZIP_STORED or e.file_size != e.compress_size for e in entries):
            raise ValueError("an entry is compressed; in a pack none is")
        if sum(e.file_size for e in entries) > len(body):
            raise ValueError("its entries are larger than it is")
        found = {e.filename: archive.read(e) for e in entries}
    index = json.loads(found.pop(_INDEX))
    if not isinstance(index, dict) or index.get("format") != _FORMAT:
        raise ValueError(f"its {_INDEX} is not of format {_FORMAT}")
    pack = Pack(index["recipe"], found)
    if pack.dumps() != body:
        raise ValueError("it is not in the one form that a pack of its content has")
    return pack


def _check(recipe: str, sizes: Mapping[str, int]) -> None:
    if not isinstance(recipe, str) or recipe not in sizes:
        raise InputError("the recipe is not among its files")
    if len(sizes) > MOST_FILES or sum(sizes.values()) > MOST_BYTES:
        raise InputError(f"a pack holds at most {MOST_FILES} files and {MOST_BYTES >> 20} MiB")
    taken: dict[str, str] = {}
    for path in sizes:
        parts = path.split("/")
        if path == _INDEX or len(path) > 200 or not all(_PART.fullmatch(part) for part in parts):
            raise InputError(
                f"{path!r} cannot be a file of a pack; use letters, digits and ._+=,@- in names, and no dot first"
            )
        for n in range(1, len(parts) + 1):  # no two names that differ in case only, no file that is a folder
            place = "/".join(parts[:n])
            if taken.setdefault(place.casefold(), place) != place:
                raise InputError(f"{path!r} and {taken[place.casefold()]!r} cannot both be in a pack; rename one")
            if n < len(parts) and place in sizes:
                raise InputError(f"{place!r} cannot be a file and a folder of a pack")


def _check_used(path: Path, pack: Pack, named: Named | None) -> None:
    if named is None:
        return
    name, files = named
    below = PurePosixPath(pack.recipe).parent  # paths are relative to the recipe's folder
    used = {str(below / file) for file in files}
    if not used <= set(pack.files):
        return  # the compiler reports the missing file and its place
    used |= {str(below / "lockfiles" / f"{name}{ending}") for ending in (".lock", ".traces")}
    unused = sorted(set(pack.files) - used)
    if unused:
        more = f" and {len(unused) - 1:,} more" if len(unused) > 1 else ""
        raise InputError(f"{path}: holds {unused[0]!r}{more}, which its recipe does not use; pack the recipe again")


def _placed(error: InputError, folder: str, pack: str) -> list[Problem]:
    """Return the same problems, with places in the pack instead of the temporary folder."""
    found = []
    for problem in error.problems:
        place = problem.place
        if place is not None:
            place = Place(place.file.replace(folder, pack), place.line, place.column)
        found.append(replace(problem, message=problem.message.replace(folder, pack), place=place))
    return found
