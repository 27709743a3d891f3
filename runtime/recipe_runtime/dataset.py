"""A dataset folder, read back: its plan, its digests as a lockfile, and whether its files are whole."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from recipe_compiler.errors import InputError
from recipe_compiler.lockfile import FrameKey, Lockfile, VariantRow
from recipe_compiler.plan import DatasetPlan, ScenarioPlan

from recipe_runtime import layout
from recipe_runtime.engines import Progress
from recipe_runtime.workspace import read_manifest


@dataclass(frozen=True)
class Dataset:
    """What a folder says that it holds."""

    root: Path
    plan: DatasetPlan
    lock: Lockfile
    files: dict[str, tuple[int, str]]  # path -> size, SHA-256


def read(root: Path) -> Dataset:
    """Read a dataset's manifest and plans; InputError if the folder holds none, or a damaged one."""
    manifest = read_manifest(root)
    if manifest is None:
        raise InputError(f"{root} is not a dataset: it holds no {layout.MANIFEST} of this project")
    try:
        plan = _plan(root, manifest)
        lock = lock_of(manifest)
        rows = {**manifest["files"], **manifest["pictures"]}
        files = {path: (int(row["size"]), str(row["sha256"])) for path, row in rows.items()}
    except (KeyError, TypeError, ValueError, OSError, ValidationError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{root}: its manifest or a plan is damaged ({reason}); build the dataset again") from None
    return Dataset(root, plan, lock, files)


def damaged_files(dataset: Dataset, progress: Progress) -> list[str]:
    """Files that are missing, or whose bytes are not the manifest's; and files that the manifest does not know."""
    found = []
    for number, (path, (size, sha256)) in enumerate(dataset.files.items(), start=1):
        try:
            body = (dataset.root / path).read_bytes()
        except OSError:
            found.append(f"{path} is missing or cannot be read")
        else:
            if len(body) != size:
                found.append(f"{path} has {len(body)} bytes, not {size}")
            elif hashlib.sha256(body).hexdigest() != sha256:
                found.append(f"{path} has other bytes than the manifest says")
        progress("files", number, len(dataset.files))
    known = {*dataset.files, layout.MANIFEST}
    there = sorted(p.relative_to(dataset.root).as_posix() for p in dataset.root.rglob("*") if p.is_file())
    return found + [f"{path} is not in the manifest" for path in there if path not in known]


def _plan(root: Path, manifest: dict[str, Any]) -> DatasetPlan:
    variants = tuple(
        ScenarioPlan.model_validate_json((root / layout.plan_file(name)).read_bytes()) for name in manifest["order"]
    )
    outputs = manifest["outputs"]
    return DatasetPlan(
        recipe=manifest["recipe"],
        description=manifest["description"],
        variants=variants,
        annotations=tuple(outputs["annotations"]),
        depth=outputs["depth"],
    )


def lock_of(manifest: dict[str, Any], source: str = "", files: dict[str, str] | None = None) -> Lockfile:
    """A manifest's digests as lockfile rows; sealed if they add up to its identity."""
    variants, traces, frames = {}, {}, dict[FrameKey, str]()
    for name in manifest["order"]:
        row = manifest["variants"][name]
        variants[name] = VariantRow(row["scene"], row["rig"], row["appearance"])
        traces[row["scene"]] = row["trace"]
        for sensor, modalities in row["frames"].items():
            for modality, values in modalities.items():
                key = variants[name].frame_key(modality)
                frames.update({(key, sensor, modality, number): value for number, value in enumerate(values)})
    lock = Lockfile(
        recipe=manifest["recipe"],
        source=source,
        plan=manifest["plan"],
        files=files or {},
        tools=dict(manifest["tools"]),
        stages={key: int(value) for key, value in manifest["stages"].items()},
        variants=variants,
        traces=traces,
        frames=frames,
        sealed=False,
    )
    return replace(lock, sealed=lock.identity == manifest["identity"])
