"""What makes a folder a cache of this project, and which of its files are the project's own.

    <cache>/CACHEDIR.TAG              by the Cache Directory Tagging Specification: backups leave the folder out
    <cache>/dataset-recipe-cache      the project's marker; its first line is the form of the cache
    <cache>/in-use/<process>.<n>      leases
    <cache>/<kind>/<ab>/<ab...>       entries of the store: 2, then all 64 hexadecimal digits of the key
    <cache>/kernels/<release>-<machine>/<Warp version>/wp_<module>_<7 hex>/      compiled kernels

Nothing else in a cache folder is counted or removed, and no symbolic link in it is followed. A folder that has no
marker and holds anything else is refused. One that has no marker and holds nothing else was made by an earlier version:
it is marked when it is next written to.
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
from recipe_runtime.core.files import write_atomic

TAG, MARKER, LEASES = "CACHEDIR.TAG", "dataset-recipe-cache", "in-use"
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
_MARK = re.compile(rf"{re.escape(TAG)}|{MARKER}|\.({re.escape(TAG)}|{MARKER})\.\d+\.\d+\.tmp")


@dataclass
class Contents:
    """What of a cache folder is this project's."""

    entries: list[tuple[str, Path]] = field(default_factory=list)  # kind, file; also what a killed process left of one
    modules: list[Path] = field(default_factory=list)  # folders of compiled kernels


def is_marked(root: Path) -> bool:
    """Whether a folder has this project's marker, of the form that this version writes."""
    return _start(root / MARKER, len(_FORM)) == _FORM


def recognised(root: Path) -> bool:
    """Whether a folder is a cache of this project; False if it is absent or empty.

    Raises:
        InputError: It has no marker, and holds what is not this project's.
    """
    if is_marked(root):
        return True
    found = False
    for path, is_file in _walk(root, ""):
        found = True
        if not is_file or not _is_known(root, path):
            raise _refused(root, path)
    return found


def claim(root: Path) -> None:
    """Make a cache folder if it is absent, and mark it.

    Raises:
        InputError: It holds what is not this project's.
        OSError: It has no marker and cannot be written to.
    """
    if is_marked(root):
        return
    recognised(root)
    for name, text in _MARKS.items():  # the marker last: where it is, all is done
        write_atomic(root / name, text)


def contents(root: Path) -> Contents:
    """What of a folder is this project's.

    Raises:
        InputError: The folder has no marker, and holds what is not this project's.
    """
    found = Contents()
    if not recognised(root):
        return found
    modules: dict[Path, bool] = {}
    for path, is_file in _walk(root, ""):
        entry = is_file and _ENTRY.fullmatch(path)
        if entry:
            found.entries.append((entry["kind"], root / path))
        elif path.startswith("kernels/"):  # a module's folder that holds anything else is left alone
            modules[(root / path).parent] = modules.get((root / path).parent, True) and _is_kernel(path, is_file)
    found.modules += [module for module, ours in modules.items() if ours]
    return found


def lease_files(root: Path) -> list[Path]:
    """The lease of every process that uses the cache, or did when it was killed.

    Raises:
        InputError: The folder has no marker, and holds what is not this project's.
    """
    if not recognised(root) or (root / LEASES).is_symlink():
        return []
    return [root / path for path, is_file in _walk(root, LEASES) if is_file and _LEASE.fullmatch(path)]


def remove(path: Path, root: Path) -> None:
    """Delete a file of a cache folder, or a compiled module; another process may have been quicker.

    Each folder on the way is opened from the one above and no link is followed, so that nothing outside is reached.
    """
    *folders, name = path.relative_to(root).parts
    handles: list[int] = []
    try:
        handles.append(os.open(root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC))
        for folder in folders:
            handles.append(_opened(folder, handles[-1]))
        if not name.startswith("wp_"):
            os.unlink(name, dir_fd=handles[-1])
            return
        handles.append(_opened(name, handles[-1]))
        for entry in sorted(os.scandir(handles[-1]), key=_name):
            if _KERNEL.fullmatch((path / entry.name).relative_to(root).as_posix()):
                os.unlink(entry.name, dir_fd=handles[-1])
        with suppress(OSError):  # it holds more by now
            os.rmdir(name, dir_fd=handles[-2])
    except (FileNotFoundError, NotADirectoryError):
        pass
    finally:
        for handle in handles:
            os.close(handle)


def _opened(folder: str, parent: int) -> int:
    return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=parent)


def _walk(root: Path, folder: str) -> Iterator[tuple[str, bool]]:
    """The path of all that a cache folder holds, and whether it is a file; only into folders that a cache has."""
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
    """Whether a file of a folder without a marker is this project's, by its name and by how it begins."""
    if path in _MARKS:  # power loss may leave the beginning alone, or nothing
        return _MARKS[path].startswith(_start(root / path, 1 << 10) or b"")
    if _ENTRY.fullmatch(path):
        return _ENTRY_START.startswith(_start(root / path, len(_ENTRY_START)) or b"")
    return any(form.fullmatch(path) for form in (_KERNEL, _LEASE, _MARK))


def _is_kernel(path: str, is_file: bool) -> bool:
    return is_file and _KERNEL.fullmatch(path) is not None


def _start(path: Path, size: int) -> bytes | None:
    """The first bytes of a file; None if it cannot be read, or is a link."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            return file.read(size)
    except OSError:
        return None


def _refused(root: Path, path: str) -> InputError:
    setting = next((name for name in _SETTINGS if os.environ.get(name) and Path(os.environ[name]) == root), None)
    if setting:
        remedy = f"set {setting} to an empty folder or to a new one, such as {root / 'dataset-recipe'}"
    elif root == default_cache():
        remedy = "move that away, or set RECIPE_CACHE to an empty folder"
    else:
        remedy = f"name an empty folder or a new one, such as {root / 'dataset-recipe'}"
    return InputError(f"{setting or 'the cache folder'} {root}: it holds {path}, which is not of a cache; {remedy}")
