"""Reads a dataset's `manifest.json` from an untrusted file: a limit in bytes, one decoding, and checks of its paths."""

from __future__ import annotations

import io
from pathlib import Path
from typing import BinaryIO, TypedDict

from recipe_runtime.core import layout
from recipe_runtime.core.documents import Raw, decode, decode_exactly
from recipe_runtime.core.files import open_inside
from recipe_runtime.core.staged_folder import Index
from recipe_runtime.dataset.manifest import FORMAT, listed_files
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.plan_checks import MAX_MANIFEST_BYTES

MAX_BYTES = MAX_MANIFEST_BYTES
_MAX_HEAD_BYTES = 8 << 20  # of a list of names


class _Format(TypedDict):
    format: str


class _Head(_Format, total=False):
    """The parts whose short texts take many times their bytes in memory, not decoded."""

    order: Raw
    outputs: Raw
    stages: Raw
    tools: Raw


class NotAManifestError(ValueError):
    """The document is not a manifest of this project, as opposed to a damaged one."""


def read(root: Path) -> Manifest:
    """Read the manifest of the dataset in a folder.

    Raises:
        NotAManifestError: the folder has no manifest of this project.
        ValueError: the manifest is damaged.
        OSError: it cannot be read.
    """
    try:
        file = open_inside(root, layout.MANIFEST)
    except PermissionError:
        raise
    except (OSError, ValueError):
        raise NotAManifestError(f"it holds no {layout.MANIFEST}") from None
    with file:
        return parse(file)


def parse(file: BinaryIO) -> Manifest:
    """Decode and check a manifest.

    Raises:
        NotAManifestError: it is not a manifest of this project.
        ValueError: it is damaged, or exceeds a limit.
    """
    size = file.seek(0, io.SEEK_END)
    if size > MAX_BYTES:
        raise ValueError(f"its {layout.MANIFEST} has {size:,} bytes, and at most {MAX_BYTES:,} are read")
    file.seek(0)
    body = file.read(size)
    try:
        head = decode(body, _Head)
        of_this_project = head["format"].startswith(FORMAT.rpartition("/")[0])
    except ValueError:
        of_this_project = False
    if not of_this_project:
        raise NotAManifestError("it does not say that it is a manifest of this project")
    if any(isinstance(value, Raw) and len(bytes(value)) > _MAX_HEAD_BYTES for value in head.values()):
        raise ValueError(f"it has lists of more than {_MAX_HEAD_BYTES:,} bytes")
    manifest = decode_exactly(body, Manifest)
    listed_files(manifest)
    if sorted(manifest["order"]) != sorted(manifest["variants"]):
        raise ValueError("order and variants name different variants, or one twice")
    for name, row in manifest["variants"].items():
        if row["folder"] != layout.folder(name):
            raise ValueError(f"the variant {name!r} has another folder than its name says")
    return manifest


def read_or_none(root: Path) -> Manifest | None:
    """Return the manifest in a folder; None if there is none, it is damaged, or another program wrote it."""
    try:
        return read(root)
    except (OSError, ValueError):
        return None


def _files_of(root: Path) -> dict[str, tuple[int, str]] | None:
    manifest = read_or_none(root)
    return None if manifest is None else listed_files(manifest)


FILES = Index(layout.MANIFEST, _files_of)
"""The manifest as the index of a dataset's folder."""
