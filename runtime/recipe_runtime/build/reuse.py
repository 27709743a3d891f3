"""Reuses frames of an earlier build of another plan, by linking its files instead of rendering them again.

A view (scene and sensor) that occurs in both plans has the same labels; the same view with the same appearance has the
same pictures. The existing dataset in the output folder is used if the cache records that this program built it on this
host. Every file is hashed and compared with its digest before it is linked.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.lockfile import VariantRow
from recipe_compiler.ir.modalities import CHOICES, form_of
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan, SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.records import FileRow, FrameRecord
from recipe_runtime.build.workspace import Workspace
from recipe_runtime.cache.store import Store
from recipe_runtime.core import layout
from recipe_runtime.core.files import has_content, open_inside, regular_file
from recipe_runtime.core.versions import builder_identity
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.schedule import ReusedFrames, View, views
from recipe_runtime.dataset.text_files import instances_of, labels_of


def remember(store: Store, out: Path, plan: DatasetPlan) -> None:
    """Record in the cache that this program built the dataset of a plan in `out`; errors are ignored."""
    with suppress(RunError, OSError):
        store.put("built", _name(out), b"")
        store.put("built", _place(plan), os.fsencode(out))


def built(store: Store, plan: DatasetPlan) -> Dataset | None:
    """Return the dataset that this program last built on this host from a plan; None if it no longer exists."""
    place = store.get("built", _place(plan))
    before = None if place is None else earlier(store, Path(os.fsdecode(place)))
    return before if before is not None and before.plan.digest == plan.digest else None


def earlier(store: Store, out: Path) -> Dataset | None:
    """Return the dataset in a folder, if this program built it and its plans are those of its manifest.

    The manifest is known by its digest. Its plan digest covers the plans, which decide whose frames the pictures are.
    """
    if regular_file(out, layout.MANIFEST) is None or store.get("built", _name(out)) is None:
        return None
    try:
        before = datasets.read(out)
    except InputError:
        return None
    return before if before.plan.digest == before.lock.plan else None


def _name(out: Path) -> str:
    manifest = hashlib.sha256((out / layout.MANIFEST).read_bytes()).hexdigest()
    return digest("store/built/1", [manifest, builder_identity()])


def _place(plan: DatasetPlan) -> str:
    return digest("store/built-at/1", [plan.digest, builder_identity()])


@dataclass
class Reuse:
    """The part of a plan's views that an earlier dataset contains; nothing if `before` is None."""

    plan: DatasetPlan
    before: Dataset | None
    _labels: dict[str, tuple[ScenarioPlan, SensorPlan]] = field(default_factory=dict)  # by view
    _pictures: dict[tuple[str, str], str] = field(default_factory=dict)  # view, appearance -> a variant
    _seen: dict[str, list[bytes]] = field(default_factory=dict)  # labels' lines of the last view

    def __post_init__(self) -> None:
        if self.before is None or _forms(self.plan) != _forms(self.before.plan):
            return
        for view in views(self.before.plan):
            for index in view.variants:
                variant = self.before.plan.variants[index]
                self._labels.setdefault(view.key, (variant, view.sensor))
                self._pictures.setdefault((view.key, variant.appearance.digest), variant.variant)

    def knows(self, view: View) -> bool:
        """Whether the earlier dataset contains the same view."""
        return view.key in self._labels

    def covered(self, view: View) -> tuple[int, ...]:
        """Return the view's variants whose pictures and labels are all available."""
        if not self.knows(view):
            return ()
        plain = "rgb" not in view.sensor.capture
        patched = [bool(self.plan.variants[n].appearance.patches) for n in view.variants]
        return tuple(
            n
            for n, has_patches in zip(view.variants, patched, strict=True)
            if (plain and not has_patches) or self._picture(view, n) is not None
        )

    def take(self, work: Workspace | None, view: View, variants: Sequence[int]) -> list[FrameRecord]:
        """Return the records of a view's frames for these variants, except frames with a damaged file.

        Every file is hashed and then linked into the workspace; without a workspace, nothing is written.
        """
        records = []
        for frame in view.frames:
            with suppress(OSError, ValueError, LookupError):
                records.append(self._frame(work, view, frame, variants))
        return records

    def _picture(self, view: View, index: int) -> str | None:
        return self._pictures.get((view.key, self.plan.variants[index].appearance.digest))

    def _frame(self, work: Workspace | None, view: View, frame: int, variants: Sequence[int]) -> FrameRecord:
        assert self.before is not None
        old, sensor = self._labels[view.key]
        names = [self.plan.variants[n].variant for n in variants]
        files: dict[str, FileRow] = {}
        for modality in (m for m in view.sensor.capture if m != "rgb"):
            source = layout.frame_file(old.variant, sensor.name, modality, frame, self.plan.forms)
            paths = [layout.frame_file(n, view.sensor.name, modality, frame, self.plan.forms) for n in names]
            files |= self._linked(work, source, paths)
        copies = [layout.label_copies(self.plan, name, view.sensor, frame) for name in names]
        for form, source in layout.label_copies(self.plan, old.variant, sensor, frame).items():
            files |= self._linked(work, source, [paths[form] for paths in copies])
        rgb: dict[str, str] = {}
        for index, name in zip(variants, names, strict=True):
            picture = self._picture(view, index)
            if "rgb" in view.sensor.capture and picture is not None:
                source = layout.frame_file(picture, sensor.name, "rgb", frame, self.plan.forms)
                path = layout.frame_file(name, view.sensor.name, "rgb", frame, self.plan.forms)
                files |= self._linked(work, source, [path])
                rgb[name] = self._digest(picture, sensor, "rgb", frame)
            if self.plan.variants[index].appearance.patches and picture is not None:
                source = layout.patches_file(picture, sensor.name, frame)
                files |= self._linked(work, source, [layout.patches_file(name, view.sensor.name, frame)])
        labels = [m for m in view.sensor.capture if m != "rgb"] + ["labels"]
        digests = {m: self._digest(old.variant, sensor, m, frame) for m in labels}
        line = self._lines(view)[frame // view.sensor.interval]
        seen = labels_of(line, frame, digests["labels"], sensor, instances_of(view.scene))
        return {**seen, "digests": digests, "rgb": rgb, "files": files}

    def _linked(self, work: Workspace | None, source: str, paths: list[str]) -> dict[str, FileRow]:
        """Check a file of the earlier dataset, and link it under its names in the new dataset."""
        assert self.before is not None
        row = self.before.files[source]
        if not has_content(self.before.root, source, *row):
            raise ValueError(f"{source} is not what the manifest says")
        if work is not None:
            for path in paths:
                work.take(self.before.root / source, path)
        return dict.fromkeys(paths, row)

    def _digest(self, variant: str, sensor: SensorPlan, modality: str, frame: int) -> str:
        assert self.before is not None
        row: VariantRow = self.before.lock.variants[variant]
        return self.before.lock.frames[row.frame_key(modality), sensor.name, modality, frame]

    def _lines(self, view: View) -> list[bytes]:
        """Return the records of visible objects of each frame of a view, one line per frame."""
        assert self.before is not None
        if view.key not in self._seen:
            old, sensor = self._labels[view.key]
            path, lines = layout.labels_file(old.variant, sensor.name), list[bytes]()
            with suppress(OSError, ValueError), open_inside(self.before.root, path) as file:
                while len(lines) < len(view.frames) and (not lines or lines[-1].endswith(b"\n")):
                    lines.append(file.readline(datasets.MAX_LINE))
            self._seen = {view.key: lines}
        return self._seen[view.key]


def reasons(reuse: Reuse, simulated: Sequence[str], reused: Mapping[int, ReusedFrames]) -> Iterator[str]:
    """Yield one line per stage that explains why it runs or is skipped.

    Args:
        reuse: what the earlier dataset provides.
        simulated: digests of the scenes whose motion is not in the cache.
        reused: what was reused of each view.
    """
    plan = reuse.plan
    scenes = len({v.scene.digest for v in plan.variants})
    if simulated:
        yield f"simulate {len(simulated)} of {count(scenes, 'scene')}: their motion is not in the cache"
    else:
        yield f"simulate nothing: the motion of {count(scenes, 'scene')} is in the cache"
    for number, view in enumerate(views(plan)):
        covered, there = reuse.covered(view), reused.get(number, ReusedFrames((), frozenset()))
        names = [plan.variants[n].variant for n in view.variants if n not in covered]
        where = f"{view.sensor.name}, {count(len(view.frames), 'frame')}"
        if covered:
            which, lost = (
                _some([plan.variants[n].variant for n in covered]),
                len(view.frames) - len(there.frames),
            )
            if there.frames:
                whole = count(len(there.frames), "frame")
                yield f"reuse {view.sensor.name}, {whole} of {which}: nothing of them changed"
            if lost:
                damaged = count(lost, "frame")
                yield f"make {view.sensor.name}, {damaged} of {which} again: files of them are damaged or missing"
        if names and reuse.knows(view):
            yield f"shade {where} of {_some(names)}: an appearance that the earlier dataset has not"
        elif names:
            yield f"observe, label and shade {where} of {_some(names)}: {_why(reuse)}"


def _why(reuse: Reuse) -> str:
    if reuse.before is None:
        return "there is no earlier dataset that this program built"
    if _forms(reuse.plan) != _forms(reuse.before.plan):
        return "the earlier dataset has other outputs"
    return "a scene or sensor that the earlier dataset has not"


def _forms(plan: DatasetPlan) -> tuple[dict[str, str], bool, bool]:
    """Return the settings that the files of a frame depend on, besides its pixels."""
    copies = "kwcoco" in plan.annotations and any(form_of(name, plan.forms).copy for name in CHOICES)
    return plan.forms, "mots_png" in plan.annotations, copies


def _some(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{count(len(names), 'variant')} ({names[0]}, ...)"
