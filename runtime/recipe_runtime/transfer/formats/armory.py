"""The layouts that Armory's CARLA loaders read, with one patch; MART reads carla_over_obj_det.

    carla_obj_det/dev/_out/                 kwcoco_annotations_without_patch_and_sans_tiny_objects.json,
                                            sensor.camera.rgb.1/, sensor.camera.depth.2/ (logarithmic greyscale),
                                            foreground_mask/, patch_metadata/
    carla_over_obj_det/dev/                 kwcoco_annotations.json, rgb/, depth/ (24 bits), foreground_mask/,
                                            patch_metadata/
    carla_mot/dev/<video>/                  rgb/, foreground_mask/, patch_metadata/, instances.txt
    carla_video_tracking/dev/<video>/       000001.png, 000001_mask.png, ..., gt_boxes.npy, gs_coords.npy
    left_out.csv                            frames and videos that a loader or an attack cannot use, with the reason

In the last two, pictures are counted from 1: those of a sensor with a `tick` have no gaps. Boxes are x1, y1, x2, y2 in
carla_obj_det and x, y, width, height elsewhere, and arrays have the types that the loaders expect. File names have no
dots; those of patches that are not on the ground start with 1, from which a loader derives the bound of depth
perturbation. A picture is written up to four times. `--json` has the number of rows of left_out.csv as `left_out`.
[attacks.md](attacks.md#armory-and-mart) has more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, InputError, Problem
from recipe_compiler.ir.patches import PatchPlan
from recipe_compiler.ir.plurals import count
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.annotate.ids import annotation_id, image_id, video_id
from recipe_runtime.annotate.rows import tables
from recipe_runtime.attacks.patch_metadata import is_on_ground, is_usable, visible_mask
from recipe_runtime.attacks.truth import PatchRecord
from recipe_runtime.core import codecs, layout
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.dataset.tracks import field
from recipe_runtime.modalities.depth import NAME as DEPTH
from recipe_runtime.modalities.depth import to_carla
from recipe_runtime.transfer.formats.format import Entry, Format, Options, Remarks, Row
from recipe_runtime.transfer.formats.sequence import ExportSequence, damaged_file

Json = dict[str, object]

_OBJ_DET, _OVER, _MOT, _TRACKING = (
    f"carla_{task}/dev" for task in ("obj_det", "over_obj_det", "mot", "video_tracking")
)
_LEFT_OUT = "left_out.csv"
_NAMES = {1: "pedestrian", 2: "vehicle", 3: "trafficlight"}  # by category id; the overhead layout has the first two
_PERSONS = (Tag.PEDESTRIAN.value, Tag.RIDER.value)
_LOG_SLOPE = 5.70378  # of the logarithmic depth: 1 + ln(metres / 1000) / 5.70378


class _Object(NamedTuple):
    """The labels of a visible object that the layouts have, without its mask."""

    instance: int
    actor: str
    bbox: tuple[int, int, int, int]  # x, y, width, height
    area: int


@dataclass(frozen=True)
class _Frame:
    """A frame of a sequence: its objects, and the ground truth of the patch without the mask."""

    number: int
    objects: tuple[_Object, ...]
    patch: PatchRecord


@dataclass(frozen=True)
class _Patched:
    """A sequence with a patch."""

    sequence: ExportSequence
    patch: PatchPlan
    frames: list[_Frame]

    @property
    def usable(self) -> Iterator[_Frame]:
        """The frames that can be used for object detection."""
        return (frame for frame in self.frames if _has_depth(self.sequence) and is_usable(frame.patch))


def _check(dataset: Dataset, options: Options) -> None:
    """Raise InputError unless a variant has both the patch, or any if none is named, and RGB pictures."""
    name = options.get("patch")
    with_pictures = [v for v in dataset.plan.variants if any("rgb" in sensor.capture for sensor in v.rig.sensors)]
    names = list(dict.fromkeys(patch.name for variant in with_pictures for patch in variant.appearance.patches))
    if not names:
        raise InputError(
            f"{dataset.name} has no picture with a patch",
            help="add `patches` and `capture: [rgb, depth]` to the recipe, and build it again",
            code=Code.INVALID_DATASET,
        )
    if name not in (None, *names):
        what = f"{dataset.name} has no picture with a patch {name!r}; it has {', '.join(names)}"
        raise InputError(what, code=Code.UNKNOWN_NAME)


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    """Yield the files of all layouts, then the annotations of object detection, and the list of what is left out."""
    patched = []
    for sequence in sequences:
        patch = _patch(sequence, options.get("patch"))
        if patch is not None:
            patched.append(_Patched(sequence, patch, _frames(sequence, patch)))
            yield from _sequence_files(patched[-1])
    path = f"{_OBJ_DET}/_out/kwcoco_annotations_without_patch_and_sans_tiny_objects.json"
    yield Entry(path, _annotations(patched, overhead=False))
    yield Entry(f"{_OVER}/kwcoco_annotations.json", _annotations(patched, overhead=True))
    yield Entry(_LEFT_OUT, _left_out(sequences, patched))


def _sequence_files(patched: _Patched) -> Iterator[Entry]:
    """Yield the files of one sequence in all layouts."""
    sequence, patch, frames = patched.sequence, patched.patch, patched.frames
    coordinates, targets, rows = _coordinates(frames), _target_boxes(frames), _instances(frames)
    for step, (frame, corners) in enumerate(zip(frames, coordinates, strict=True), start=1):
        picture, mask = sequence.picture(frame.number), _mask_png(sequence, patch, frame.number)
        yield from _detection_files(sequence, patch, frame, picture, mask)
        if corners is not None and rows is not None:
            folder, stem = f"{_MOT}/{_video(sequence)}", f"{step:06d}"
            yield Entry(f"{folder}/rgb/{stem}.png", picture)
            yield Entry(f"{folder}/foreground_mask/{stem}.png", mask)
            yield Entry(f"{folder}/patch_metadata/{stem}.npy", codecs.npy(corners))
        if corners is not None and targets is not None:
            folder, stem = f"{_TRACKING}/{_video(sequence)}", f"{step:06d}"
            yield Entry(f"{folder}/{stem}.png", picture)
            yield Entry(f"{folder}/{stem}_mask.png", mask)
    found = [corners for corners in coordinates if corners is not None]
    if found and rows is not None:
        yield Entry(f"{_MOT}/{_video(sequence)}/instances.txt", rows)
    if found and targets is not None:
        yield Entry(f"{_TRACKING}/{_video(sequence)}/gt_boxes.npy", codecs.npy(targets))
        yield Entry(f"{_TRACKING}/{_video(sequence)}/gs_coords.npy", codecs.npy(np.stack(found)))


def _remarks(dataset: Dataset, out: Path, rows: Sequence[Row]) -> Remarks:
    """Return how many rows list what is left out, with a note, or a warning if there is no picture."""
    table, files = out / _LEFT_OUT, {row["file"] for row in rows}
    left_out = len(table.read_text().splitlines()) - 1 if _LEFT_OUT in files else 0
    facts = {"left_out": left_out}
    if not any(file.endswith(".png") for file in files):
        what, remedy = f"{out}: Armory can use no frame, so the export has no picture", f"{table} has the reasons"
        return Remarks([Problem(what, None, remedy, Code.INVALID_DATASET)], facts=facts)
    text = f"{table} has {count(left_out, 'row')}: frames and videos that were left out, with the reasons"
    return Remarks(notes=[text] if left_out else [], facts=facts)


def _patch(sequence: ExportSequence, name: str | None) -> PatchPlan | None:
    """Return the patch to export, the first if `name` is None; None if it is absent, or there are no RGB pictures."""
    patches = sequence.variant.appearance.patches if "rgb" in sequence.sensor.capture else ()
    return next((patch for patch in patches if name in (None, patch.name)), None)


def _frames(sequence: ExportSequence, patch: PatchPlan) -> list[_Frame]:
    frames = []
    for labels in sequence.labels():
        rows = labels["objects"]
        objects = tuple(_Object(r["instance"], r["actor"], _box(r["bbox"]), r["area"]) for r in rows)
        record = sequence.patch(labels["frame"], patch.name)
        frames.append(_Frame(labels["frame"], objects, {**record, "counts": None, "homography": None}))
    return frames


def _box(bbox: list[int]) -> tuple[int, int, int, int]:
    x, y, w, h = bbox
    return x, y, w, h


def _has_depth(sequence: ExportSequence) -> bool:
    return DEPTH in sequence.sensor.capture


def _detection_files(
    sequence: ExportSequence, patch: PatchPlan, frame: _Frame, picture: bytes, mask: bytes
) -> Iterator[Entry]:
    """Yield the files of a frame for object detection; none if an attack cannot use the frame."""
    if not (_has_depth(sequence) and is_usable(frame.patch)):
        return
    stem = _stem(sequence, patch, frame.number)
    metres = sequence.depth(frame.number)
    corners = np.array(frame.patch["corners_int"], np.int32)
    raw_corners = np.array(frame.patch["corners"], np.float64)
    mean_depth = np.array(frame.patch["depth"], np.float64)
    for root, rgb, depth, pixels in (
        (f"{_OBJ_DET}/_out", "sensor.camera.rgb.1", "sensor.camera.depth.2", _log_depth(metres)),
        (_OVER, "rgb", "depth", to_carla(metres)),
    ):
        yield Entry(f"{root}/{rgb}/{stem}.png", picture)
        yield Entry(f"{root}/{depth}/{stem}.png", codecs.png(pixels))
        yield Entry(f"{root}/foreground_mask/{stem}.png", mask)
        yield Entry(f"{root}/patch_metadata/{stem}_coords.npy", codecs.npy(corners))
        yield Entry(f"{root}/patch_metadata/{stem}_raw_coords.npy", codecs.npy(raw_corners))
        yield Entry(f"{root}/patch_metadata/{stem}_avg_depth.npy", codecs.npy(mean_depth))


def _annotations(patched: Sequence[_Patched], *, overhead: bool) -> Iterator[str]:
    """Yield the JSON text of the annotations for object detection."""
    ids = [1, 2] if overhead else [1, 2, 3]
    return tables(
        {
            "info": {"description": patched[0].sequence.dataset.plan.description if patched else ""},
            "licenses": [{"id": 1, "name": "not stated", "url": ""}],
            "categories": [{"id": k, "name": _NAMES[k], "supercategory": ""} for k in ids],
            "images": (_image(p.sequence, p.patch, frame, overhead=overhead) for p in patched for frame in p.usable),
            "annotations": (
                _object(p.sequence, frame.number, item, overhead=overhead)
                for p in patched
                for frame in p.usable
                for item in frame.objects
            ),
        }
    )


def _image(sequence: ExportSequence, patch: PatchPlan, frame: _Frame, *, overhead: bool) -> Json:
    """Return the row of an image, with exactly the keys that the loaders expect."""
    name = f"{_stem(sequence, patch, frame.number)}.png"
    row: Json = {
        "id": image_id(sequence.variant.variant, sequence.sensor.name, frame.number),
        "file_name": name if overhead else f"_out/sensor.camera.rgb.1/{name}",
        "width": sequence.sensor.camera.width,
        "height": sequence.sensor.camera.height,
        "date_captured": "",
        "license": 1,
        "coco_url": "",
        "flickr_url": "",
    }
    if not overhead:
        row |= {
            "video_id": video_id(sequence.variant.variant, sequence.sensor.name),
            "frame_index": frame.number,
        }
    return row


def _object(sequence: ExportSequence, frame: int, item: _Object, *, overhead: bool) -> Json:
    names = sequence.variant.variant, sequence.sensor.name, frame
    x, y, w, h = item.bbox
    return {
        "id": annotation_id(*names, item.actor),
        "image_id": image_id(*names),
        "category_id": _category(item),
        "bbox": [x, y, w, h] if overhead else [x, y, x + w, y + h],
        "area": item.area,
        "iscrowd": 0,
    }


def _category(item: _Object) -> int:
    return 1 if item.instance // 1000 in _PERSONS else 2


def _coordinates(frames: Sequence[_Frame]) -> list[NDArray[np.int64] | None]:
    """Return the corners [4, 2] of every frame; frames that an attack cannot use repeat those of the last usable frame.

    Frames before the first usable one take its corners. All are None if no frame is usable.
    """
    usable = [np.array(f.patch["corners_int"], np.int64) if is_usable(f.patch) else None for f in frames]
    last = next((corners for corners in usable if corners is not None), None)
    filled = []
    for corners in usable:
        last = last if corners is None else corners
        filled.append(last)
    return filled


def _instances(frames: Sequence[_Frame]) -> list[str] | None:
    """Return the lines of `instances.txt`; None for fewer than two, which a loader does not read as a table."""
    lines = []
    for step, frame in enumerate(frames, start=1):
        for item in frame.objects:
            box = " ".join(map(str, item.bbox))
            lines.append(f"{step} {item.instance} {box} 1 {_category(item)} 1\n")
    return lines if len(lines) > 1 else None


def _target_boxes(frames: Sequence[_Frame]) -> NDArray[np.int64] | None:
    """Return the boxes x1, y1, x2, y2 [T, 4] of the largest pedestrian, by total area, that is visible in all frames.

    None if no pedestrian is visible in all frames.
    """
    boxes: dict[str, list[_Object]] = {}
    for frame in frames:
        for item in frame.objects:
            if item.instance // 1000 == Tag.PEDESTRIAN.value:
                boxes.setdefault(item.actor, []).append(item)
    complete = {name: rows for name, rows in boxes.items() if len(rows) == len(frames)}
    if not complete:
        return None
    target = min(complete, key=lambda name: (-sum(item.area for item in complete[name]), name))
    return np.array([[x, y, x + w, y + h] for x, y, w, h in (item.bbox for item in complete[target])], np.int64)


def _left_out(sequences: Sequence[ExportSequence], patched: Sequence[_Patched]) -> Iterator[str]:
    """Yield the lines of `left_out.csv`."""
    frames_of = {p.sequence.number: p.frames for p in patched}
    yield "layout,variant,sensor,frame,reason\n"
    for sequence in sequences:
        names = f"{field(sequence.variant.variant)},{field(sequence.sensor.name)}"
        frames = frames_of.get(sequence.number)
        if frames is None:
            yield f"all,{names},all,no patch or no rgb\n"
            continue
        hidden = [frame.number for frame in frames if not is_usable(frame.patch)]
        if not _has_depth(sequence):
            yield f"carla_obj_det and carla_over_obj_det,{names},all,no depth\n"
        else:
            yield from (f"carla_obj_det and carla_over_obj_det,{names},{n},patch is not seen\n" for n in hidden)
        if len(hidden) == len(frames):
            yield f"carla_mot and carla_video_tracking,{names},all,patch is not seen\n"
            continue
        if _instances(frames) is None:
            yield f"carla_mot,{names},all,fewer than two objects\n"
        if _target_boxes(frames) is None:
            yield f"carla_video_tracking,{names},all,no pedestrian is seen in every frame\n"


def _mask_png(sequence: ExportSequence, patch: PatchPlan, frame: int) -> bytes:
    camera = sequence.sensor.camera
    try:
        mask = visible_mask(sequence.patch(frame, patch.name), camera.width, camera.height)
    except ValueError as error:
        path = layout.patches_file(sequence.variant.variant, sequence.sensor.name, frame)
        raise damaged_file(sequence.dataset, f"{path}: {error}") from None
    return codecs.png(mask)


def _log_depth(metres: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return logarithmic depth [H, W, 3], three equal channels: 255 (1 + ln(metres / 1000) / 5.70378), rounded."""
    limits = [1000.0 * exact.exp(((level - 0.5) / 255.0 - 1.0) * _LOG_SLOPE) for level in range(1, 256)]
    levels = np.searchsorted(np.array(limits), metres, side="right").astype(np.uint8)
    return np.repeat(levels[..., None], 3, axis=2)


def _video(sequence: ExportSequence) -> str:
    """Return a unique name of a sequence, of letters, digits, `_`, `-`, `=` and `+`."""
    return f"{sequence.number:04d}_" + re.sub(r"[^A-Za-z0-9_=+-]", "_", sequence.name)


def _stem(sequence: ExportSequence, patch: PatchPlan, frame: int) -> str:
    return f"{0 if is_on_ground(patch) else 1}_{_video(sequence)}_{frame:06d}"


FORMAT = Format(files=_files, check=_check, copies=4, remarks=_remarks)  # a copy for each layout
