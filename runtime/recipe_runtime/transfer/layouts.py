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
from typing import Literal, TypedDict, cast

from recipe_runtime.annotate import kitti
from recipe_runtime.annotate.mots import mots_lines, seqinfo, seqmap
from recipe_runtime.core import layout
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import Notice, ignore
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.tracks import field
from recipe_runtime.transfer import armory
from recipe_runtime.transfer.export_folder import export
from recipe_runtime.transfer.export_sequence import Entry, ExportSequence

Layout = Literal["mots", "kitti", "armory"]
_FORMAT = "recipe/layout/1"


class _Choice(TypedDict, total=False):
    patch: str  # for armory, if the caller chose one


class LayoutIndex(_Choice):
    """`index.json`: the dataset's identity, the layout, and size and SHA-256 of every file."""

    format: str
    dataset: str
    layout: str
    files: dict[str, list[int | str]]


def export_layout(
    dataset: Dataset,
    out: Path,
    form: Layout,
    progress: Progress,
    *,
    patch: str | None = None,
    replace: bool = False,
    notice: Notice = ignore,
) -> LayoutIndex:
    """Export all frames of a dataset, and return the index of the files.

    Args:
        dataset: the dataset.
        out: the folder to create; it appears when the export is complete.
        form: the layout.
        progress: called to report progress.
        patch: for armory, the name of the patch to export; the first of each variant if None.
        replace: whether an existing folder may be replaced.
        notice: called with a line of text if a replaced folder is kept.

    Raises:
        InputError: `out` exists and `replace` is not set, a file of the dataset is damaged, or it lacks the patch.
        RunError: the files cannot be written, or another process writes to `out`.
    """
    made_from = {"format": _FORMAT, "dataset": dataset.lock.identity, "layout": form}
    made_from |= {} if patch is None else {"patch": patch}
    if form == "armory":
        armory.check_patches(dataset, patch)
    sequences = [
        ExportSequence(dataset, variant, sensor, number, patch)
        for number, (variant, sensor) in enumerate((v, s) for v in dataset.plan.variants for s in v.rig.sensors)
    ]

    def write(work: Path) -> dict[str, object]:
        files: dict[str, list[int | str]] = {}
        for done, sequence in enumerate(sequences):
            progress("export", done, len(sequences))
            files.update(_write(work, path, content) for path, content in _LAYOUTS[form](sequence))
        files.update(_write(work, path, content) for path, content in _LISTS[form](sequences))
        progress("export", len(sequences), len(sequences))
        return {"files": dict(sorted(files.items()))}

    return cast("LayoutIndex", export(dataset, out, made_from, write, replace=replace, notice=notice))


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


def _write(work: Path, path: str, content: bytes | Iterable[str]) -> tuple[str, list[int | str]]:
    """Write a file, and return its row of the index."""
    target, hasher, size = work / path, hashlib.sha256(), 0
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("wb") as file:
        for piece in [content] if isinstance(content, bytes) else (text.encode() for text in content):
            file.write(piece)
            hasher.update(piece)
            size += len(piece)
    return path, [size, hasher.hexdigest()]
