"""Reads a dataset's `manifest.json` from an untrusted file, row by row, and checks each row.

Memory is limited by the number of rows, which must not exceed the limits of plans in `dataset.limits`. The first row
too many, or the first unknown item, ends the reading with an error that names its place.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, BinaryIO, Literal, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from recipe_compiler.ir.bounded_reads import bounded_memory
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.modalities import DIGEST_KINDS
from recipe_compiler.ir.plan_types import (
    MAX_DESCRIPTION,
    MAX_INTERVAL,
    MAX_SENSORS,
    MAX_VARIANT_NAME,
    MAX_VARIANTS,
    Name,
    Sha256,
)
from recipe_compiler.ir.plurals import count

from recipe_runtime.core import layout
from recipe_runtime.core.files import open_inside, regular_file, resolved
from recipe_runtime.dataset.json_stream import JsonStream
from recipe_runtime.dataset.limits import MAX_FILES, MAX_ROWS
from recipe_runtime.dataset.manifest import FORMAT, stays_inside
from recipe_runtime.dataset.manifest_types import FileRecord, FrameDigests, Manifest, VariantRecord

MAX_BYTES = 1 << 28
MAX_PARTS = 32  # folders of a path, and its name; each is looked up for each file
_MAX_PATH, _MAX_PART = 2_000, 255  # bytes of a path, and of one component
_MAX_EMPTY = 50_000  # folders without a file of their own: a dataset has such only among those of its recipe
_MAX_SIZE = 1 << 40  # bytes of a file
_DIGEST = re.compile(r"[0-9a-f]{64}")
_LIST = 1 << 23  # characters of the order of variants
_ROW = ("appearance", "folder", "plan", "rig", "scene", "trace")  # keys of a variant, besides its frames


class NotAManifestError(ValueError):
    """The document is not a manifest of this project, as opposed to a damaged one."""


class _Outputs(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")

    annotations: Annotated[list[Literal["kwcoco", "coco", "mots_txt", "mots_png"]], Field(max_length=4)]
    depth: Literal["carla", "npy"]


class _Head(BaseModel):
    """The fields of a manifest except its tables."""

    model_config = ConfigDict(strict=True, extra="forbid")

    format: Literal["recipe/manifest/1"]
    recipe: Name
    description: Annotated[str, Field(max_length=MAX_DESCRIPTION)]
    identity: Annotated[str, Field(max_length=400)]
    order: Annotated[
        list[Annotated[str, Field(max_length=MAX_VARIANT_NAME)]], Field(min_length=1, max_length=MAX_VARIANTS)
    ]
    outputs: _Outputs
    plan: Sha256
    recipe_file: Annotated[str, Field(max_length=_MAX_PATH)] | None = None
    stages: Annotated[dict[Name, Annotated[int, Field(ge=0, le=10**6)]], Field(max_length=100)]
    tools: Annotated[dict[Name, Annotated[str, Field(max_length=100)]], Field(max_length=100)]


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
        size = os.fstat(file.fileno()).st_size
        if size > MAX_BYTES:
            raise ValueError(f"its {layout.MANIFEST} has {size:,} bytes, and at most {MAX_BYTES:,} are read")
        with bounded_memory(str(root / layout.MANIFEST)):
            return parse(file)


def parse(file: BinaryIO) -> Manifest:
    """Parse and check a manifest.

    Raises:
        NotAManifestError: it is not a manifest of this project.
        ValueError: it is damaged, or exceeds a limit.
    """
    stream, found = JsonStream(file, MAX_BYTES), dict[str, object]()
    tables: dict[str, Callable[[], object]] = {
        "files": lambda: _files(stream, MAX_FILES),
        "pictures": lambda: _files(stream, 1000),
        "variants": lambda: _variants(stream),
        "order": lambda: stream.value(_LIST),
    }
    for key in stream.members():
        if key not in _Head.model_fields and key not in tables:
            raise NotAManifestError(f"{key[:40]!r} is not a key of a manifest")
        if key in found:
            raise ValueError(f"{key} is given twice")
        found[key] = tables[key]() if key in tables else stream.value()
    stream.end()
    if not str(found.get("format", "")).startswith(FORMAT.rpartition("/")[0]):
        raise NotAManifestError("it does not say that it is a manifest of this project")
    try:
        _Head.model_validate({key: value for key, value in found.items() if key in _Head.model_fields})
    except ValidationError as error:
        raise ValueError(first_error(error)) from None
    missing = [key for key in tables if key not in found]
    if missing:
        raise ValueError(f"it lacks {missing[0]}")
    manifest = cast(Manifest, found)  # every table and `_Head` have been checked
    if set(manifest["order"]) != set(manifest["variants"]):
        raise ValueError("order and variants name different variants")
    if len(set(manifest["order"])) < len(manifest["order"]):
        raise ValueError("order names a variant twice")
    return manifest


def first_error(error: ValidationError) -> str:
    """Return the first error of a document with its place, on one line."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    place = ".".join(str(step)[:60] for step in first["loc"][:8])
    return f"{place}: {first['msg']}"[:300]


def _files(stream: JsonStream, most: int) -> dict[str, FileRecord]:
    """Return the size and SHA-256 of files, by path."""
    rows: dict[str, FileRecord] = {}
    folders, before = 0, list[str]()
    for path in stream.members():
        if not stays_inside(path):
            raise ValueError(f"{path[:200]!r} is not a path within a dataset")
        parts = path.split("/")
        if len(path.encode()) > _MAX_PATH or any(len(part.encode()) > _MAX_PART for part in parts):
            raise ValueError(f"{path[:40]}... is too long")
        if len(parts) > MAX_PARTS:
            raise ValueError(f"{path[:40]}... is in {len(parts) - 1:,} folders, and at most {MAX_PARTS - 1} are read")
        shared = itertools.takewhile(lambda pair: pair[0] == pair[1], zip(parts[:-1], before, strict=False))
        folders += len(parts) - 1 - sum(1 for _ in shared)  # each folder once if paths are sorted, as builds write them
        before = parts[:-1]
        row = stream.value()
        if not isinstance(row, dict) or set(row) != {"size", "sha256"}:
            raise ValueError(f"{path} has no size and digest, or more")
        if type(row["size"]) is not int or not 0 <= row["size"] <= _MAX_SIZE:
            raise ValueError(f"{path} has no size")
        _check_digest(row["sha256"], path)
        if path in rows or len(rows) >= most:
            raise ValueError(f"{path} is given twice" if path in rows else f"it lists more than {most:,} files")
        rows[path] = {"size": row["size"], "sha256": row["sha256"]}
        if folders > len(rows) + _MAX_EMPTY:
            raise ValueError(f"it lists {folders:,} folders for {count(len(rows), 'file')}")
    return rows


def _variants(stream: JsonStream) -> dict[str, VariantRecord]:
    """Return the digests of each variant and of its frames."""
    rows: dict[str, VariantRecord] = {}
    left, sensors = [MAX_ROWS], [MAX_ROWS]  # a sensor has two digests or more, and may have an interval
    for name in stream.members():
        if name in rows or len(rows) >= MAX_VARIANTS or len(name) > MAX_VARIANT_NAME:
            raise ValueError(f"the variant {name[:40]!r} is given twice, too long, or one too many")
        row: dict[str, object] = {}
        for key in stream.members():
            if key in row or key not in ("frames", "intervals", *_ROW):
                raise ValueError(f"the variant {name!r} has {key[:40]!r} twice, or should have none")
            row[key] = _frames(stream, left, sensors) if key == "frames" else stream.value()
            if key == "intervals":
                _check_intervals(row[key], name, sensors)
            elif key not in ("frames", "folder"):
                _check_digest(row[key], f"{key} of {name!r}")
        if set(row) - {"intervals"} != {"frames", *_ROW} or row["folder"] != layout.folder(name):
            raise ValueError(f"the variant {name!r} lacks something, or has another folder than its name says")
        rows[name] = cast(VariantRecord, row)  # every key has been checked
    return rows


def _frames(stream: JsonStream, left: list[int], left_sensors: list[int]) -> FrameDigests:
    """Return digests by sensor and modality; the lists hold the numbers of further digests and sensors allowed."""
    sensors: FrameDigests = {}
    for sensor in stream.members():
        modalities = sensors.setdefault(sensor, {})
        if modalities or len(sensor) > 100:
            raise ValueError(f"the sensor {sensor[:40]!r} is given twice, or too long")
        _count_sensors(left_sensors, 1)
        for modality in stream.members():
            if modality in modalities or modality not in DIGEST_KINDS:
                raise ValueError(f"the modality {modality[:40]!r} occurs twice or does not exist")
            digests = modalities[modality] = []
            for digest in stream.items(80):
                _check_digest(digest, f"a frame of {sensor}")
                digests.append(digest)
                left[0] -= 1
                if left[0] < 0:
                    raise ValueError(f"it lists more than {MAX_ROWS:,} frames' digests")
    return sensors


def _count_sensors(left: list[int], number: int) -> None:
    left[0] -= number
    if left[0] < 0:
        raise ValueError(f"it lists more than {MAX_ROWS:,} sensors")


def _check_intervals(value: object, variant: str, left: list[int]) -> None:
    _count_sensors(left, len(value) if isinstance(value, dict) else 0)
    sound = isinstance(value, dict) and 0 < len(value) <= MAX_SENSORS
    if not sound or not all(
        type(n) is int and 1 < n <= MAX_INTERVAL for n in cast("dict[str, object]", value).values()
    ):
        raise ValueError(f"the variant {variant!r} has intervals that no sensor has")


def _check_digest(value: object, what: str) -> None:
    if not isinstance(value, str) or not _DIGEST.fullmatch(value):
        raise ValueError(f"{what} has no SHA-256 digest")


@contextmanager
def not_replaced(root: Path, name: str) -> Iterator[None]:
    """Check that a dataset is not replaced while it is read: files of two datasets would be compared as one.

    Args:
        root: the dataset's folder.
        name: its name in messages.

    Raises:
        RunError: its manifest is another file when the context ends.
    """
    before = stamp(root)
    try:
        yield
    except InputError:
        if stamp(root) == before:
            raise
    if stamp(root) != before:
        raise replaced(name)


def replaced(name: str) -> RunError:
    """Return the error for a dataset that was replaced while it was read."""
    return RunError(f"{name} was replaced or changed while it was read; try again when nothing is written there")


def stamp(root: Path, name: str = layout.MANIFEST) -> tuple[int, int, int] | None:
    """Return a value that changes if another manifest, or index of an export, replaces that in a folder."""
    found = regular_file(root, name)
    return found and (found.st_ino, found.st_size, found.st_mtime_ns)


def check_outside_datasets(out: Path) -> None:
    """Check that no parent of `out` is a dataset, because a dataset contains only the files of its manifest.

    Raises:
        InputError: `out` is inside a dataset, or its parents have more other manifests than are read.
    """
    left = MAX_BYTES  # of manifests that are read in vain: an archive may have one file, linked, in many nested folders
    for folder in resolved(out).parents:
        try:
            read(folder)
        except (OSError, ValueError):
            found = regular_file(folder, layout.MANIFEST)
            left -= found.st_size if found is not None and found.st_size <= MAX_BYTES else 0
            if left < 0:
                raise InputError(
                    f"{folder / layout.MANIFEST} and others above {out} are large and not manifests of a dataset",
                    help="choose a folder elsewhere",
                    code=Code.OUTPUT_IN_THE_WAY,
                ) from None
            continue
        beside = folder.parent / out.name
        if beside.exists():
            beside = beside.with_name(f"{out.name}-again")
        raise InputError(
            f"{out} is inside the dataset {folder}",
            help=f"choose a folder outside it, such as {beside}",
            code=Code.OUTPUT_IN_THE_WAY,
        )
