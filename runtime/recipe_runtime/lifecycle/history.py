"""The commits at which a frame of a recipe changed, from the lockfiles in a git repository: nothing is rendered.

A committed lockfile has a digest of every frame, so the history of its file is the history of the frames.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.lockfile import Lockfile

_GIT = ("git", "-c", "core.quotePath=off", "-c", "core.fsmonitor=false", "-c", "core.pager=cat")


@dataclass(frozen=True)
class Pixel:
    """The frame whose history is asked for."""

    variant: str
    sensor: str
    modality: str
    frame: int

    def digest(self, lock: Lockfile) -> str | None:
        """Return the frame's digest in a lockfile, or None if it has no such frame."""
        row = lock.variants.get(self.variant)
        if row is None:
            return None
        return lock.frames.get((row.frame_key(self.modality), self.sensor, self.modality, self.frame))


@dataclass(frozen=True)
class Change:
    """A commit at which a frame changed.

    Attributes:
        commit: Its full name.
        date: Its date, as in YYYY-MM-DD.
        subject: The first line of its message.
        digest: The frame's digest since then; None if it no longer exists.
        cause: What else changed in the lockfile that explains it.
    """

    commit: str
    date: str
    subject: str
    digest: str | None
    cause: str


def changes(path: Path, pixel: Pixel, start: str | None = None) -> Iterator[Change]:
    """Yield the commits at which a frame changed, oldest first; the first one is that in which it appeared.

    Args:
        path: The lockfile, in a git repository.
        pixel: The frame.
        start: A revision; only later commits are compared, with this one. None: all.

    Raises:
        InputError: the file is not in a git repository, or `start` is no revision.
        RunError: git is not installed.
    """
    if start is not None and start.startswith("-"):
        raise InputError(f"{start!r} is not a revision")
    folder, name = path.resolve().parent, path.name
    head = f"{start}..HEAD" if start is not None else "HEAD"
    listed = _git(folder, "log", "--reverse", "--format=%H%x09%as%x09%s", head, "--", name)
    before: Lockfile | None = _at(folder, start, name) if start is not None else None
    known = pixel.digest(before) if before is not None else None
    for line in listed.decode(errors="replace").splitlines():
        commit, date, subject = line.split("\t", 2)
        now = _at(folder, commit, name)
        digest = pixel.digest(now) if now is not None else None
        if digest != known:
            yield Change(commit, date, subject, digest, _cause(before, now, pixel))
        before, known = now, digest


def _at(folder: Path, commit: str, name: str) -> Lockfile | None:
    """Return the lockfile of a commit; None if it is not there, or of a format that is no longer read."""
    try:
        body = _git(folder, "show", f"{commit}:./{name}")
        return lockfile.loads(body.decode("ascii"), f"{name} of {commit[:10]}")
    except (InputError, UnicodeDecodeError):
        return None


def _cause(before: Lockfile | None, now: Lockfile | None, pixel: Pixel) -> str:
    if now is None or pixel.digest(now) is None:
        return "it was removed"
    if before is None or pixel.digest(before) is None:
        return "it was added"
    old, new = before.variants[pixel.variant], now.variants[pixel.variant]
    parts = [part for part in ("scene", "rig", "appearance") if getattr(old, part) != getattr(new, part)]
    if parts:
        files = _differing(before.files, now.files)
        return f"the plan changed: {', '.join(parts)}" + (f" (files: {', '.join(files[:4])})" if files else "")
    if before.traces.get(old.scene) != now.traces.get(new.scene):
        return "the motion changed, and the plan did not"
    tools = _differing(before.tools, now.tools)
    return "the code changed, and plan and motion did not" + (f" (tools: {', '.join(tools)})" if tools else "")


def _differing(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    return [name for name in sorted({**before, **now}) if before.get(name) != now.get(name)]


def _git(folder: Path, *arguments: str) -> bytes:
    try:
        done = subprocess.run(
            [*_GIT, "-C", str(folder), *arguments], capture_output=True, check=False, stdin=subprocess.DEVNULL
        )
    except FileNotFoundError:
        raise RunError("git is not installed, and the history is read with it") from None
    if done.returncode:
        reason = done.stderr.decode(errors="replace").strip().splitlines() or ["git failed"]
        raise InputError(f"{folder}: {reason[-1][:300]}", help="name a lockfile in a git repository")
    return done.stdout
