"""Exports a dataset in the layout of MOTSChallenge, KITTI or Armory.

    mots:  MOTS-train/<sequence>/gt/gt.txt, seqinfo.ini, img1/000001.png; seqmaps/MOTS-train.txt
    kitti: training/label_02/0000.txt, calib/0000.txt, poses/0000.txt, image_02/0000/000000.png,
           evaluate_tracking.seqmap.training; mots/label_02/0000.txt, evaluate_mots.seqmap.training; sequences.csv
    armory: see `transfer.armory`
    index.json: the dataset's identity, the layout, the patch if one was chosen, and size and SHA-256 of every file

Equal datasets give equal exports. Labels and pictures are compared with the manifest while they are read, so damaged
files are never exported.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal, TypeAlias, TypedDict, cast

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.annotate import kitti
from recipe_runtime.annotate.mots import mots_lines, seqinfo, seqmap
from recipe_runtime.core import layout
from recipe_runtime.core.documents import Meta
from recipe_runtime.core.files import entries_below, host_errors, is_folder
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset.manifest_reader import stamp
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.tracks import field
from recipe_runtime.transfer import armory
from recipe_runtime.transfer.export_folder import (
    check_destination,
    holds_files,
    is_empty,
    publish,
    recover,
    work_folder,
)
from recipe_runtime.transfer.export_index import read_index
from recipe_runtime.transfer.export_sequence import Entry, ExportSequence

Layout = Literal["mots", "kitti", "armory"]
INDEX = "index.json"
_FORMAT = "recipe/layout/1"
_INDEX_BYTES = 5000  # of the index, per frame: Armory's layouts have the most files
_REMEDY = "free some space or choose another folder, then export again"


FileRow: TypeAlias = tuple[int, str]  # size in bytes, SHA-256
_Path: TypeAlias = Annotated[str, Meta(pattern=r"^(?!.*\.\.)[^/\0][^\0]*\Z")]  # within the export


class _Choice(TypedDict, total=False):
    patch: str  # for armory, if the caller chose one


class LayoutIndex(_Choice):
    """`index.json`: the dataset's identity, the layout, and size and SHA-256 of every file."""

    format: Literal["recipe/layout/1"]
    dataset: str
    layout: str
    files: dict[_Path, FileRow]


def export_layout(
    dataset: Dataset,
    out: Path,
    form: Layout,
    progress: Progress,
    *,
    patch: str | None = None,
    replace: bool = False,
) -> LayoutIndex:
    """Export all frames of a dataset, and return the index of the files.

    Args:
        dataset: the dataset.
        out: the folder to create; it appears when the export is complete.
        form: the layout.
        progress: called to report progress.
        patch: for armory, the name of the patch to export; the first of each variant if None.
        replace: whether an existing export may be replaced.

    Raises:
        InputError: `out` exists and is not an export, a file of the dataset is damaged, or it lacks the patch.
        RunError: the files cannot be written, or another export writes to `out`.
    """
    out = check_destination(out)
    with host_errors(str(out), _REMEDY):
        recover(out)
    there, known = stamp(out, INDEX), _read_index(out, dataset)
    made_from = {"dataset": dataset.lock.identity, "layout": form, **({} if patch is None else {"patch": patch})}
    if known is not None and _made_from(known) == made_from and _is_complete(out, known, dataset):
        return known
    _check_replaceable(out, known, replace=replace)
    sequences = [
        ExportSequence(dataset, variant, sensor, number, patch)
        for number, (variant, sensor) in enumerate((v, s) for v in dataset.plan.variants for s in v.rig.sensors)
    ]
    if form == "armory":
        armory.check_patches(dataset, patch)
    entries = _LAYOUTS[form]
    with host_errors(str(out), _REMEDY), work_folder(out, lambda _: True) as work:
        files: dict[str, FileRow] = {}
        for done, sequence in enumerate(sequences):
            progress("export", done, len(sequences))
            files.update(_write(work, path, content) for path, content in entries(sequence))
        files.update(_write(work, path, content) for path, content in _LISTS[form](sequences))
        progress("export", len(sequences), len(sequences))
        index = cast("LayoutIndex", {"format": _FORMAT, **made_from, "files": dict(sorted(files.items()))})
        (work / INDEX).write_bytes(canonical_bytes(index) + b"\n")
        publish(work, out, None if known is None else lambda old: _is_export(old, known, there))
    return index


def _mots(sequence: ExportSequence) -> Iterator[Entry]:
    camera, clock = sequence.sensor.camera, sequence.variant.scene.clock
    name = layout.sequence(sequence.variant.variant, sequence.sensor.name)
    folder = f"{layout.MOTS_SPLIT}/{name}"
    yield f"{folder}/gt/gt.txt", mots_lines(sequence.labels(), camera.width, camera.height)
    info = seqinfo(name, "img1", clock.fps, _length(sequence), camera.width, camera.height)
    yield f"{folder}/seqinfo.ini", [info]
    for frame, picture in sequence.pictures():
        yield f"{folder}/img1/{frame + 1:06d}.png", picture


def _mots_lists(sequences: list[ExportSequence]) -> Iterator[Entry]:
    names = [layout.sequence(s.variant.variant, s.sensor.name) for s in sequences]
    yield f"seqmaps/{layout.MOTS_SPLIT}.txt", [seqmap(names)]


def _kitti(sequence: ExportSequence) -> Iterator[Entry]:
    camera, name = sequence.sensor.camera, f"{sequence.number:04d}"
    yield f"training/label_02/{name}.txt", kitti.label_lines(sequence.labels())
    first = next(sequence.labels(), None)
    if first is not None:
        yield f"training/calib/{name}.txt", [kitti.calibration_text(first["calibration"])]
    yield f"training/poses/{name}.txt", kitti.pose_lines(sequence.labels())
    yield f"mots/label_02/{name}.txt", mots_lines(sequence.labels(), camera.width, camera.height, first=0)
    for frame, picture in sequence.pictures():
        yield f"training/image_02/{name}/{frame:06d}.png", picture


def _kitti_lists(sequences: list[ExportSequence]) -> Iterator[Entry]:
    """Yield the lists of sequences. KITTI's tracking list has the number of frames, its MOTS list the last frame."""
    lengths = [(f"{s.number:04d}", _length(s)) for s in sequences]
    tracking = [f"{name} empty 000000 {length:06d}\n" for name, length in lengths]
    yield "training/evaluate_tracking.seqmap.training", tracking
    yield "mots/evaluate_mots.seqmap.training", [f"{name} empty 000000 {n - 1:06d}\n" for name, n in lengths]
    rows = (f"{s.number:04d},{field(s.variant.variant)},{field(s.sensor.name)}\n" for s in sequences)
    yield "sequences.csv", ["sequence,variant,sensor\n", *rows]


def _length(sequence: ExportSequence) -> int:
    """Return the number of frames from frame 0 to the last one that the sensor captures."""
    return sequence.frames[-1] + 1


_LAYOUTS: dict[Layout, Callable[[ExportSequence], Iterator[Entry]]] = {
    "mots": _mots,
    "kitti": _kitti,
    "armory": armory.sequence_files,
}
_LISTS: dict[Layout, Callable[[list[ExportSequence]], Iterator[Entry]]] = {
    "mots": _mots_lists,
    "kitti": _kitti_lists,
    "armory": armory.annotation_files,
}


def _write(work: Path, path: str, content: bytes | Iterable[str]) -> tuple[str, FileRow]:
    """Write a file, and return its row of the index."""
    target, hasher, size = work / path, hashlib.sha256(), 0
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("wb") as file:
        for piece in [content] if isinstance(content, bytes) else (text.encode() for text in content):
            file.write(piece)
            hasher.update(piece)
            size += len(piece)
    return path, (size, hasher.hexdigest())


def _check_replaceable(out: Path, known: LayoutIndex | None, *, replace: bool) -> None:
    other = out.exists() and not is_empty(out) and (known is None or not _has_only(out, known))
    if out.is_symlink() or other:
        raise InputError(
            f"{out} exists already and has files that do not belong to an export",
            help="move it away, or choose another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if known is not None and not replace:
        raise InputError(
            f"{out} exists already and is a different export",
            help="choose another folder, or replace it",
            code=Code.OUTPUT_IN_THE_WAY,
        )


def _is_export(folder: Path, index: LayoutIndex, before: tuple[int, int, int] | None) -> bool:
    """Return whether a folder contains only the export of an index, whose file had the stamp `before`."""
    return stamp(folder, INDEX) == before and _has_only(folder, index)


def _has_only(folder: Path, index: LayoutIndex) -> bool:
    """Return whether a folder contains exactly the files of an index, besides folders."""
    found = {p.relative_to(folder).as_posix() for p in entries_below(folder) if not is_folder(p)}
    return found == {INDEX, *index["files"]}


def _read_index(out: Path, dataset: Dataset) -> LayoutIndex | None:
    """Return the index of an export; None if it is absent or damaged."""
    return read_index(out, INDEX, dataset, _INDEX_BYTES, LayoutIndex)


def _made_from(index: LayoutIndex) -> dict[str, object]:
    """Return what an export was made from: dataset, layout and patch."""
    return {key: value for key, value in index.items() if key not in ("format", "files")}


def _is_complete(out: Path, known: LayoutIndex, dataset: Dataset) -> bool:
    """Return whether a folder contains exactly the files of its index, with the bytes recorded there."""
    rows = ((path, *row) for path, row in known["files"].items())
    listed = known["layout"] != "armory" or armory.LEFT_OUT in known["files"]
    return listed and _has_only(out, known) and holds_files(out, rows, dataset)
