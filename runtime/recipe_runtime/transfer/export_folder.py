"""The folder of an export: its index, and how it is put in its place.

index.json    what the export was made from; size in bytes and SHA-256 of every file
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, TypeAlias, TypedDict

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.documents import Meta, decode_exactly
from recipe_runtime.core.files import entries_below, has_content, host_errors, is_folder, plain_path, read_inside
from recipe_runtime.core.staged_folder import Index, Notice, StagedFolder, check_place, ignore, is_free
from recipe_runtime.dataset.plan_checks import byte_count
from recipe_runtime.dataset.reader import Dataset

INDEX = "index.json"
_BYTES_PER_FRAME, _MIN_BYTES = 5000, 16 << 20  # of an index, at most; Armory's layouts have the most files
_REMEDY = "free some space or choose another folder, then export again"

_Size: TypeAlias = Annotated[int, Meta(ge=0, le=1 << 50)]


class _Shard(TypedDict):
    file: str
    samples: _Size
    size: _Size
    sha256: str


class _Index(TypedDict, total=False):
    """An index: what the export was made from, and its shards or files."""

    format: str
    dataset: str
    layout: str
    patch: str
    shard_bytes: int
    shards: list[_Shard]
    files: dict[str, tuple[_Size, str]]


def export(
    dataset: Dataset,
    out: Path,
    made_from: Mapping[str, str | int],
    write: Callable[[Path], Mapping[str, object]],
    *,
    replace: bool = False,
    notice: Notice = ignore,
) -> dict[str, object]:
    """Write an export, unless it exists already, and return its index.

    Args:
        dataset: the dataset.
        out: the folder to create; it appears when the export is complete.
        made_from: what determines the content, the first part of the index.
        write: writes all files into a folder, and returns the second part of the index, `files` or `shards`.
        replace: whether a folder with files may be replaced. What is not an export's stays as `NAME.replaced`.
        notice: called with a line of text if a replaced folder is kept.

    Raises:
        InputError: `out` cannot be replaced, or has files and `replace` is not set.
        RunError: the files cannot be written, or another process writes to `out`.
    """
    out = plain_path(out)
    check_place(out)
    index, name = Index(INDEX, partial(_rows, dataset)), f"export of {dataset.plan.recipe}"
    with host_errors(str(out), _REMEDY):
        staged = StagedFolder(out, index, recipe=name, replace=replace, notice=notice)
        staged.settle()
        known, body = _read(out, dataset)
        same = {key: value for key, value in known.items() if key not in ("shards", "files")} == made_from
        if same and _is_complete(out, _listed(known), dataset):
            found: dict[str, object] = json.loads(body)
            return found
        if not replace and not is_free(out):
            raise InputError(
                f"{out} exists already, and is not this export",
                help="choose another folder, or replace it",
                code=Code.OUTPUT_IN_THE_WAY,
            )
        with staged:
            try:
                made = {**made_from, **write(staged.dataset)}
                (staged.dataset / INDEX).write_bytes(canonical_bytes(made) + b"\n")
                staged.publish()
            except BaseException:
                staged.remove()
                raise
    return made


def _read(out: Path, dataset: Dataset) -> tuple[_Index, bytes]:
    """Return the index in a folder and its bytes; empty if it is absent, damaged or longer than one can be."""
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    try:
        body = read_inside(out, INDEX, max(_MIN_BYTES, _BYTES_PER_FRAME * frames)) if is_folder(out) else b""
        return decode_exactly(body, _Index), body
    except (OSError, ValueError):
        return {}, b""


def _listed(index: _Index) -> dict[str, tuple[int, str]]:
    """Return size and SHA-256 of each file, by path."""
    shards = {shard["file"]: (shard["size"], shard["sha256"]) for shard in index.get("shards", [])}
    return {**shards, **index.get("files", {})}


def _rows(dataset: Dataset, folder: Path) -> dict[str, tuple[int, str]] | None:
    return _listed(_read(folder, dataset)[0]) or None


def _is_complete(out: Path, rows: Mapping[str, tuple[int, str]], dataset: Dataset) -> bool:
    """Return whether a folder contains exactly the files of an index, with the bytes recorded there.

    No more bytes are hashed than exports of the dataset can have: a sparse file of any size needs no space in an
    archive.
    """
    found = {path.relative_to(out).as_posix() for path in entries_below(out) if not is_folder(path)}
    if found != {INDEX, *rows} or sum(size for size, _ in rows.values()) > 2 * byte_count(dataset.plan):
        return False
    return all(has_content(out, path, size, sha256) for path, (size, sha256) in rows.items())
