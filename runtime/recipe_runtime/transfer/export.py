"""Exports a dataset in one of the formats, into a folder that has an index and is put in its place when it is complete.

index.json    what the export was made from; size in bytes and SHA-256 of every file

Equal datasets give equal exports. Labels and pictures are compared with the manifest while they are read, so damaged
files are never exported.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.core.documents import decode_exactly
from recipe_runtime.core.files import entries_below, has_content, host_errors, is_folder, plain_path, read_inside
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import Index, Notice, StagedFolder, check_apart, check_place, ignore, is_free
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer import formats
from recipe_runtime.transfer.formats.format import Entry, Options, Remarks, Row, Size
from recipe_runtime.transfer.formats.sequence import ExportSequence

INDEX = "index.json"
_BYTES_PER_FRAME, _MIN_BYTES = 5000, 16 << 20  # of an index, at most; Armory's layouts have the most files
_REMEDY = "free some space or choose another folder, then export again"

_Index: TypeAlias = dict[str, str | int | list[Row] | dict[str, tuple[Size, str]]]


@dataclass(frozen=True)
class Exported:
    """A complete export.

    Attributes:
        index: The content of `index.json`.
        rows: Its files.
        summary: The number of its files or shards, in words.
        remarks: What the command reports of it.
    """

    index: Mapping[str, object]
    rows: Sequence[Row]
    summary: str
    remarks: Remarks

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(row["size"] for row in self.rows)

    def document(self) -> dict[str, object]:
        """Return the index for `--json`, with the number of files in place of a table of them."""
        files = {"files": len(self.rows)} if "files" in self.index else {}
        return {**self.index, **files, "bytes": self.size, **self.remarks.facts}


def export(
    dataset: Dataset,
    out: Path,
    name: str,
    progress: Progress,
    *,
    options: Options = MappingProxyType({}),
    replace: bool = False,
    notice: Notice = ignore,
) -> Exported:
    """Export all frames of a dataset, unless the same export exists already.

    Args:
        dataset: The dataset.
        out: The folder to create; it appears when the export is complete.
        name: The format, a key of `formats.FORMATS`.
        progress: Called to report progress.
        options: The options of the format that are given.
        replace: Whether another folder may be replaced. What is not an export's stays as `NAME.replaced`.
        notice: Called with a line of text if a replaced folder is kept.

    Raises:
        InputError: `out` cannot be replaced, or has files and `replace` is not set; a file of the dataset is damaged;
            the format cannot have this dataset, or an option is invalid.
        RunError: The files cannot be written, or another process writes to `out`.
    """
    form = formats.declared(name)
    key = {"dataset": dataset.lock.identity, **form.key(name, options)}
    form.check(dataset, options)
    out = plain_path(out)
    check_place(out)
    check_apart(out, dataset.root, "which is exported")
    listed, owner = Index(INDEX, partial(_listed, dataset)), f"export of {dataset.plan.recipe}"
    with host_errors(str(out), _REMEDY):
        staged = StagedFolder(out, listed, owner=owner, replace=replace, notice=notice)
        staged.settle()
        rows = _complete(dataset, out, {**key, **form.table([])})
        if rows is None:
            if not replace and not is_free(out):
                raise InputError(
                    f"{out} exists already, and is not this export",
                    help="choose another folder, or replace it",
                    code=Code.OUTPUT_IN_THE_WAY,
                )
            with staged:
                try:
                    rows = _write(staged.files, form.files(_sequences(dataset, progress), options))
                    (staged.files / INDEX).write_bytes(canonical_bytes({**key, **form.table(rows)}) + b"\n")
                    staged.publish()
                except BaseException:
                    staged.remove()
                    raise
    return Exported({**key, **form.table(rows)}, rows, form.summary(rows), form.remarks(dataset, out, rows))


def _sequences(dataset: Dataset, progress: Progress) -> list[ExportSequence]:
    """Return all sequences of a dataset, which report the frames that are read."""
    pairs = [(variant, sensor) for variant in dataset.plan.variants for sensor in variant.rig.sensors]
    frames = [sensor.frames(variant.scene.clock.frames) for variant, sensor in pairs]
    total, before, found = sum(map(len, frames)), 0, list[ExportSequence]()
    for number, ((variant, sensor), mine) in enumerate(zip(pairs, frames, strict=True)):
        found.append(ExportSequence(dataset, variant, sensor, number, partial(_report, progress, before, mine, total)))
        before += len(mine)
    return found


def _report(progress: Progress, before: int, frames: range, total: int, frame: int) -> None:
    progress("export", before + frames.index(frame) + 1, total)


def _write(folder: Path, files: Iterator[Entry]) -> list[Row]:
    """Write files into a folder, and return their rows."""
    rows = list[Row]()
    for entry in files:
        target, hasher, size = folder / entry.path, hashlib.sha256(), 0
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("wb") as file:
            for piece in [entry.content] if isinstance(entry.content, bytes) else entry.content:
                data = piece.encode() if isinstance(piece, str) else piece
                file.write(data)
                hasher.update(data)
                size += len(data)
        rows.append({"file": entry.path, "size": size, "sha256": hasher.hexdigest(), **entry.facts})
    return rows


def _read(out: Path, dataset: Dataset) -> _Index:
    """Return the index in a folder; empty if it is absent, damaged or longer than one can be."""
    frames = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    try:
        body = read_inside(out, INDEX, max(_MIN_BYTES, _BYTES_PER_FRAME * frames)) if is_folder(out) else b""
        return decode_exactly(body, _Index)
    except (OSError, ValueError):
        return {}


def _rows(index: _Index) -> list[Row]:
    """Return the rows of the files of an index."""
    rows = list[Row]()
    for table in index.values():
        if isinstance(table, list):
            rows += table
        elif isinstance(table, dict):
            rows += [{"file": path, "size": size, "sha256": sha256} for path, (size, sha256) in table.items()]
    return rows


def parsed_rows(body: bytes) -> list[Row]:
    """Return the rows of the files of an index; none if it is damaged."""
    try:
        return _rows(decode_exactly(body, _Index))
    except ValueError:
        return []


def _listed(dataset: Dataset, folder: Path) -> dict[str, tuple[int, str]] | None:
    return {row["file"]: (row["size"], row["sha256"]) for row in _rows(_read(folder, dataset))} or None


def _complete(dataset: Dataset, out: Path, empty: Mapping[str, object]) -> list[Row] | None:
    """Return the rows of a complete export, all files of which have the bytes that its index records.

    Args:
        dataset: The dataset.
        out: The folder.
        empty: The index that the export would have without files.
    """
    index = _read(out, dataset)
    if {name: value if isinstance(value, str | int) else type(value)() for name, value in index.items()} != empty:
        return None
    rows = _rows(index)
    found = {path.relative_to(out).as_posix() for path in entries_below(out) if not is_folder(path)}
    if found != {INDEX, *(row["file"] for row in rows)}:
        return None
    return rows if all(has_content(out, row["file"], row["size"], row["sha256"]) for row in rows) else None
