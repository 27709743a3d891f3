"""The layout on which Ultralytics' YOLO trains detectors: `yolo detect train data=FOLDER/data.yaml`.

    data.yaml                               folders, and the names of the classes
    images/train/<sequence>_000000.png      RGB pictures
    labels/train/<sequence>_000000.txt      a line `class x_centre y_centre width height` for each object
    sequences.csv                           variant and sensor of each sequence

Boxes are those of the visible pixels, `bbox` of labels.jsonl, in shares of the picture with six decimals. With
`--task segment`, a line is `class x y x y ...`: a polygon along the edges of the visible pixels. Pieces and holes of
one object are joined to one polygon by lines without width. Classes are those of the map of categories, counted from 0:
a category's id less 1. With `--categories coco`, a network that is trained on COCO has the same numbers. A frame
without objects has an empty file. Names of sequences are their number and a readable part of letters, digits, `_` and
`-`. There is one split, which `val` names too; name another export there for validation. Ultralytics adds
`labels/train.cache`, so a folder in which it has trained is no complete export any more.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.annotate.outlines import joined, rings
from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.transfer.formats.category_map import CARLA, CategoryMap
from recipe_runtime.transfer.formats.format import (
    Entry,
    Format,
    Options,
    categories_of,
    check_pictures,
    layout_key,
)
from recipe_runtime.transfer.formats.sequence import ExportSequence, names_table

_TASK = "task"


def _box(item: LabelRecord, width: int, height: int) -> list[float]:
    """Return the columns of a box, shares of the picture."""
    x, y, w, h = item["bbox"]
    return [(x + w / 2) / width, (y + h / 2) / height, w / width, h / height]


def _polygon(item: LabelRecord, width: int, height: int) -> list[float]:
    """Return the columns of a polygon, shares of the picture."""
    x, y, w, h = item["bbox"]
    mask = unpacked(item["counts"], width, height)[y : y + h, x : x + w]
    return [share for u, v in joined(rings(mask)) for share in ((x + u) / width, (y + v) / height)]


_COLUMNS: Mapping[str, Callable[[LabelRecord, int, int], list[float]]] = {"detect": _box, "segment": _polygon}
"""The columns after the class, by task."""


def _key(name: str, options: Options) -> Mapping[str, str | int]:
    task = options.get(_TASK)
    if task not in (None, *_COLUMNS):
        raise InputError(f"there is no task {task!r}; write {' or '.join(_COLUMNS)}", code=Code.UNKNOWN_NAME)
    return layout_key(name, options)


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    categories, columns = categories_of(options, CARLA), _COLUMNS[options.get(_TASK, "detect")]
    yield Entry("data.yaml", _description(categories))
    for sequence in sequences:
        if "rgb" in sequence.sensor.capture:
            name = f"{sequence.number:04d}_" + re.sub(r"[^A-Za-z0-9_-]", "-", sequence.name)
            camera = sequence.sensor.camera
            for frame in sequence.labels():
                stem = f"train/{name}_{frame['frame']:06d}"
                yield Entry(f"images/{stem}.png", sequence.picture(frame["frame"]))
                rows = _rows(frame, categories, lambda item, camera=camera: columns(item, camera.width, camera.height))  # type: ignore[misc]
                yield Entry(f"labels/{stem}.txt", rows)
    yield Entry("sequences.csv", names_table(sequences))


def _description(categories: CategoryMap) -> Iterator[str]:
    """Yield the lines of `data.yaml`; without `path`, folders are relative to its own."""
    yield "train: images/train\n"
    yield "val: images/train  # a dataset has one split; name another export for one of your own\n"
    yield "names:\n"
    for number in range(max(categories.names)):  # Ultralytics requires a name for each number
        yield f"  {number}: {_plain(categories.names.get(number + 1, f'unused_{number}'))}\n"


def _plain(name: str) -> str:
    """Return a name as YAML; a plain one is not quoted."""
    return name if re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) else json.dumps(name)


def _rows(
    frame: LabelledFrame, categories: CategoryMap, columns: Callable[[LabelRecord], list[float]]
) -> Iterator[str]:
    """Yield the lines of the labels of a frame."""
    for item in frame["objects"]:
        category = categories.id(item["instance"])
        if category is not None:
            yield " ".join([str(category - 1), *(f"{share:.6f}" for share in columns(item))]) + "\n"


FORMAT = Format(files=_files, check=check_pictures, key=_key)
