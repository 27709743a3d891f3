"""The text files of a dataset, which follow from its plan and labels: builds write them, the verifier compares them.

The labels are stored as `<variant>/<sensor>/labels.jsonl`: one line per frame, the canonical JSON of its records, so
that each line has the digest that lockfile and manifest contain for the frame.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from recipe_compiler.ir.canonical import canonical_bytes, pretty
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan, SensorPlan

from recipe_runtime.annotate.coco import flat_coco, kwcoco
from recipe_runtime.annotate.mots import mots_lines, runs_fill, seqinfo, seqmap
from recipe_runtime.annotate.records import (
    FrameRecord,
    LabelledFrame,
    Video,
    label_digest,
    only_labels,
)
from recipe_runtime.core import layout
from recipe_runtime.core.documents import decode
from recipe_runtime.core.files import open_inside, sha256_of
from recipe_runtime.dataset.card import card
from recipe_runtime.dataset.catalogues.citation import citation
from recipe_runtime.dataset.catalogues.croissant import croissant

_MAX_RUN_CODES = 12  # characters a pixel of all masks of a frame: two runs of at most six

Text = tuple[str, Callable[[], Iterable[str]]]  # a file's path, and what makes its pieces


def labels_text(video: Video) -> str:
    """The labels of a video, one line per frame."""
    return "".join(canonical_bytes(only_labels(record)).decode() + "\n" for record in video.frames)


def with_labels(video: Video, text: str) -> Video:
    """The video with its labels as a reader of the file gets them: numbers rounded as in JSON."""
    lines = text.split("\n")  # not splitlines: a name may hold another separator
    frames: list[FrameRecord] = [
        {**record, **json.loads(line)} for record, line in zip(video.frames, lines, strict=False)
    ]
    return replace(video, frames=tuple(frames))


def labels_of(
    line: bytes, frame: int, digest: str | None, sensor: SensorPlan, actors: Mapping[str, int]
) -> LabelledFrame:
    """The labels of one line of a labels file.

    Args:
        line: the line.
        frame: the number of its frame.
        digest: the digest that the manifest has of it.
        sensor: the sensor.
        actors: the instance values of the scene's actors, by name (`instances_of`).

    Raises:
        ValueError: the line has another digest, is not in canonical form, or contains what no label has.
    """
    try:
        found = decode(line, LabelledFrame)
    except ValueError as error:
        raise ValueError(f"it holds what no label has: {error}") from None
    if found["frame"] != frame:
        raise ValueError("it is the line of another frame")
    if label_digest(found) != digest:
        raise ValueError("it is not what the manifest's digest stands for")
    if canonical_bytes(found) + b"\n" != line:
        raise ValueError("it is not in canonical form")
    records = found["objects"]
    names = [record["actor"] for record in records]
    if len(set(names)) < len(names) or any(actors.get(r["actor"]) != r["instance"] for r in records):
        raise ValueError("it has labels of other actors than the scene's")
    size = sensor.camera.width * sensor.camera.height
    if sum(len(record["counts"]) for record in records) > _MAX_RUN_CODES * (size + len(records) + 1):
        raise ValueError("its masks have more runs than the picture has pixels")
    if not all(runs_fill(record["counts"], size) for record in records):
        raise ValueError("a mask has another size than the picture")
    return found


def instances_of(scene: ScenePlan) -> dict[str, int]:
    """The instance value of every actor of a scene, by name."""
    return {actor.name: actor.tag * 1000 + actor.instance for actor in scene.actors}


def annotation_texts(dataset: DatasetPlan, identity: str, videos: Sequence[Video]) -> Iterator[Text]:
    """The annotation files that the recipe selects."""
    kinds = dataset.annotations
    if "kwcoco" in kinds:
        yield layout.KWCOCO, lambda: kwcoco(dataset, identity, videos)
    if "coco" in kinds:
        yield layout.coco_file("rgb"), lambda: flat_coco(dataset, identity, videos, "rgb")
    if "mots_txt" in kinds:
        yield layout.MOTS_SEQMAP, lambda: [seqmap([_sequence(video) for video in videos])]
        for video in videos:
            yield layout.mots_text_file(video.variant, video.sensor.name), lambda v=video: _mots(v)  # type: ignore[misc]
            yield layout.seqinfo_file(video.variant, video.sensor.name), lambda v=video: [_seqinfo(v)]  # type: ignore[misc]


def closing_texts(
    dataset: DatasetPlan, identity: str, videos: Sequence[Video], recipe_file: str | None
) -> Iterator[Text]:
    """The plans, the card and what catalogues read. `recipe_file`: the recipe's path in the dataset, if it is in it."""
    for variant in dataset.variants:
        yield layout.plan_file(variant.variant), lambda v=variant: [pretty(v.document())]  # type: ignore[misc]
    yield layout.CARD, lambda: [card(dataset, identity, videos, recipe_file)]
    yield layout.CROISSANT, lambda: [croissant(dataset, identity, recipe_file)]
    if dataset.about.authors:
        yield layout.CITATION, lambda: [citation(dataset, identity)]


def _sequence(video: Video) -> str:
    return layout.sequence(video.variant, video.sensor.name)


def _mots(video: Video) -> Iterator[str]:
    return mots_lines(video.frames, video.sensor.camera.width, video.sensor.camera.height)


def _seqinfo(video: Video) -> str:
    camera = video.sensor.camera
    pictures = f"../../../{layout.folder(video.variant)}/{layout.folder(video.sensor.name)}/rgb"
    return seqinfo(_sequence(video), pictures, video.fps, video.length, camera.width, camera.height)


def differing(root: Path, paths: Iterable[str], pieces: Iterable[bytes]) -> list[tuple[str, str]]:
    """Return the faults of files that must all consist of these pieces: path and message.

    The pieces are made once, and a file with several hard links is read once.
    """
    size, expected, known = 0, hashlib.sha256(), dict[tuple[int, int], bool]()
    for piece in pieces:
        size += len(piece)
        expected.update(piece)
    found = []
    for path in paths:
        try:
            with open_inside(root, path) as file:
                there = os.fstat(file.fileno())
                key = there.st_dev, there.st_ino
                if key not in known:
                    known[key] = there.st_size == size and sha256_of(file) == expected.hexdigest()
        except (OSError, ValueError):
            found.append((path, f"{path} is missing or cannot be read"))
            continue
        if not known[key]:
            found.append((path, f"{path} does not follow from plan, labels and traces"))
    return found
