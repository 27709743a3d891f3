"""Exports a dataset as WebDataset shards: tar files in which the files of a frame are adjacent and share a key.

    weather_sweep-000000.tar
        weather=sunny/street/000000.depth.png     the dataset's own files, byte for byte
        weather=sunny/street/000000.json          variant, sensor, fps, frame, and the records of labels.jsonl
        weather=sunny/street/000000.rgb.png
    index.json                                    the dataset's identity; samples, size and SHA-256 of every shard

Equal datasets give equal shards: samples are in the dataset's order, and headers contain no data of the host. Every
file is compared with the manifest while it is copied, so damaged files are never exported.
"""

from __future__ import annotations

import hashlib
import io
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final, Literal, TypedDict

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import codecs, layout
from recipe_runtime.core.documents import Meta
from recipe_runtime.core.files import file_sha256, host_errors, is_folder, read_inside, regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset.manifest_reader import stamp
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.transfer.export_folder import (
    MARKER,
    check_destination,
    holds_files,
    is_empty,
    publish,
    recover,
    work_folder,
)
from recipe_runtime.transfer.export_index import read_index

INDEX = "index.json"
SHARD_BYTES = 1 << 30
_FORMAT: Final = "recipe/webdataset/1"
_INDEX_BYTES = 300  # of the index, per shard, which holds one frame or more
_REMEDY = "free some space or choose another folder, then export again"


class ShardRecord(TypedDict):
    """A shard in the index: file name, number of samples, size in bytes and SHA-256."""

    file: Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*-[0-9]{6,}\.tar\Z")]
    samples: Annotated[int, Meta(ge=0)]
    size: Annotated[int, Meta(ge=0)]
    sha256: str


class ExportIndex(TypedDict):
    """`index.json`: the dataset's identity, the size limit of a shard in bytes, and the shards in order."""

    format: Literal["recipe/webdataset/1"]
    dataset: str
    shard_bytes: int
    shards: list[ShardRecord]


Sample = list[tuple[tarfile.TarInfo, bytes]]  # the files of one frame


@dataclass
class _Shard:
    """A shard that is being written."""

    path: Path
    samples: int = 0
    tar: tarfile.TarFile = field(init=False)

    def __post_init__(self) -> None:
        self.tar = tarfile.TarFile(self.path, "w", format=tarfile.PAX_FORMAT)

    def add(self, sample: Sample) -> None:
        """Add the files of one frame, sorted by name."""
        for entry, body in sample:
            self.tar.addfile(entry, io.BytesIO(body))
        self.tar.getmembers().clear()  # which would keep the header of each file in memory
        self.samples += 1

    def close(self) -> ShardRecord:
        """Close the shard and return its row of the index."""
        self.tar.close()
        size, digest = self.path.stat().st_size, file_sha256(self.path)
        return {"file": self.path.name, "samples": self.samples, "size": size, "sha256": digest}


def webdataset(
    dataset: Dataset,
    out: Path,
    progress: Progress,
    shard_bytes: int = SHARD_BYTES,
    *,
    replace: bool = False,
) -> ExportIndex:
    """Export all frames of a dataset, and return the index.

    Args:
        dataset: the dataset.
        out: the folder to create; it appears when the export is complete.
        progress: reports progress.
        shard_bytes: the size limit of a shard. A shard is closed before the sample that would exceed it, so only one
            with a single sample can be larger.
        replace: whether an existing export may be replaced.

    Raises:
        InputError: `out` exists and is not an export, or a file of the dataset is damaged.
        RunError: the files cannot be written, or another export writes to `out`.
    """
    out = check_destination(out)
    with host_errors(str(out), _REMEDY):
        recover(out)
    there, known = stamp(out, INDEX), _index_of(out, dataset)
    same = known is not None and known["dataset"] == dataset.lock.identity and known["shard_bytes"] == shard_bytes
    if known is not None and same and _is_complete(out, known, dataset):
        return known
    if out.is_symlink() or (out.exists() and not is_empty(out) and (known is None or _has_other_files(out, known))):
        raise InputError(
            f"{out} exists already and has files that do not belong to an export",
            help="move it away, or choose another folder",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    if known is not None and not replace:
        what = "an export of this dataset whose shards are damaged" if same else "another export"
        raise InputError(
            f"{out} exists already, and is {what}",
            help="choose another folder, or replace it",
            code=Code.OUTPUT_IN_THE_WAY,
        )
    with host_errors(str(out), _REMEDY), work_folder(out, _has_only_shards) as work:
        rows = _write(dataset, work, progress, shard_bytes)
        index: ExportIndex = {
            "format": _FORMAT,
            "dataset": dataset.lock.identity,
            "shard_bytes": shard_bytes,
            "shards": rows,
        }
        (work / INDEX).write_bytes(canonical_bytes(index) + b"\n")
        publish(work, out, None if known is None else lambda old: _is_export(old, known, there))
    return index


def _has_only_shards(work: Path) -> bool:
    found = sorted(work.iterdir())
    names = all(path.name in (MARKER, INDEX) or path.suffix == ".tar" for path in found)
    return names and all(regular_file(work, path.name) for path in found)


def _write(dataset: Dataset, work: Path, progress: Progress, shard_bytes: int) -> list[ShardRecord]:
    total = sum(len(s.frames(v.scene.clock.frames)) for v in dataset.plan.variants for s in v.rig.sensors)
    rows: list[ShardRecord] = []
    shard, filled = _Shard(_shard_path(dataset, work, 0)), 0
    try:
        for done, sample in enumerate(_samples(dataset), start=1):
            size = sum(len(entry.tobuf(tarfile.PAX_FORMAT)) + -(-entry.size // 512) * 512 for entry, _ in sample)
            if shard.samples and filled + size + tarfile.RECORDSIZE > shard_bytes:
                rows.append(shard.close())
                shard, filled = _Shard(_shard_path(dataset, work, len(rows))), 0
            shard.add(sample)
            filled += size
            progress("export", done, total)
        return [*rows, shard.close()]
    finally:
        shard.tar.close()


def _samples(dataset: Dataset) -> Iterator[Sample]:
    """Yield the files of every frame, sorted by name."""
    for variant in dataset.plan.variants:
        for sensor in variant.rig.sensors:
            try:
                for row in labels(dataset, variant, sensor):
                    frame = row["frame"]
                    key = f"{layout.folder(variant.variant)}/{layout.folder(sensor.name)}/{frame:06d}"
                    document = {
                        "variant": variant.variant,
                        "sensor": sensor.name,
                        "fps": variant.scene.clock.fps,
                        **row,
                    }
                    sample = {f"{key}.json": canonical_bytes(document)}
                    for modality in sensor.capture:
                        path = layout.frame_file(variant.variant, sensor.name, modality, frame, dataset.plan.depth)
                        sample[f"{key}.{modality}.{path.rpartition('.')[2]}"] = picture_file(dataset, path, sensor)
                    yield [(_entry(name, body), body) for name, body in sorted(sample.items())]
            except (ValueError, OSError) as error:
                path = layout.labels_file(variant.variant, sensor.name)
                raise damaged_file(dataset, f"{path}: {error}") from None


def _entry(name: str, body: bytes) -> tarfile.TarInfo:
    """Return a tar header with owner 0, time 0 and mode 0644."""
    entry = tarfile.TarInfo(name)
    entry.size = len(body)
    return entry


def picture_file(dataset: Dataset, path: str, sensor: SensorPlan) -> bytes:
    """Return the content of a picture's file, after comparing it with the manifest.

    Raises:
        InputError: the file is missing, damaged, or larger than a picture of the sensor can be.
    """
    most = codecs.largest_file(sensor.camera.width, sensor.camera.height)
    size, sha256 = dataset.files.get(path, (-1, ""))
    found = regular_file(dataset.root, path)
    if found is None:
        raise damaged_file(dataset, f"{path} is missing, or not a regular file")
    if found.st_size != size:
        raise damaged_file(dataset, f"{path} has {count(found.st_size, 'byte')}, not {size:,}")
    if size > most:
        raise damaged_file(dataset, f"{path} has {size:,} bytes, and a picture of this sensor has at most {most:,}")
    try:
        body = read_inside(dataset.root, path, size)
    except ValueError as error:
        raise damaged_file(dataset, str(error)) from None
    except OSError as error:
        raise RunError(f"{dataset.root / path} cannot be read: {error.strerror}") from None
    if len(body) != size or hashlib.sha256(body).hexdigest() != sha256:
        raise damaged_file(dataset, f"{path} differs from its SHA-256 in the manifest")
    return body


def damaged_file(dataset: Dataset, what: str) -> InputError:
    """Return the error that a file of a dataset is damaged."""
    return InputError(
        f"{dataset.root}/{what}",
        help="repair the dataset, then export it",
        code=Code.INVALID_DATASET,
    )


def _shard_path(dataset: Dataset, work: Path, number: int) -> Path:
    return work / f"{dataset.plan.recipe}-{number:06d}.tar"


def _is_export(folder: Path, index: ExportIndex, before: tuple[int, int, int] | None) -> bool:
    """Return whether a folder contains only the export of an index, whose file had the stamp `before`."""
    return stamp(folder, INDEX) == before and not _has_other_files(folder, index)


def _has_other_files(out: Path, index: ExportIndex) -> bool:
    """Return whether a folder has files that its index does not list, or lacks listed ones."""
    found = sorted(out.iterdir())
    names = {path.name for path in found}
    return names != {INDEX, *(row["file"] for row in index["shards"])} or any(is_folder(path) for path in found)


def _index_of(out: Path, dataset: Dataset) -> ExportIndex | None:
    """Return the index of an export; None if it is absent or damaged."""
    index = read_index(out, INDEX, dataset, _INDEX_BYTES, ExportIndex)
    return index if index is not None and all(row["samples"] <= row["size"] for row in index["shards"]) else None


def _is_complete(out: Path, index: ExportIndex, dataset: Dataset) -> bool:
    """Return whether a folder contains exactly the shards of an index, with the recorded bytes."""
    rows = ((row["file"], row["size"], row["sha256"]) for row in index["shards"])
    return not _has_other_files(out, index) and holds_files(out, rows, dataset)
