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

import hashlib
import io
import json
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recipe_compiler.canonical import canonical_bytes
from recipe_compiler.errors import InputError

from recipe_runtime import layout
from recipe_runtime.dataset import Dataset, labels
from recipe_runtime.engines import Progress
from recipe_runtime.store import file_sha256, host_errors, regular_file

INDEX = "index.json"
SHARD_BYTES = 1 << 30
_FORMAT = "recipe/webdataset/1"
_REMEDY = "free some space or choose another folder, then export again"


@dataclass
class _Shard:
    """A shard that is being written."""

    path: Path
    samples: int = 0
    tar: tarfile.TarFile = field(init=False)

    def __post_init__(self) -> None:
        self.tar = tarfile.TarFile(self.path, "w", format=tarfile.PAX_FORMAT)

    def add(self, sample: dict[str, bytes]) -> None:
        """The files of one frame, by name."""
        for name, body in sorted(sample.items()):
            entry = tarfile.TarInfo(name)  # owner 0, time 0, mode 0644
            entry.size = len(body)
            self.tar.addfile(entry, io.BytesIO(body))
        self.samples += 1

    def close(self) -> dict[str, Any]:
        """Its row in the index."""
        self.tar.close()
        size, digest = self.path.stat().st_size, file_sha256(self.path)
        return {"file": self.path.name, "samples": self.samples, "size": size, "sha256": digest}


def webdataset(dataset: Dataset, out: Path, progress: Progress, shard_bytes: int = SHARD_BYTES) -> dict[str, Any]:
    """Write all frames into `out`, a folder that is not there yet, and give its index.

    A shard is closed before the sample that would make it larger than `shard_bytes`. The folder gets its name when it
    is whole. InputError if it is there already with something else in it, or a file of the dataset is damaged;
    RunError if the host will not have it.
    """
    known = _index_of(out)
    if known is not None and known.get("dataset") == dataset.lock.identity and known.get("shard_bytes") == shard_bytes:
        return known
    if out.exists() or out.is_symlink():
        raise InputError(f"{out} is there already, and is another export; remove it or name another folder")
    work = out.with_name(f".{out.name}.export")
    with host_errors(str(out), _REMEDY):
        shutil.rmtree(work, ignore_errors=True)  # of an export that was killed
        work.mkdir(parents=True)
        try:
            rows = _write(dataset, work, progress, shard_bytes)
            index = {"format": _FORMAT, "dataset": dataset.lock.identity, "shard_bytes": shard_bytes, "shards": rows}
            (work / INDEX).write_bytes(canonical_bytes(index) + b"\n")
            work.rename(out)
        finally:
            with suppress(OSError):
                shutil.rmtree(work, ignore_errors=True)
    return index


def _write(dataset: Dataset, work: Path, progress: Progress, shard_bytes: int) -> list[dict[str, Any]]:
    total = sum(v.scene.clock.frames * len(v.rig.sensors) for v in dataset.plan.variants)
    rows: list[dict[str, Any]] = []
    shard, filled = _Shard(_shard_path(dataset, work, 0)), 0
    try:
        for done, sample in enumerate(_samples(dataset), start=1):
            size = sum(1024 + -(-len(body) // 512) * 512 for body in sample.values())
            if shard.samples and filled + size > shard_bytes:
                rows.append(shard.close())
                shard, filled = _Shard(_shard_path(dataset, work, len(rows))), 0
            shard.add(sample)
            filled += size
            progress("export", done, total)
        return [*rows, shard.close()]
    finally:
        shard.tar.close()


def _samples(dataset: Dataset) -> Iterator[dict[str, bytes]]:
    """The files of every frame, by their names in a shard."""
    for variant in dataset.plan.variants:
        for sensor in variant.rig.sensors:
            try:
                for row in labels(dataset, variant, sensor):
                    frame = row["frame"]
                    key = f"{layout.folder(variant.variant)}/{layout.folder(sensor.name)}/{frame:06d}"
                    told = {"variant": variant.variant, "sensor": sensor.name, "fps": variant.scene.clock.fps, **row}
                    sample = {f"{key}.json": canonical_bytes(told)}
                    for modality in sensor.capture:
                        path = layout.frame_file(variant.variant, sensor.name, modality, frame, dataset.plan.depth)
                        sample[f"{key}.{modality}.{path.rpartition('.')[2]}"] = _whole(dataset, path)
                    yield sample
            except ValueError as error:
                path = layout.labels_file(variant.variant, sensor.name)
                raise _damaged(dataset, f"{path}: {error}") from None


def _whole(dataset: Dataset, path: str) -> bytes:
    """A file's bytes, which are the manifest's."""
    size, sha256 = dataset.files.get(path, (-1, ""))
    if regular_file(dataset.root, path) is None:
        raise _damaged(dataset, f"{path} is missing, or no plain file")
    body = (dataset.root / path).read_bytes()
    if len(body) != size or hashlib.sha256(body).hexdigest() != sha256:
        raise _damaged(dataset, f"{path} has other bytes than the manifest says")
    return body


def _damaged(dataset: Dataset, what: str) -> InputError:
    return InputError(f"{dataset.root}/{what}; build the dataset again, then export it")


def _shard_path(dataset: Dataset, work: Path, number: int) -> Path:
    return work / f"{dataset.plan.recipe}-{number:06d}.tar"


def _index_of(out: Path) -> dict[str, Any] | None:
    """The index of an export that is there and whole, by its files' sizes; None for anything else."""
    try:
        index = json.loads((out / INDEX).read_bytes())
        whole = index["format"] == _FORMAT and all(
            (out / row["file"]).stat().st_size == row["size"] for row in index["shards"]
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return index if whole else None
