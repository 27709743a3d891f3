"""`manifest.json`: the digests of a dataset's content and files.

    identity   NAME@sha256:DIGEST for citation, equal to the lockfile's; over plans, traces, pixels and labels
    about      licence, authors and so on, if the recipe states them
    outputs    the outputs that the recipe requests
    tools      versions of the packages that bytes depend on
    variants   digests of plan, scene, rig, appearance and trace; per sensor and modality a digest for every frame
               (`labels`: the label records); `intervals`: by sensor, every how manieth frame it takes, if not every
    files      size and SHA-256 of every file, except the manifest and the pictures
    recipe_file  the path of the recipe's pack in the dataset, if it is included
    pictures   the same for the files in preview/, which no digest covers, because fonts and scaling may change with
               Pillow

Pixels and files have separate digests, so that a change of the encoder is distinguished from a change of the pixels.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final, Literal, cast

from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.lockfile import FrameKey, Lockfile, VariantRow
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan

from recipe_runtime.annotate.records import FileRow
from recipe_runtime.core import layout
from recipe_runtime.core.versions import STAGES, tool_versions
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.assembly import FrameAssembly
from recipe_runtime.dataset.manifest_types import (
    FileRecord,
    FrameDigests,
    Manifest,
    ManifestHead,
    PlannedVariant,
    RequiredManifest,
    VariantRecord,
)

FORMAT: Final = "recipe/manifest/1"
MAX_PARTS = 32  # folders of a path, and its name; each is looked up for each file
_MAX_PART = 255  # bytes of one component of a path
_PICTURES = "preview/"

_TABLES: Final[tuple[Literal["files", "pictures"], ...]] = ("files", "pictures")


def head(dataset: DatasetPlan) -> ManifestHead:
    """Return the part of a manifest that is known before the build; equal heads produce equal datasets."""
    found: ManifestHead = {
        "format": FORMAT,
        "recipe": dataset.recipe,
        "description": dataset.description,
        "plan": dataset.digest,
        "outputs": dataset.outputs,
        "stages": dict(STAGES),
    }
    about = cast("dict[str, str | list[str]]", dataset.about.stated)
    return {**found, "about": about} if about else found


def manifest_text(
    dataset: DatasetPlan, harvest: FrameAssembly, files: Mapping[str, FileRow], recipe_file: str | None
) -> str:
    """Return the manifest of a finished dataset; `recipe_file` is the path of its recipe's pack, if included."""
    sensors: dict[str, FrameDigests] = {}
    for video in harvest.videos():
        pixels = {m: [v for _, v in sorted(frames.items())] for m, frames in harvest.pixels(video).items()}
        sensors.setdefault(video.variant, {})[video.sensor.name] = pixels
    variants: dict[str, VariantRecord] = {
        v.variant: {
            **_planned_variant(v),
            "trace": harvest.traces[v.scene.digest],
            "frames": sensors[v.variant],
        }
        for v in dataset.variants
    }
    rows: dict[str, FileRecord] = {path: {"size": row[0], "sha256": row[1]} for path, row in sorted(files.items())}
    manifest: RequiredManifest = {
        **head(dataset),
        "identity": harvest.identity(),
        "tools": tool_versions(),
        "order": [v.variant for v in dataset.variants],
        "variants": variants,
        "files": {p: row for p, row in rows.items() if not p.startswith(_PICTURES)},
        "pictures": {p: row for p, row in rows.items() if p.startswith(_PICTURES)},
    }
    return pretty(manifest if recipe_file is None else {**manifest, "recipe_file": recipe_file})


def _planned_variant(variant: ScenarioPlan) -> PlannedVariant:
    intervals = {sensor.name: sensor.interval for sensor in variant.rig.sensors if sensor.interval > 1}
    record: PlannedVariant = {
        "plan": variant.digest,
        "scene": variant.scene.digest,
        "rig": variant.rig.digest,
        "appearance": variant.appearance.digest,
        "folder": layout.folder(variant.variant),
    }
    return {**record, "intervals": intervals} if intervals else record


def file_row(body: bytes) -> FileRow:
    """Return the size and the SHA-256 of a file with this content."""
    return len(body), hashlib.sha256(body).hexdigest()


def listed_files(manifest: Manifest) -> dict[str, tuple[int, str]]:
    """Return the size and SHA-256 of every file that a manifest lists.

    Raises:
        ValueError: a row is in the wrong table, its path leads out of the folder, or two rows cannot both be files.
    """
    rows: dict[str, tuple[int, str]] = {}
    for table in _TABLES:
        for path, row in manifest[table].items():
            if not stays_inside(path):
                raise ValueError(f"{path[:200]!r} is not a path within a dataset")
            if path.count("/") >= MAX_PARTS:
                raise ValueError(
                    f"{path[:40]}... is in {path.count('/'):,} folders, and at most {MAX_PARTS - 1} are read"
                )
            if path.startswith(_PICTURES) != (table == "pictures"):
                raise ValueError(f"{path} does not belong in the table {table}")
            rows[path] = row["size"], row["sha256"]
    for path in rows:
        folder = path.rpartition("/")[0]
        while folder:
            if folder in rows:
                raise ValueError(f"{folder} is listed as a file, and {path} is in it")
            folder = folder.rpartition("/")[0]
    return rows


def stays_inside(path: str) -> bool:
    """Return whether a relative path stays within its folder, and a file system can have it."""
    parts = path.split("/")
    return (
        path.isprintable()
        and "\\" not in path
        and not any(part in ("", ".", "..") or len(part.encode()) > _MAX_PART for part in parts)
    )


def lock_of(manifest: Manifest, source: str = "", files: dict[str, str] | None = None) -> Lockfile:
    """Return a manifest's digests as a lockfile, which is sealed if they match the manifest's identity.

    Raises:
        ValueError: rows that variants share differ.
    """
    variants, traces, frames = {}, dict[str, str](), dict[FrameKey, str]()
    shared: dict[str, tuple[str, object]] = {}  # by the key of labels or of colours: a variant, and its rows of them
    for name in manifest["order"]:
        row = manifest["variants"][name]
        variants[name] = VariantRow(row["scene"], row["rig"], row["appearance"])
        labels = {s: {m: v for m, v in by.items() if m != "rgb"} for s, by in row["frames"].items()}
        colours = {s: by.get("rgb") for s, by in row["frames"].items()}
        for modality, own in (("labels", (row["trace"], labels, row.get("intervals", {}))), ("rgb", colours)):
            other, known = shared.setdefault(variants[name].frame_key(modality), (name, own))
            if known != own or traces.setdefault(row["scene"], row["trace"]) != row["trace"]:
                raise ValueError(f"the digests of {name!r} differ from those of {other!r}, which has the same scene")
        for sensor, modalities in row["frames"].items():
            interval = row.get("intervals", {}).get(sensor, 1)
            for modality, values in modalities.items():
                key = variants[name].frame_key(modality)
                taken = enumerate(values)
                frames.update({(key, sensor, modality, number * interval): value for number, value in taken})
    lock = Lockfile(
        recipe=manifest["recipe"],
        source=source,
        plan=manifest["plan"],
        files=files or {},
        tools=dict(manifest["tools"]),
        stages=dict(manifest["stages"]),
        variants=variants,
        traces=traces,
        frames=frames,
        sealed=False,
    )
    return replace(lock, sealed=lock.identity == manifest["identity"])


def is_whole(manifest: Manifest, dataset: DatasetPlan, root: Path) -> bool:
    """Return whether a folder contains exactly this dataset, judging by its manifest and its files' sizes.

    The content of the files is not read; `recipe verify` checks it, and `recipe build --repair` repairs it.
    """
    try:
        rows = listed_files(manifest)
        whole = layout.expected_files(dataset) <= {*rows, layout.MANIFEST}
        whole = whole and all(_is_file_of(f"{root}/{path}", size) for path, (size, _) in rows.items())
        return whole and is_of(manifest, dataset)
    except (OSError, ValueError):
        return False


def is_of(manifest: Manifest, dataset: DatasetPlan) -> bool:
    """Return whether a manifest has the digests of this plan and these tools, a digest of each of its frames, and the
    identity of these digests.
    """
    planned_head = {"about": None, **head(dataset)}
    if {key: manifest.get(key) for key in planned_head} != planned_head or manifest.get("tools") != tool_versions():
        return False
    planned, rows = {v.variant: _planned_variant(v) for v in dataset.variants}, manifest["variants"]
    if manifest["order"] != list(planned) or any(not planned[name].items() <= rows[name].items() for name in planned):
        return False
    try:
        lock = lock_of(manifest)
    except ValueError:  # rows that variants share differ
        return False
    return lock.sealed and lock.frames.keys() == set(digests.frame_keys(dataset))


def _is_file_of(path: str, size: int) -> bool:
    found = os.lstat(path)
    return stat.S_ISREG(found.st_mode) and found.st_size == size
