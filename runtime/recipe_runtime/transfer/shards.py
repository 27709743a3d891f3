"""A dataset as WebDataset shards: tar files in which a frame's files lie side by side under one key.

    weather_sweep-000000.tar
        weather=sunny/street/000000.depth.png     the dataset's own files, byte for byte
        weather=sunny/street/000000.json          variant, sensor, fps, frame, and the records of labels.jsonl
        weather=sunny/street/000000.rgb.png
    index.json                                    the dataset's identity; samples, size and SHA-256 of every shard

Equal datasets give equal shards: order is the dataset's, and nothing of the host is in a header. Every file is held
against the manifest while it is copied, so that no damage travels on.
"""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import os
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict, cast

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import layout
from recipe_runtime.core.files import file_sha256, host_errors, regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.dataset.manifest import DAMAGE
from recipe_runtime.dataset.reader import Dataset, labels

INDEX = "index.json"
SHARD_BYTES = 1 << 30
_FORMAT = "recipe/webdataset/1"
_REMEDY = "free some space or choose another folder, then export again"


class ShardRecord(TypedDict):
    """A shard in the index: its file's name, its number of samples, its size in bytes and its SHA-256."""

    file: str
    samples: int
    size: int
    sha256: str


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
        """The files of one frame, by name."""
        for entry, body in sample:
            self.tar.addfile(entry, io.BytesIO(body))
        self.samples += 1

    def close(self) -> ShardRecord:
        """Its row in the index."""
        self.tar.close()
        size, digest = self.path.stat().st_size, file_sha256(self.path)
        return {"file": self.path.name, "samples": self.samples, "size": size, "sha256": digest}


def webdataset(
    dataset: Dataset, out: Path, progress: Progress, shard_bytes: int = SHARD_BYTES, *, replace: bool = False
) -> ExportIndex:
    """Write all frames into `out`, a folder that is not there yet, and give its index; with `replace`, over an export.

    A shard is closed before the sample that would make it larger than `shard_bytes`; only one frame alone may. The
    folder gets its name when it is whole. InputError if it is there already with something else in it, or a file of
    the dataset is damaged; RunError if the host will not have it, or another export writes there.
    """
    known = _index_of(out)
    if known is not None and known.get("dataset") == dataset.lock.identity and known.get("shard_bytes") == shard_bytes:
        return known
    if out.is_symlink() or (out.exists() and (known is None or _has_other_files(out, known))):
        raise InputError(f"{out} is there already, and is not an export alone; move it away or name another folder")
    if known is not None and not replace:
        raise InputError(
            f"{out} is there already, and is another export; name another folder, or replace it (--replace)"
        )
    with host_errors(str(out), _REMEDY), _alone(out) as work:
        rows = _write(dataset, work, progress, shard_bytes)
        index: ExportIndex = {
            "format": _FORMAT,
            "dataset": dataset.lock.identity,
            "shard_bytes": shard_bytes,
            "shards": rows,
        }
        (work / INDEX).write_bytes(canonical_bytes(index) + b"\n")
        if known is not None:
            shutil.rmtree(out)
        work.rename(out)
    return index


@contextmanager
def _alone(out: Path) -> Iterator[Path]:
    """An empty folder beside `out`, this export's alone, and gone in the end; what a killed export left is cleared."""
    work = out.with_name(f".{out.name}.export")
    work.mkdir(parents=True, exist_ok=True)
    handle = os.open(work, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunError(f"another export is writing {out}; wait for it, or name another folder") from None
        left = sorted(work.iterdir())
        if any(path.name != INDEX and path.suffix != ".tar" for path in left):
            raise InputError(f"{work} is in the way and is not an export's work; move it away")
        try:
            for path in left:
                path.unlink()
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)
    finally:
        os.close(handle)


def _write(dataset: Dataset, work: Path, progress: Progress, shard_bytes: int) -> list[ShardRecord]:
    total = sum(v.scene.clock.frames * len(v.rig.sensors) for v in dataset.plan.variants)
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
    """The files of every frame, in the order of their names."""
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
                        "frame": frame,
                        "objects": row["objects"],
                    }
                    sample = {f"{key}.json": canonical_bytes(document)}
                    for modality in sensor.capture:
                        path = layout.frame_file(variant.variant, sensor.name, modality, frame, dataset.plan.depth)
                        sample[f"{key}.{modality}.{path.rpartition('.')[2]}"] = _whole(dataset, path)
                    yield [(_entry(name, body), body) for name, body in sorted(sample.items())]
            except (ValueError, OSError) as error:
                path = layout.labels_file(variant.variant, sensor.name)
                raise _damaged(dataset, f"{path}: {error}") from None


def _entry(name: str, body: bytes) -> tarfile.TarInfo:
    """Owner 0, time 0, mode 0644."""
    entry = tarfile.TarInfo(name)
    entry.size = len(body)
    return entry


def _whole(dataset: Dataset, path: str) -> bytes:
    """A file's bytes, which are the manifest's."""
    size, sha256 = dataset.files.get(path, (-1, ""))
    there = regular_file(dataset.root, path)
    if there is None:
        raise _damaged(dataset, f"{path} is missing, or no plain file")
    if there.st_size != size:
        raise _damaged(dataset, f"{path} has {count(there.st_size, 'byte')}, not {size:,}")
    try:
        body = (dataset.root / path).read_bytes()
    except OSError as error:
        raise RunError(f"{dataset.root / path} cannot be read: {error.strerror}") from None
    if len(body) != size or hashlib.sha256(body).hexdigest() != sha256:
        raise _damaged(dataset, f"{path} has other bytes than the manifest says")
    return body


def _damaged(dataset: Dataset, what: str) -> InputError:
    return InputError(f"{dataset.root}/{what}; build the dataset again, then export it")


def _shard_path(dataset: Dataset, work: Path, number: int) -> Path:
    return work / f"{dataset.plan.recipe}-{number:06d}.tar"


def _has_other_files(out: Path, index: ExportIndex) -> bool:
    """Whether a folder holds anything but the export that its index lists."""
    return {path.name for path in sorted(out.iterdir())} != {INDEX, *(row["file"] for row in index["shards"])}


def _index_of(out: Path) -> ExportIndex | None:
    """The index of an export that is there and whole, by its files' sizes; None for anything else."""
    try:
        index = json.loads((out / INDEX).read_bytes())
        whole = index["format"] == _FORMAT and all(
            (out / row["file"]).stat().st_size == row["size"] for row in index["shards"]
        )
    except (OSError, *DAMAGE):
        return None
    return cast(ExportIndex, index) if whole else None
