"""The layout on which Ultralytics' YOLO trains detectors: `yolo detect train data=FOLDER/data.yaml`.

    data.yaml                               folders, and the names of the classes
    images/train/<sequence>_000000.png      RGB pictures
    labels/train/<sequence>_000000.txt      a line `class x_centre y_centre width height` for each object
    sequences.csv                           variant and sensor of each sequence

Boxes are those of the visible pixels, `bbox` of labels.jsonl, in shares of the picture with six decimals. Classes are
COCO's categories, counted from 0. A frame without objects has an empty file. Names of sequences are their number and a
readable part of letters, digits, `_` and `-`. There is one split, which `val` names too; name another export there for
validation. Ultralytics adds `labels/train.cache`, so a folder in which it has trained is no complete export any more.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.annotate.categories import CATEGORIES, CATEGORY_IDS
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.formats.format import Entry, Format, Options
from recipe_runtime.transfer.formats.sequence import ExportSequence, names_table


def _check(dataset: Dataset, options: Options) -> None:
    """Raise InputError if a dataset has no RGB pictures."""
    if not any("rgb" in sensor.capture for variant in dataset.plan.variants for sensor in variant.rig.sensors):
        raise InputError(
            f"{dataset.name} has no RGB pictures",
            help="add rgb to `capture` in the recipe, and build it again",
            code=Code.INVALID_DATASET,
        )


def _files(sequences: Sequence[ExportSequence], options: Options) -> Iterator[Entry]:
    yield Entry("data.yaml", _description())
    for sequence in sequences:
        if "rgb" in sequence.sensor.capture:
            name = f"{sequence.number:04d}_" + re.sub(r"[^A-Za-z0-9_-]", "-", sequence.name)
            for frame in sequence.labels():
                stem = f"train/{name}_{frame['frame']:06d}"
                yield Entry(f"images/{stem}.png", sequence.picture(frame["frame"]))
                yield Entry(f"labels/{stem}.txt", _lines(sequence, frame))
    yield Entry("sequences.csv", names_table(sequences))


def _description() -> Iterator[str]:
    """Yield the lines of `data.yaml`; without `path`, folders are relative to its own."""
    yield "train: images/train\n"
    yield "val: images/train  # a dataset has one split; name another export for one of your own\n"
    yield "names:\n"
    yield from (f"  {number}: {name}\n" for number, name in enumerate(CATEGORIES.values()))


def _lines(sequence: ExportSequence, frame: LabelledFrame) -> Iterator[str]:
    """Yield the lines of the labels of a frame."""
    width, height = sequence.sensor.camera.width, sequence.sensor.camera.height
    for item in frame["objects"]:
        x, y, w, h = item["bbox"]
        shares = (x + w / 2) / width, (y + h / 2) / height, w / width, h / height
        yield " ".join([str(CATEGORY_IDS[item["instance"] // 1000] - 1), *(f"{share:.6f}" for share in shares)]) + "\n"


FORMAT = Format(files=_files, check=_check)
