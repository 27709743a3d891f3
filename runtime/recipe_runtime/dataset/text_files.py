"""Every text of a dataset that follows from its plan and its labels: what the build writes and the verifier compares.

The labels themselves are kept as `<variant>/<sensor>/labels.jsonl`: a line a frame, the canonical JSON of its records,
so that each line has the digest that lockfile and manifest hold for the frame.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from recipe_compiler.ir.canonical import canonical_bytes, pretty
from recipe_compiler.ir.plan import DatasetPlan, SensorPlan

from recipe_runtime.annotate.coco import flat_coco, kwcoco
from recipe_runtime.annotate.mots import mots_lines, runs_fill, seqinfo, seqmap
from recipe_runtime.annotate.records import FrameRecord, LabelRecord, Video, label_digest
from recipe_runtime.core import layout
from recipe_runtime.dataset.card import card
from recipe_runtime.dataset.json_stream import loads

_MOST_VALUES = 2_000_000  # of one frame's labels; the codes of masks hold brackets, which are counted

Text = tuple[str, Callable[[], str]]  # a file's path, and what makes it


def labels_text(video: Video) -> str:
    """The labels of a video, a line a frame."""
    return "".join(canonical_bytes(record["objects"]).decode() + "\n" for record in video.frames)


def with_labels(video: Video, text: str) -> Video:
    """The video with its labels as they are written: numbers as JSON has them, so that a reader's are the same."""
    lines = text.split("\n")  # not splitlines: a name may hold another separator
    frames: list[FrameRecord] = [
        {**record, "objects": json.loads(line)} for record, line in zip(video.frames, lines, strict=False)
    ]
    return replace(video, frames=tuple(frames))


def labels_of(line: bytes, digest: str | None, sensor: SensorPlan) -> list[LabelRecord]:
    """The records of one line of labels; ValueError unless they are those of that digest, in canonical form."""
    records = loads(line, _MOST_VALUES)
    if label_digest(records) != digest:
        raise ValueError("it is not what the manifest's digest stands for")
    if canonical_bytes(records) + b"\n" != line:
        raise ValueError("it is not in canonical form")
    size = sensor.camera.width * sensor.camera.height
    if not all(runs_fill(record["counts"], size) for record in records):
        raise ValueError("a mask has another size than the picture")
    found: list[LabelRecord] = records
    return found


def annotation_texts(dataset: DatasetPlan, identity: str, videos: Sequence[Video]) -> Iterator[Text]:
    """The annotation files that the recipe asks for."""
    kinds = dataset.annotations
    if "kwcoco" in kinds:
        yield layout.KWCOCO, lambda: kwcoco(dataset, identity, videos)
    if "coco" in kinds:
        yield layout.coco_file("rgb"), lambda: flat_coco(dataset, identity, videos, "rgb")
    if "mots_txt" in kinds:
        yield layout.MOTS_SEQMAP, lambda: seqmap([_sequence(video) for video in videos])
        for video in videos:
            yield layout.mots_text_file(video.variant, video.sensor.name), lambda v=video: _mots(v)  # type: ignore[misc]
            yield layout.seqinfo_file(video.variant, video.sensor.name), lambda v=video: _seqinfo(v)  # type: ignore[misc]


def closing_texts(
    dataset: DatasetPlan, identity: str, videos: Sequence[Video], recipe_file: str | None
) -> Iterator[Text]:
    """The plans and the card. `recipe_file`: where the recipe lies in the dataset, if it does."""
    for variant in dataset.variants:
        yield layout.plan_file(variant.variant), lambda v=variant: pretty(v.document())  # type: ignore[misc]
    yield layout.CARD, lambda: card(dataset, identity, videos, recipe_file)


def _sequence(video: Video) -> str:
    return layout.sequence(video.variant, video.sensor.name)


def _objects(video: Video) -> list[list[LabelRecord]]:
    return [record["objects"] for record in video.frames]


def _mots(video: Video) -> str:
    return mots_lines(_objects(video), video.sensor.camera.width, video.sensor.camera.height)


def _seqinfo(video: Video) -> str:
    camera = video.sensor.camera
    pictures = f"../../../{layout.folder(video.variant)}/{layout.folder(video.sensor.name)}/rgb"
    return seqinfo(_sequence(video), pictures, video.fps, len(video.frames), camera.width, camera.height)
