"""Reads a dataset folder: its plan, its digests as a lockfile, and whether its files are correct.

The folder is not trusted. Its documents are decoded into their types, its plan is compared with `dataset.plan_checks`
before use, and links are not followed. The plan determines which files must exist, and plan, labels and traces
determine the content of text files, so a manifest that was changed to match a forged text file is detected.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.lockfile import Lockfile, VariantRow
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.records import FrameRecord, LabelledFrame, Video, by_variant
from recipe_runtime.core import layout
from recipe_runtime.core.files import file_sha256, open_inside, read_inside
from recipe_runtime.core.files import regular_file as regular_file
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import STAGES, tool_versions
from recipe_runtime.dataset import digests, manifest_reader
from recipe_runtime.dataset.events import distinct_events
from recipe_runtime.dataset.manifest import listed_files
from recipe_runtime.dataset.manifest import lock_of as lock_of
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.plan_checks import byte_count, check_bounds, check_plan, file_count, row_count
from recipe_runtime.dataset.plan_reader import MAX_PLAN_BYTES, PlanReader
from recipe_runtime.dataset.text_files import annotation_texts, closing_texts, differing, instances_of, labels_of
from recipe_runtime.dataset.tracks import tracks_csv

_MAX_NAMES = 2000  # entries of a folder that are searched for a dataset
MAX_LINE = 16 * 2**20  # limit of one frame's labels, bytes
_MAX_KEPT = 32 * 2**20  # bytes of labels that are kept in memory while texts are compared; others are read again

Fault = tuple[str, str]  # path of a file, and a message of one line that names it


@dataclass(frozen=True)
class Dataset:
    """The content of a dataset folder, according to its manifest and plans."""

    root: Path
    plan: DatasetPlan
    lock: Lockfile
    files: dict[str, tuple[int, str]]  # path -> size, SHA-256
    name: str  # name in messages
    recipe_file: str | None = None  # path of the recipe's pack in the folder
    plan_digests: Mapping[str, str] = field(default_factory=dict)  # variant -> digest of its plan


def read(root: Path, name: str = "") -> Dataset:
    """Read the manifest and the plans of a dataset.

    Args:
        root: the dataset's folder.
        name: its name in messages, such as the URL of which the folder is a copy; the folder by default.

    Raises:
        InputError: the folder is not a dataset, or the manifest or a plan is damaged or of another version.
    """
    name = name or str(root)
    try:
        manifest = manifest_reader.read(root)
        files = listed_files(manifest)
        plan = _plan(root, manifest, files)
        check_plan(plan)
        check_bounds(plan)
        check_rows(manifest, files, plan)
        lock = lock_of(manifest)
        recipe_file = recipe_file_of(manifest, files)
    except manifest_reader.NotAManifestError:
        raise InputError(
            f"{name} is not a dataset: it holds no {layout.MANIFEST} of this project"
            if os.path.lexists(root)
            else f"{name}: there is no such folder",
            help=_nearest_dataset(root) or "name a folder that `recipe build` made, such as datasets/NAME",
            code=Code.INVALID_DATASET,
        ) from None
    except InputError as error:
        raise InputError(
            f"{name}: {str(error).splitlines()[0]}; not a dataset of this project", code=Code.INVALID_DATASET
        ) from None
    except PermissionError as error:
        raise InputError(
            f"{name}: its manifest or a plan cannot be read: {error.strerror}",
            help="allow this user to read the folder",
            code=Code.INVALID_DATASET,
        ) from None
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{name}: its manifest or a plan is damaged, or of another version ({reason})",
            help="move the folder away, and build the dataset again",
            code=Code.INVALID_DATASET,
        ) from None
    plan_digests = {variant: row["plan"] for variant, row in manifest["variants"].items()}
    return Dataset(root, plan, lock, files, name, recipe_file, plan_digests)


def _nearest_dataset(root: Path) -> str | None:
    """A remedy for a folder that is not a dataset: a dataset in it, or one next to it with a similar name, if any."""

    def datasets(folder: Path) -> list[Path]:
        try:
            entries = sorted(folder.iterdir())[:_MAX_NAMES]
        except OSError:
            return []
        return [entry for entry in entries if (entry / layout.MANIFEST).is_file()]

    inside = datasets(root)
    names = {path.name: path for path in datasets(root.parent) if path != root}
    close = difflib.get_close_matches(root.name, names, n=1, cutoff=0.7)
    found = inside[:1] or [names[name] for name in close]
    return f"did you mean {found[0]}?" if found else None


def check_rows(manifest: Manifest, files: Mapping[str, tuple[int, str]], plan: DatasetPlan) -> None:
    """Check that a manifest has the sensors of its plan, and not far more rows and bytes than the plan requires.

    Few surplus rows, and missing ones, are reported singly. Every byte is hashed, and a sparse file has any number.
    """
    for variant in plan.variants:
        row = manifest["variants"][variant.variant]
        surplus = {*row["frames"], *row.get("intervals", {})} - {sensor.name for sensor in variant.rig.sensors}
        if surplus:
            raise ValueError(f"{variant.variant} has frames of {min(surplus)!r}, which is no sensor of its plan")
        if row.get("intervals", {}) != {s.name: s.interval for s in variant.rig.sensors if s.interval > 1}:
            raise ValueError(f"{variant.variant} has other intervals of frames than its plan")
    rows = [row["frames"] for row in manifest["variants"].values()]
    frames = sum(len(values) for sensors in rows for sensor in sensors.values() for values in sensor.values())
    for number, most, what in (
        (len(files), file_count(plan), "files"),
        (frames, row_count(plan), "digests of frames"),
    ):
        if number > 4 * most + 10_000:
            raise ValueError(f"it lists {number:,} {what}, and its plan requires {most:,}")
    size, largest = sum(size for size, _ in files.values()), byte_count(plan)
    if size > largest:
        raise ValueError(f"it lists {size:,} bytes of files, and those of its plan have at most {largest:,}")


def plan_alone(path: Path) -> DatasetPlan:
    """Read one expanded plan from its file, as a dataset of one variant; InputError if it is invalid."""
    try:
        variant = PlanReader().read(read_inside(path.parent, path.name, MAX_PLAN_BYTES))
        alone = DatasetPlan(recipe=path.stem[:100], description="", variants=(variant,), annotations=())
        check_bounds(alone)
    except InputError as error:
        raise InputError(
            f"{path}: {str(error).splitlines()[0]}; it is not a plan of this project", code=Code.INVALID_DATASET
        ) from None
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file", code=Code.FILE_NOT_FOUND) from None
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: cannot be read as a plan: {reason}", code=Code.INVALID_DATASET) from None
    return alone


def damaged_files(dataset: Dataset, progress: Progress) -> list[Fault]:
    """Return files that are missing, surplus, not regular, or whose content differs from the manifest; one fault each.

    Every file is read once, in chunks. Links are reported and not followed.
    """
    expected, listed = layout.expected_files(dataset.plan), {*dataset.files, layout.MANIFEST}
    expected |= set() if dataset.recipe_file is None else {dataset.recipe_file}
    expected |= {path for path in listed if layout.is_of_page(path)}
    folders = {parent.as_posix() for path in expected | listed for parent in PurePosixPath(path).parents}
    kinds = dict(_entries(dataset.root, folders))
    found = _frames_without_digest(dataset)
    found += [(path, f"{path} is missing and not in the manifest") for path in sorted(expected - listed)]
    found += [(path, f"{path} is in the manifest but is not a file of this plan") for path in sorted(listed - expected)]
    known: dict[tuple[int, int], str] = {}  # by device and inode: hard-linked labels are read once
    for number, (path, (size, sha256)) in enumerate(dataset.files.items(), start=1):
        damage = _file_damage(dataset.root, path, kinds.get(path), size, sha256, known)
        found += [(path, damage)] if damage else []
        progress("files", number, len(dataset.files))
    for path, kind in sorted(kinds.items()):
        shown = path if path.isprintable() else ascii(path)  # a name may contain control characters
        if kind == "folder" and path not in folders:
            found.append((path, f"{shown}/ is a folder without a file of this plan"))
        elif kind != "folder" and path not in listed:
            found.append((path, f"{shown} is not in the manifest" + ("" if kind == "file" else f", and is a {kind}")))
    return found


def text_differences(dataset: Dataset, traces: Mapping[str, Trace]) -> list[Fault]:
    """Return faults of text files that contradict the plan, the labels or the given traces.

    Labels are read line by line and compared with the manifest's digests. Annotation files, sequence lists, plans and
    README are generated again from them, and `tracks.csv` and `events.csv` from the scene's Trace (by scene digest) if
    it is given; then the bytes are compared. A Trace without contacts makes no `events.csv`.
    """
    videos: list[Video] = []
    found: list[Fault] = []
    kept = 0  # bytes of labels
    for variant in dataset.plan.variants:
        for sensor in variant.rig.sensors:
            path = layout.labels_file(variant.variant, sensor.name)
            frames = _LabelledFrames(dataset, variant, sensor)
            try:
                size = frames.size()
                if kept + size <= _MAX_KEPT:
                    video = Video(variant.variant, variant.scene.digest, sensor, variant.scene.clock.fps, tuple(frames))
                    kept += size
                else:
                    video = Video(variant.variant, variant.scene.digest, sensor, variant.scene.clock.fps, frames)
                    for _ in frames:  # each is checked, and none is kept
                        pass
                videos.append(video)
            except (OSError, ValueError) as error:
                reason = str(error).splitlines()[0] if str(error) else type(error).__name__
                found.append((path, f"{path}: {reason}"))
    scenes = {v.scene.digest: v.scene for v in dataset.plan.variants if v.scene.digest in traces}
    for digest, scene in scenes.items():
        found += tracks_difference(dataset, scene, traces[digest])
    if found and len(videos) < len({(v.variant, s.name) for v in dataset.plan.variants for s in v.rig.sensors}):
        return found  # all labels are required to generate the files
    known = dataset.plan, dataset.lock.identity, videos
    by_name = by_variant(videos)
    for digest, scene in scenes.items():
        if traces[digest].contacts is None:
            continue
        mine = {v.variant: by_name[v.variant] for v in dataset.plan.variants if v.scene.digest == digest}
        for same, pieces in distinct_events(scene, traces[digest], mine):
            found += differing(dataset.root, map(layout.events_file, same), pieces)
    for path, make in (*annotation_texts(*known), *closing_texts(*known, dataset.recipe_file)):
        found += _text_difference(dataset.root, path, make)
    return found


class _LabelledFrames(Sequence[FrameRecord]):
    """The labelled frames of a video, read from its file each time that they are iterated over."""

    def __init__(self, dataset: Dataset, variant: ScenarioPlan, sensor: SensorPlan) -> None:
        self._known = dataset, variant, sensor

    def __iter__(self) -> Iterator[FrameRecord]:
        for row in labels(*self._known):
            yield {**row, "digests": {}, "rgb": {}, "files": {}}

    def __len__(self) -> int:
        return len(self._known[2].frames(self._known[1].scene.clock.frames))

    def __getitem__(self, index: Any) -> Any:
        """Return one frame or a slice; the file is read for it."""
        return tuple(self)[index]

    def size(self) -> int:
        """Return the size of the file in bytes; 0 if there is none."""
        dataset, variant, sensor = self._known
        found = regular_file(dataset.root, layout.labels_file(variant.variant, sensor.name))
        return found.st_size if found is not None else 0


def tracks_difference(dataset: Dataset, scene: ScenePlan, trace: Trace) -> list[Fault]:
    """Return a fault for every variant of a scene whose `tracks.csv` differs from that of a Trace."""
    names = (variant.variant for variant in dataset.plan.variants if variant.scene.digest == scene.digest)
    return differing(dataset.root, map(layout.tracks_file, names), tracks_csv(scene, trace))


def _entries(root: Path, folders: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield every entry of the given folders below a root, with its kind; links are listed and not followed."""
    waiting = ["."]
    while waiting:
        folder = waiting.pop()
        try:
            rows = sorted(os.scandir(root / folder), key=lambda entry: entry.name)
        except OSError:
            yield folder, "folder that cannot be read"
            continue
        for entry in rows:
            path = entry.name if folder == "." else f"{folder}/{entry.name}"
            if entry.is_dir(follow_symlinks=False):
                yield path, "folder"
                waiting += [path] if path in folders else []
            else:
                yield path, "link" if entry.is_symlink() else "file" if entry.is_file() else "device"


def _file_damage(
    root: Path, path: str, kind: str | None, size: int, sha256: str, known: dict[tuple[int, int], str]
) -> str | None:
    if kind != "file":
        return f"{path} is missing or cannot be read" if kind is None else f"{path} is a {kind}, not a file"
    there = (root / path).lstat()
    if there.st_size != size:
        return f"{path} has {count(there.st_size, 'byte')}, not {size:,} as in the manifest"
    key = there.st_dev, there.st_ino
    try:
        known[key] = known.get(key) or file_sha256(root / path)
    except OSError:
        return f"{path} is missing or cannot be read"
    return None if known[key] == sha256 else f"{path} differs from its SHA-256 in the manifest"


def _frames_without_digest(dataset: Dataset) -> list[Fault]:
    """Return the frames that the manifest lacks, or has in addition to the plan."""
    rows, expected = digests.bare(dataset.plan, "", {}).variants, set()
    for variant in dataset.plan.variants:
        key = rows[variant.variant]
        for sensor in variant.rig.sensors:
            frames = sensor.frames(variant.scene.clock.frames)
            expected |= {(key.frame_key(m), sensor.name, m, k) for m in ("labels", *sensor.capture) for k in frames}
    there = set(dataset.lock.frames)
    found: list[Fault] = []
    for rest, what in (
        (expected - there, ("frame of the plan has no digest", "frames of the plan have no digest")),
        (there - expected, ("digest is of no frame of the plan", "digests are of no frame of the plan")),
    ):
        if rest:
            _, name, modality, frame = min(rest)
            which = f"{count(len(rest), *what)}, the first: {name}, {modality}, frame {frame}"
            found.append((layout.MANIFEST, f"{layout.MANIFEST}: {which}"))
    return found


def labels(dataset: Dataset, variant: ScenarioPlan, sensor: SensorPlan) -> Iterator[LabelledFrame]:
    """Return the labels of a video's frames; ValueError at the first line that differs from the manifest."""
    path = layout.labels_file(variant.variant, sensor.name)
    try:
        lines = open_inside(dataset.root, path)
    except (OSError, ValueError):
        raise ValueError("missing, or not a regular file") from None
    actors = instances_of(variant.scene)
    row = VariantRow(variant.scene.digest, variant.rig.digest, variant.appearance.digest)
    with lines:
        for number, frame in enumerate(sensor.frames(variant.scene.clock.frames), start=1):
            value = dataset.lock.frames.get((row.frame_key("labels"), sensor.name, "labels", frame))
            try:
                found = labels_of(lines.readline(MAX_LINE), frame, value, sensor, actors)
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
            yield found
        if lines.read(1):
            raise ValueError("it has more lines than frames")


def _text_difference(root: Path, path: str, make: Callable[[], Iterable[str]]) -> list[Fault]:
    try:
        return differing(root, [path], (piece.encode() for piece in make()))
    except ValueError as error:
        return [(path, f"{path} cannot be generated from the labels: {type(error).__name__}")]


def recipe_file_of(manifest: Manifest, files: Collection[str]) -> str | None:
    """Return the path of the recipe's pack according to the manifest; ValueError if it is another file."""
    path = manifest.get("recipe_file")
    if path is not None and (path not in files or path != layout.recipe_file(manifest["recipe"])):
        raise ValueError("recipe_file is not the pack of the recipe")
    return path


def _plan(root: Path, manifest: Manifest, files: Collection[str]) -> DatasetPlan:
    variants, reader = [], PlanReader()
    for name in manifest["order"]:
        path = layout.plan_file(name)
        if path not in files:  # the list contains no path that leads out of the folder
            raise ValueError(f"the plan of {name!r} is not among its files")
        try:
            variant = reader.read(_bytes_of(root, path))
        except ValueError as error:
            is_other = (manifest["stages"], manifest["tools"]) != (STAGES, tool_versions())
            raise ValueError(f"{path}: {'made by other versions of stages or tools; ' * is_other}{error}") from None
        if variant.variant != name:
            raise ValueError(f"{path} is the plan of {variant.variant!r}")
        variants.append(variant)
    given = {"recipe": manifest["recipe"], "description": manifest["description"], "about": manifest.get("about", {})}
    forms = dict(manifest["outputs"])
    plan = DatasetPlan.model_validate(
        {**given, "variants": tuple(variants), "annotations": forms.pop("annotations", ()), "forms": forms}
    )
    if plan.outputs != manifest["outputs"]:
        raise ValueError("outputs does not list the forms of files as a manifest does")
    if plan.about.stated != manifest.get("about", {}):
        raise ValueError("about is not written as a manifest has it")
    return plan


def _bytes_of(root: Path, path: str) -> bytes:
    try:
        return read_inside(root, path, MAX_PLAN_BYTES)
    except (OSError, ValueError):
        raise ValueError(f"{path} is missing, not a plain file, or too large") from None
