"""Tar shards for training, in which the files of a frame are adjacent and share a key.

    weather_sweep-000000.tar
        weather=sunny/street/000000.depth.png   the dataset's own files, byte for byte
        weather=sunny/street/000000.json        variant, sensor, fps, and the frame's line of labels.jsonl
        weather=sunny/street/000000.rgb.png

Samples are in the dataset's order, and a shard has no data of the host.
"""

from __future__ import annotations

import itertools
import tarfile
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter

from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plurals import count

from recipe_runtime.cache.pruning import bytes_of
from recipe_runtime.core import layout
from recipe_runtime.transfer.formats.format import Entry, Facts, Format, Options, Row
from recipe_runtime.transfer.formats.sequence import ExportSequence

_DEFAULT_SIZE = "1G"
_MAX_SIZE = 1 << 50  # bytes


def _key(name: str, options: Options) -> dict[str, str | int]:
    return {"format": "recipe/webdataset/1", "shard_bytes": _shard_bytes(options)}


def _shard_bytes(options: Options) -> int:
    """Return the size limit of a shard. A shard ends before the sample that would exceed it, unless it is the first."""
    text = options.get("shard-size", _DEFAULT_SIZE)
    size = bytes_of(text)
    if not 1 <= size <= _MAX_SIZE:
        raise InputError(
            f"shard size {text}: a shard holds 1 byte to 1 PiB",
            help="write for example 500M or 1G",
            code=Code.OUT_OF_RANGE,
        )
    return size


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    """Yield the shards."""
    samples = (sample for sequence in sequences for sample in _samples(sequence))
    for number, shard in itertools.groupby(_numbered(samples, _shard_bytes(options)), key=itemgetter(0)):
        facts = Facts(samples=0)
        yield Entry(f"{sequences[0].dataset.plan.recipe}-{number:06d}.tar", _tar(shard, facts), facts)


def _numbered(samples: Iterable[bytes], limit: int) -> Iterator[tuple[int, bytes]]:
    """Yield each sample with the number of its shard."""
    number, filled = 0, 0
    for sample in samples:
        if filled and filled + len(sample) + tarfile.RECORDSIZE > limit:
            number, filled = number + 1, 0
        filled += len(sample)
        yield number, sample


def _tar(samples: Iterable[tuple[int, bytes]], facts: Facts) -> Iterator[bytes]:
    """Yield a tar file, and count its samples."""
    size = 2 * tarfile.BLOCKSIZE  # of zeros at the end, which a multiple of a record follows
    for _, sample in samples:
        facts["samples"] += 1
        size += len(sample)
        yield sample
    yield bytes(2 * tarfile.BLOCKSIZE + -size % tarfile.RECORDSIZE)


def _samples(sequence: ExportSequence) -> Iterator[bytes]:
    """Yield the files of every frame, sorted by name, as a part of a tar file."""
    variant, sensor = sequence.variant, sequence.sensor
    for row in sequence.labels():
        key = f"{layout.folder(variant.variant)}/{layout.folder(sensor.name)}/{row['frame']:06d}"
        document = {"variant": variant.variant, "sensor": sensor.name, "fps": variant.scene.clock.fps, **row}
        sample = {f"{key}.json": canonical_bytes(document)}
        for modality in sensor.capture:
            path, content = sequence.file(modality, row["frame"])
            sample[f"{key}.{modality}.{path.rpartition('.')[2]}"] = content
        yield b"".join(_entry(name, content) for name, content in sorted(sample.items()))


def _entry(name: str, content: bytes) -> bytes:
    """Return a file in a tar file, with owner 0, time 0 and mode 0644."""
    head = tarfile.TarInfo(name)
    head.size = len(content)
    return head.tobuf(tarfile.PAX_FORMAT) + content + bytes(-len(content) % tarfile.BLOCKSIZE)


def _table(rows: Sequence[Row]) -> dict[str, object]:
    return {"shards": rows}


def _summary(rows: Sequence[Row]) -> str:
    return f"{count(sum(row.get('samples', 0) for row in rows), 'sample')} in {count(len(rows), 'shard')}"


FORMAT = Format(files=_files, key=_key, table=_table, summary=_summary)
