"""Layout of the cache folder, and which files in it belong to this project.

    <cache>/CACHEDIR.TAG              Cache Directory Tagging Specification: backups skip the folder
    <cache>/dataset-recipe-cache      the project's marker; its first line is the version of the layout
    <cache>/journal-key               the secret that seals the journals of this user's builds; it is never pruned
    <cache>/in-use/<process>.<n>      leases
    <cache>/<kind>/<ab>/<ab...>       entries of the store: 2, then all 64 hexadecimal digits of the key
    <cache>/kernels/<release>-<machine>/<Warp version>/wp_<module>_<7 hex>/      compiled kernels

No other file in a cache folder is counted or removed, and symbolic links in it are not followed. A folder without the
marker that contains other files is refused. A folder without the marker that contains only these files was created by
an earlier version; the marker is added on the next write.
"""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from recipe_compiler.ir.errors import InputError

from recipe_runtime.cache.store import KINDS, default_cache
from recipe_runtime.core.files import open_no_follow, write_atomic

TAG, MARKER, LEASES = "CACHEDIR.TAG", "dataset-recipe-cache", "in-use"
KEY = "journal-key"
_FORM = b"recipe/cache/1\n"
_MARKS = {
    TAG: b"Signature: 8a477f597d28d172789f06886806bc55\n"
    b"# This folder is a cache of Dataset Recipe: all that it holds can be made again.\n"
    b"# About cache directory tags, see https://bford.info/cachedir/\n",
    MARKER: _FORM + b"`recipe` keeps files here between runs; `recipe cache --prune` removes them.\n",
}
_ENTRY_START = b"recipe/store/"
_SETTINGS = ("RECIPE_CACHE", "RECIPE_KERNEL_CACHE")

_KIND, _MACHINE = "|".join(KINDS), f"x86_64|amd64|aarch64|arm64|{re.escape(platform.machine())}"
_VERSION = r"\d+(\.\d+)*((a|b|rc)\d+)?(\.post\d+)?(\.dev\d+)?(\+[a-z0-9.]+)?"
_RELEASE = rf"kernels/{_VERSION}-({_MACHINE})"
_MODULE = rf"{_RELEASE}/{_VERSION}/(?P<module>wp_[A-Za-z_][\w.]*_[0-9a-f]{{7}})(_p\d+_t\d+)?"
_COMPILED = r"cpp|cu|meta|sha256|(cpu[0-9a-f]+\.)?o|sm\d+[af]?\.(cubin|ptx)"
_FOLDER = re.compile(rf"{LEASES}|({_KIND})(/[0-9a-f]{{2}})?|kernels|{_RELEASE}(/{_VERSION})?|{_MODULE}")
_ENTRY = re.compile(
    rf"(?P<kind>{_KIND})/(?P<start>[0-9a-f]{{2}})/((?P=start)[0-9a-f]{{62}}|\.(?P=start)[0-9a-f]{{62}}\.\d+\.\d+\.tmp)"
)
_KERNEL = re.compile(rf"{_MODULE}/((?P=module)\.({_COMPILED})|\.(?P=module)\.sha256\.\d+\.\d+\.tmp)")
_LEASE = re.compile(rf"{LEASES}/\d+\.\d+")
_MARK = re.compile(rf"{re.escape(TAG)}|{MARKER}|{KEY}|\.({re.escape(TAG)}|{MARKER}|{KEY})\.\d+\.\d+\.tmp")


@dataclass
class Contents:
    """The files of a cache folder that belong to this project."""

    entries: list[tuple[str, Path]] = field(
        default_factory=list
    )  # kind, file; includes temporary files of killed processes
    modules: list[Path] = field(default_factory=list)  # folders of compiled kernels


def is_marked(root: Path) -> bool:
    """Return whether a folder has the marker that this version writes."""
    return _start(root / MARKER, len(_FORM)) == _FORM


def is_cache_folder(root: Path) -> bool:
    """Return whether a folder is a cache of this project; False if it is absent or empty.

    Raises:
        InputError: It has no marker and contains other files.
    """
    if is_marked(root):
        return True
    found = False
    for path, is_file in _walk(root, ""):
        found = True
        if not is_file or not _is_known(root, path):
            raise _not_a_cache_error(root, path)
    return found


def create_cache_folder(root: Path) -> None:
    """Create a cache folder if it is absent, and add the marker.

    Raises:
        InputError: It has no marker and contains other files.
        OSError: It has no marker and cannot be written to.
    """
    if is_marked(root):
        return
    is_cache_folder(root)
    for name, text in _MARKS.items():  # the marker last: its presence means that the folder is complete
        write_atomic(root / name, text)


def contents(root: Path) -> Contents:
    """Return the files of a folder that belong to this project.

    Raises:
        InputError: The folder has no marker and contains other files.
    """
    found = Contents()
    if not is_cache_folder(root):
        return found
    modules: dict[Path, bool] = {}
    for path, is_file in _walk(root, ""):
        entry = is_file and _ENTRY.fullmatch(path)
        if entry:
            found.entries.append((entry["kind"], root / path))
        elif path.startswith("kernels/"):  # a module's folder with other files in it is not touched
            modules[(root / path).parent] = modules.get((root / path).parent, True) and _is_kernel(path, is_file)
    found.modules += [module for module, is_ours in modules.items() if is_ours]
    return found


def lease_files(root: Path) -> list[Path]:
    """Return the lease files of all processes, including killed ones.

    Raises:
        InputError: The folder has no marker and contains other files.
    """
    if not is_cache_folder(root) or (root / LEASES).is_symlink():
        return []
    return [root / path for path, is_file in _walk(root, LEASES) if is_file and _LEASE.fullmatch(path)]


def remove(path: Path, root: Path) -> None:
    """Delete a file or a compiled module of a cache folder; not an error if it is already gone.

    Each parent folder is opened relative to its own parent without following links, so that no file outside the cache
    can be deleted.
    """
    *folders, name = path.relative_to(root).parts
    handles: list[int] = []
    try:
        handles.append(os.open(root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC))
        for folder in folders:
            handles.append(_open_folder(folder, handles[-1]))
        if not name.startswith("wp_"):
            os.unlink(name, dir_fd=handles[-1])
            return
        handles.append(_open_folder(name, handles[-1]))
        for entry in sorted(os.scandir(handles[-1]), key=_name):
            if _KERNEL.fullmatch((path / entry.name).relative_to(root).as_posix()):
                os.unlink(entry.name, dir_fd=handles[-1])
        with suppress(OSError):  # another process has added files
            os.rmdir(name, dir_fd=handles[-2])
    except (FileNotFoundError, NotADirectoryError):
        pass
    finally:
        for handle in handles:
            os.close(handle)


def _open_folder(folder: str, parent: int) -> int:
    return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=parent)


def _walk(root: Path, folder: str) -> Iterator[tuple[str, bool]]:
    """Yield the path of every entry and whether it is a file; descends only into folders of the cache layout."""
    try:
        there = sorted(os.scandir(root / folder), key=_name)
    except (FileNotFoundError, NotADirectoryError):
        return
    for entry in there:
        path = f"{folder}/{entry.name}" if folder else entry.name
        if entry.is_dir(follow_symlinks=False) and _FOLDER.fullmatch(path):
            yield from _walk(root, path)
        else:
            yield path, entry.is_file(follow_symlinks=False)


def _name(entry: os.DirEntry[str]) -> str:
    return entry.name


def _is_known(root: Path, path: str) -> bool:
    """Return whether a file of a folder without a marker belongs to this project, by its name and first bytes."""
    text = _MARKS.get(path, _ENTRY_START if _ENTRY.fullmatch(path) else None)
    if text is not None:
        found = _start(root / path, len(_ENTRY_START) if text is _ENTRY_START else 1 << 10) or b""
        return text.startswith(found.rstrip(b"\0"))  # a power failure may have truncated it, or filled it with zeros
    return any(form.fullmatch(path) for form in (_KERNEL, _LEASE, _MARK))


def _is_kernel(path: str, is_file: bool) -> bool:
    return is_file and _KERNEL.fullmatch(path) is not None


def _start(path: Path, size: int) -> bytes | None:
    """Return the first bytes of a file; None if it is a link or cannot be read."""
    try:
        with open_no_follow(path) as file:
            return file.read(size)
    except OSError:
        return None


def _not_a_cache_error(root: Path, path: str) -> InputError:
    setting = next((name for name in _SETTINGS if os.environ.get(name) and Path(os.environ[name]) == root), None)
    if setting:
        remedy = f"set {setting} to an empty folder or to a new one, such as {root / 'dataset-recipe'}"
    elif root == default_cache():
        remedy = "move that away, or set RECIPE_CACHE to an empty folder"
    else:
        remedy = f"name an empty folder or a new one, such as {root / 'dataset-recipe'}"
    return InputError(f"{setting or 'the cache folder'} {root}: it holds {path}, which is not of a cache; {remedy}")
