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
from typing import TypedDict, cast

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import codecs, layout
from recipe_runtime.core.files import file_sha256, read_inside, regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.staged_folder import Notice, ignore
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.transfer.export_folder import export

SHARD_BYTES = 1 << 30
_FORMAT = "recipe/webdataset/1"


class ShardRecord(TypedDict):
    """A shard in the index: file name, number of samples, size in bytes and SHA-256."""

    file: str
    samples: int
    size: int
    sha256: str


_ROW_TYPES = {"file": str, "samples": int, "size": int, "sha256": str}


class ExportIndex(TypedDict):
    """`index.json`: the dataset's identity, the size limit of a shard in bytes, and the shards in order."""

    format: str
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
    notice: Notice = ignore,
) -> ExportIndex:
    """Export all frames of a dataset, and return the index.

    Args:
        dataset: the dataset.
        out: the folder to create; it appears when the export is complete.
        progress: reports progress.
        shard_bytes: the size limit of a shard. A shard is closed before the sample that would exceed it, so only one
            with a single sample can be larger.
        replace: whether an existing folder may be replaced.
        notice: called with a line of text if a replaced folder is kept.

    Raises:
        InputError: `out` exists and `replace` is not set, or a file of the dataset is damaged.
        RunError: the files cannot be written, or another process writes to `out`.
    """
    made_from: dict[str, str | int] = {"format": _FORMAT, "dataset": dataset.lock.identity, "shard_bytes": shard_bytes}

    def write(work: Path) -> dict[str, list[ShardRecord]]:
        return {"shards": _write(dataset, work, progress, shard_bytes)}

    return cast("ExportIndex", export(dataset, out, made_from, write, replace=replace, notice=notice))


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
                        path = layout.frame_file(variant.variant, sensor.name, modality, frame, dataset.plan.forms)
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
