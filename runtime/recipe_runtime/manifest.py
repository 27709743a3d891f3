"""`manifest.json`: what a dataset is made of, digest by digest and file by file.

    identity   what a paper prints: NAME@sha256:DIGEST, the lockfile's too; over plans, traces, pixels and labels
    outputs    what the recipe asks to be written
    tools      versions of the packages that bytes depend on
    variants   digests of plan, scene, rig, appearance and trace; per sensor and modality a digest for every frame
               (`labels`: the records of what is seen)
    files      size and SHA-256 of every file, apart from this one and the pictures
    pictures   the same of what is under preview/: drawn for people, and not part of any digest, because fonts and
               scaling may change with Pillow

Pixels and files are told apart, so that another encoder shows as that.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from recipe_compiler.canonical import pretty
from recipe_compiler.plan import DatasetPlan

from recipe_runtime import layout
from recipe_runtime.harvest import Harvest
from recipe_runtime.versions import STAGES, tool_versions

FORMAT = "recipe/manifest/1"
_PICTURES = "preview/"

FileRows = Mapping[str, list[Any]]  # path: [size, SHA-256]


def head(dataset: DatasetPlan) -> dict[str, Any]:
    """What a manifest says of the plan: two builds with equal heads make the same dataset."""
    return {
        "format": FORMAT,
        "recipe": dataset.recipe,
        "description": dataset.description,
        "plan": dataset.digest,
        "outputs": {"annotations": list(dataset.annotations), "depth": dataset.depth},
        "stages": dict(STAGES),
    }


def manifest_text(dataset: DatasetPlan, harvest: Harvest, files: FileRows) -> str:
    """The manifest of a finished dataset."""
    sensors: dict[str, dict[str, Any]] = {}
    for video in harvest.videos():
        pixels = {m: [v for _, v in sorted(frames.items())] for m, frames in harvest.pixels(video).items()}
        sensors.setdefault(video.variant, {})[video.sensor.name] = pixels
    variants = {
        v.variant: {
            "plan": v.digest,
            "scene": v.scene.digest,
            "rig": v.rig.digest,
            "appearance": v.appearance.digest,
            "trace": harvest.traces[v.scene.digest],
            "folder": layout.folder(v.variant),
            "frames": sensors[v.variant],
        }
        for v in dataset.variants
    }
    rows = {path: {"size": row[0], "sha256": row[1]} for path, row in sorted(files.items())}
    return pretty(
        {
            **head(dataset),
            "identity": harvest.identity(),
            "tools": tool_versions(),
            "order": [v.variant for v in dataset.variants],
            "variants": variants,
            "files": {p: row for p, row in rows.items() if not p.startswith(_PICTURES)},
            "pictures": {p: row for p, row in rows.items() if p.startswith(_PICTURES)},
        }
    )


def file_row(body: bytes) -> list[Any]:
    """Size and SHA-256 of a file."""
    return [len(body), hashlib.sha256(body).hexdigest()]


def is_whole(manifest: Mapping[str, Any], dataset: DatasetPlan, root: Path) -> bool:
    """Whether a folder holds this very dataset, by its manifest and the sizes of its files."""
    if {key: manifest.get(key) for key in head(dataset)} != head(dataset):
        return False
    rows = {**manifest.get("files", {}), **manifest.get("pictures", {})}
    try:
        return bool(rows) and all((root / path).stat().st_size == row["size"] for path, row in rows.items())
    except OSError:
        return False
