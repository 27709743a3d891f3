"""A key-value store of Traces, pixels and records, addressed by digests of their inputs.

The store is in the user's cache folder, or in the folder that RECIPE_CACHE names. Entries are verified when read: a
damaged one counts as absent and is regenerated. Concurrent builds may write the same entry: they write the same bytes,
and each write is one atomic rename.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import stat
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from dataclasses import astuple, replace
from pathlib import Path
from typing import BinaryIO

import platformdirs
from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.core.files import atomic_file, host_errors, make_folder, open_inside
from recipe_runtime.core.trace import ContactEvent, Trace
from recipe_runtime.core.versions import simulator_identity

FORMAT = "recipe/store/2"
KINDS = ("built", "contacts", "downloads", "pixels", "shards", "traces")
"""All kinds of entries; other files in a cache folder do not belong to this project."""
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
        """Return the body of an entry; None if it is absent, damaged, another user's, or belongs to another key."""
        file = self.open(kind, key)
        if file is None:
            return None
        with file:
            return file.read()

    def open(self, kind: str, key: str) -> BinaryIO | None:
        """Return the file of an entry, at the first byte of its body, after verifying the digest.

        None if it is absent or damaged, or belongs to another key, or to another user than this one or root.
        """
        path = self.path(kind, key)
        try:
            with ExitStack() as stack:
                file = stack.enter_context(open_inside(self.root, f"{kind}/{key[:2]}/{key}"))
                if not _is_own(os.fstat(file.fileno())):
                    return None
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
        except (OSError, ValueError):
            return None

    def put(self, kind: str, key: str, body: bytes | Iterable[bytes]) -> None:
        """Write an entry.

        Raises:
            RunError: the folder cannot be written.
            InputError: the folder is not a cache.
        """
        from recipe_runtime.cache.cache_folder import create_cache_folder

        if kind not in KINDS:
            raise ValueError(f"the store has no kind {kind!r}")
        ours = self.root == default_cache()
        remedy = (
            "free some space, or set RECIPE_CACHE to another folder" if ours else "free some space or allow writing"
        )
        hasher = hashlib.sha256()
        with host_errors(f"the {'cache' if ours else 'folder'} {self.root}", remedy):
            create_cache_folder(self.root)
            path = self.path(kind, key)
            for folder in (path.parent.parent, path.parent):
                make_folder(folder)
            with atomic_file(path) as file:
                _bar_others(file)
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
            try:
                trace = Trace.from_file(file, checked=True)
            except (ValueError, KeyError):
                return None  # written in an older format
        return replace(trace, contacts=self._contacts(scene)) if is_motion_of(trace, scene) else None

    def _contacts(self, scene: ScenePlan) -> tuple[ContactEvent, ...] | None:
        """The contacts of a scene's stored Trace; None if they are absent, damaged, or of an older format."""
        body = self.get("contacts", _trace_key(scene))
        try:
            rows = [] if body is None else json.loads(body)
            found = tuple(ContactEvent(*row) for row in rows)
        except (ValueError, TypeError, RecursionError):
            return None
        usable = all(
            type(e.first) is type(e.second) is str
            and type(e.start) is type(e.end) is int
            and isinstance(e.impulse, (int, float))
            for e in found
        )
        return found if body is not None and usable else None

    def replace_bad_trace(self, scene: ScenePlan, trace: Trace) -> None:
        """Replace a scene's stored Trace if it differs from this newly simulated one.

        Does nothing if none is stored or the folder cannot be written.
        """
        kept = self.kept_trace(scene)
        if kept is not None and kept.contacts in (None, trace.contacts) and _equal_motion(kept, trace):
            return
        if self.path("traces", _trace_key(scene)).is_file():
            with suppress(RunError):
                self.keep_trace(scene, trace)


def _equal_motion(one: Trace, other: Trace) -> bool:
    return all(a == b for a, b in itertools.zip_longest(one.pieces(), other.pieces()))


def _is_own(found: os.stat_result) -> bool:
    """Return whether no other user can have written a file: anyone can compute the digest of an entry."""
    return found.st_uid in (os.geteuid(), 0) and not found.st_mode & stat.S_IWOTH


def _bar_others(file: BinaryIO) -> None:
    """Let other users not write a new entry, which would count as absent (`_is_own`): the umask may allow it."""
    mode = os.fstat(file.fileno()).st_mode
    if mode & stat.S_IWOTH:
        with suppress(OSError):  # a file system without modes
            os.fchmod(file.fileno(), stat.S_IMODE(mode) & ~stat.S_IWOTH)


def header(kind: str, key: str, sha256: str) -> bytes:
    """Return the first line of an entry, which ties its body to its kind and key."""
    return f"{FORMAT} {kind} {key} {sha256}\n".encode()


def is_motion_of(trace: Trace, scene: ScenePlan) -> bool:
    """Whether a Trace has the frames, the actors and the parts of a scene, in the plan's order."""
    from recipe_runtime.body.skeleton import part_names

    if trace.frames != scene.clock.frames or trace.actors != tuple(actor.name for actor in scene.actors):
        return False
    parts = {name: tuple(group) for name, group in itertools.groupby(trace.parts, lambda part: part.rpartition("/")[0])}
    return tuple(parts) == trace.actors and all(
        parts[actor.name]
        in ((f"{actor.name}/base",), tuple(f"{actor.name}/{part}" for part in part_names(actor.shape)))
        for actor in scene.actors  # (an engine may represent an actor by one rigid part, `base`)
    )


def _trace_key(scene: ScenePlan) -> str:
    return digest("store/trace/1", [scene.digest, simulator_identity()])
