"""A key-value store of Traces and records, addressed by digests of their inputs.

    <cache>/CACHEDIR.TAG              Cache Directory Tagging Specification: backups skip the folder
    <cache>/dataset-recipe-cache      the marker; its first line is the version of the layout
    <cache>/<kind>/<ab>/<ab...>       entries: 2, then all 64 hexadecimal digits of the key
    <cache>/kernels/<release>/        compiled kernels, which Warp arranges

The store is in the user's cache folder, or in the folder that RECIPE_CACHE names. A folder without the marker is used
only if it is empty; the folders of the kinds in a marked one belong to this project. Entries are verified when read: a
damaged one counts as absent and is regenerated. Concurrent builds may write the same entry: they write the same bytes,
and each write is one atomic rename.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from dataclasses import astuple, replace
from pathlib import Path
from typing import BinaryIO

import platformdirs
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.core.files import atomic_file, host_errors, open_no_follow, write_atomic
from recipe_runtime.core.trace import ContactEvent, Trace
from recipe_runtime.core.versions import simulator_identity

FORMAT = "recipe/store/2"
KINDS = ("built", "contacts", "downloads", "pixels", "shards", "traces")
"""All kinds of entries."""
KERNELS = "kernels"
TAG = "CACHEDIR.TAG"
MARKER = "dataset-recipe-cache"
_FORM = b"recipe/cache/1\n"
_MARKER_TEXT = _FORM + b"`recipe` keeps files here between runs; `recipe cache --prune` removes them.\n"
_TAG_TEXT = (
    b"Signature: 8a477f597d28d172789f06886806bc55\n"
    b"# This folder is a cache of Dataset Recipe: all that it holds can be made again.\n"
    b"# About cache directory tags, see https://bford.info/cachedir/\n"
)
_SETTINGS = ("RECIPE_CACHE", "RECIPE_KERNEL_CACHE")
_LONGEST_HEADER = 400


def default_cache() -> Path:
    """The folder that RECIPE_CACHE names, else the user's cache folder.

    Raises:
        InputError: neither exists.
    """
    named = os.environ.get("RECIPE_CACHE")
    return Path(named) if named else user_cache()


def user_cache() -> Path:
    """Return the user's cache folder.

    Raises:
        InputError: the user has no home folder.
    """
    try:
        folder = Path(platformdirs.user_cache_dir("dataset-recipe"))
    except RuntimeError:
        folder = Path("~")
    if folder.parts[0] == "~":  # as some versions of platformdirs leave it
        raise InputError("this user has no home folder for the cache", help="set RECIPE_CACHE to a folder for it")
    return folder


def kernel_cache() -> Path:
    """Return the folder of compiled kernels: RECIPE_KERNEL_CACHE, else `default_cache()`."""
    named = os.environ.get("RECIPE_KERNEL_CACHE")
    return Path(named) if named else default_cache()


def is_cache_folder(root: Path) -> bool:
    """Return whether a folder has the marker; False if it is absent or empty.

    Raises:
        InputError: It has no marker and is not empty.
    """
    there = sorted(path.name for path in root.iterdir()) if root.is_dir() else []
    with suppress(OSError), open_no_follow(root / MARKER) as file:  # after the listing: it is the first file in a cache
        if file.read(len(_FORM)) == _FORM:
            return True
    others = [name for name in there if not name.startswith(f".{MARKER}.")]  # another process may be writing the marker
    if others:
        raise _not_a_cache_error(root, others[0])
    return False


def create_cache_folder(root: Path) -> None:
    """Create a cache folder if it is absent, and add the marker to an empty one.

    Raises:
        InputError: It has no marker and is not empty.
        OSError: It has no marker and cannot be written to.
    """
    if not is_cache_folder(root):
        write_atomic(root / MARKER, _MARKER_TEXT)
        write_atomic(root / TAG, _TAG_TEXT)


def _not_a_cache_error(root: Path, name: str) -> InputError:
    setting = next((name for name in _SETTINGS if os.environ.get(name) and Path(os.environ[name]) == root), None)
    if setting:
        remedy = f"set {setting} to an empty folder or to a new one, such as {root / 'dataset-recipe'}"
    elif root == default_cache():
        remedy = "move that away, or set RECIPE_CACHE to an empty folder"
    else:
        remedy = f"name an empty folder or a new one, such as {root / 'dataset-recipe'}"
    return InputError(f"{setting or 'the cache folder'} {root}: it holds {name}, which is not of a cache; {remedy}")


class Store:
    """Entries by kind and key, in a folder that is created on the first write.

    An entry is a file: the line `recipe/store/2 KIND KEY SHA-256`, then the body with that SHA-256.
    """

    def __init__(self, root: Path | None = None) -> None:
        self.root = root or default_cache()

    def path(self, kind: str, key: str) -> Path:
        """Return the path of an entry."""
        return self.root / kind / key[:2] / key

    def get(self, kind: str, key: str) -> bytes | None:
        """Return the body of an entry; None if it is absent, damaged, or belongs to another key."""
        file = self.open(kind, key)
        if file is None:
            return None
        with file:
            return file.read()

    def open(self, kind: str, key: str) -> BinaryIO | None:
        """Return the file of an entry, at the first byte of its body, after verifying the digest.

        None if it is absent or damaged, or belongs to another key.
        """
        path = self.path(kind, key)
        try:
            with ExitStack() as stack:
                file = stack.enter_context(open_no_follow(path))
                head, hasher = file.readline(_LONGEST_HEADER), hashlib.sha256()
                while piece := file.read(1 << 20):
                    hasher.update(piece)
                if head != header(kind, key, hasher.hexdigest()):
                    return None
                file.seek(len(head))
                with suppress(OSError):
                    os.utime(path)  # pruning removes the least recently used entries
                stack.pop_all()
                return file
        except OSError:
            return None

    def put(self, kind: str, key: str, body: bytes | Iterable[bytes]) -> None:
        """Write an entry.

        Raises:
            RunError: the folder cannot be written.
            InputError: the folder is not a cache.
        """
        if kind not in KINDS:
            raise ValueError(f"the store has no kind {kind!r}")
        ours = self.root == default_cache()
        remedy = (
            "free some space, or set RECIPE_CACHE to another folder" if ours else "free some space or allow writing"
        )
        hasher = hashlib.sha256()
        with host_errors(f"the {'cache' if ours else 'folder'} {self.root}", remedy):
            create_cache_folder(self.root)
            with atomic_file(self.path(kind, key)) as file:
                file.write(header(kind, key, hasher.hexdigest()))  # placeholder of the same length
                for piece in [body] if isinstance(body, bytes) else body:
                    hasher.update(piece)
                    file.write(piece)
                file.seek(0)
                file.write(header(kind, key, hasher.hexdigest()))

    def trace(self, scene: ScenePlan, simulate: Callable[[], Trace], *, contacts: bool = False) -> Trace:
        """Return the Trace of a scene: from the store if it has an intact one, else simulated and stored.

        Args:
            scene: The plan of the scene.
            simulate: Returns a new Trace.
            contacts: Whether a Trace without its contacts counts as absent.
        """
        kept = self.kept_trace(scene)
        if kept is not None and (kept.contacts is not None or not contacts):
            return kept
        return self.keep_trace(scene, simulate())

    def has_trace(self, scene: ScenePlan) -> bool:
        """Return whether the store has an intact Trace of a scene."""
        return self.kept_trace(scene) is not None

    def keep_trace(self, scene: ScenePlan, trace: Trace) -> Trace:
        """Store a scene's Trace and its contacts, replacing existing ones. Returns it as read from the store."""
        self.put("traces", _trace_key(scene), trace.pieces())
        if trace.contacts is not None:
            rows = [astuple(contact) for contact in trace.contacts]
            self.put("contacts", _trace_key(scene), json.dumps(rows).encode())
        return self.kept_trace(scene) or trace

    def kept_trace(self, scene: ScenePlan) -> Trace | None:
        """A scene's stored Trace, mapped from its file and not read into memory; None if it is absent or damaged."""
        file = self.open("traces", _trace_key(scene))
        if file is None:
            return None
        with file:
            trace = Trace.from_file(file, checked=True)
        body = self.get("contacts", _trace_key(scene))
        contacts = None if body is None else tuple(ContactEvent(*row) for row in json.loads(body))
        return replace(trace, contacts=contacts)


def header(kind: str, key: str, sha256: str) -> bytes:
    """Return the first line of an entry, which ties its body to its kind and key."""
    return f"{FORMAT} {kind} {key} {sha256}\n".encode()


def _trace_key(scene: ScenePlan) -> str:
    return digest("store/trace/1", [scene.digest, simulator_identity()])
