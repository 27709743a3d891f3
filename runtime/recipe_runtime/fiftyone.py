"""Loads a dataset into FiftyOne, with the pictures of all sensors and modalities of a moment as one group.

    import recipe_runtime.fiftyone
    dataset = recipe_runtime.fiftyone.load("datasets/rain_bench")

Pictures stay where they are. A group is a frame of a variant, with a slice for each sensor that captures RGB. A sample
has the fields

    ground_truth   Detections: box and mask of the visible pixels, `index` (the instance value), and the attributes
                   actor, distance, visible_fraction and truncation
    semantic       Segmentation of CARLA's tags, if the sensor captures it
    depth          Heatmap in metres, if the sensor captures it; colours end at 100 m
    variant, sensor, frame, time

FiftyOne is not installed with this package: `pip install fiftyone`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from recipe_compiler.ir.semantic_tags import Tag

from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.core import layout
from recipe_runtime.core.files import regular_file
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.modalities.depth import NAME as DEPTH
from recipe_runtime.modalities.semantic import NAME as SEMANTIC
from recipe_runtime.transfer.formats.category_map import CategoryMap, chosen
from recipe_runtime.transfer.formats.sequence import ExportSequence, damaged_file

if TYPE_CHECKING:
    import fiftyone

_FAR = 100.0  # metres, where the colours of depth end


def load(
    root: Path | str, name: str | None = None, *, categories: str = "carla", persistent: bool = False
) -> fiftyone.Dataset:
    """Load a dataset that `recipe build` wrote.

    Args:
        root: Its folder.
        name: The name in FiftyOne; by default, FiftyOne makes one.
        categories: The labels of objects: `carla`, `coco`, or a YAML file as `recipe export --categories` takes it.
        persistent: Whether FiftyOne keeps the dataset after this session.

    Returns:
        The dataset in FiftyOne.

    Raises:
        InputError: The folder is not a dataset, has a damaged file, or the categories are not a map.
    """
    import fiftyone

    found = read(Path(root))
    dataset = fiftyone.Dataset(name, persistent=persistent)
    dataset.info = {"identity": found.lock.identity, **found.plan.about.stated}
    dataset.mask_targets = {SEMANTIC: {tag.value: tag.label for tag in Tag}}
    dataset.add_group_field("group", default=next(_slices(found), None))
    for group in samples(found, categories):
        dataset.add_samples(group, progress=False)
    return dataset


def samples(dataset: Dataset, categories: str = "carla") -> Iterator[list[fiftyone.Sample]]:
    """Yield the samples of each frame of each variant, one for each sensor that captures RGB.

    Args:
        dataset: The dataset, read by `recipe_runtime.dataset.reader.read`.
        categories: As in `load`.

    Raises:
        InputError: A file is damaged, or the categories are not a map.
    """
    import fiftyone

    names = chosen(categories)
    for variant in dataset.plan.variants:
        taken: dict[int, list[tuple[ExportSequence, LabelledFrame]]] = {}
        for sensor in variant.rig.sensors:
            if "rgb" in sensor.capture:
                sequence = ExportSequence(dataset, variant, sensor, 0)
                for labels in sequence.labels():
                    taken.setdefault(labels["frame"], []).append((sequence, labels))
        for _, views in sorted(taken.items()):
            group = fiftyone.Group()
            yield [_sample(sequence, labels, names, group) for sequence, labels in views]


def _slices(dataset: Dataset) -> Iterator[str]:
    """Yield the names of the sensors that capture RGB."""
    for variant in dataset.plan.variants:
        yield from (sensor.name for sensor in variant.rig.sensors if "rgb" in sensor.capture)


def _sample(
    sequence: ExportSequence, labels: LabelledFrame, categories: CategoryMap, group: fiftyone.Group
) -> fiftyone.Sample:
    import fiftyone

    sensor, frame = sequence.sensor, labels["frame"]
    sample = fiftyone.Sample(
        filepath=str(_path(sequence, "rgb", frame)),
        group=group.element(sensor.name),
        variant=sequence.variant.variant,
        sensor=sensor.name,
        frame=frame,
        time=float(labels["time"]),
    )
    size = sensor.camera.width, sensor.camera.height
    known = [(item, number) for item in labels["objects"] if (number := categories.id(item["instance"])) is not None]
    found = [_detection(item, categories.names[number], *size) for item, number in known]
    sample["ground_truth"] = fiftyone.Detections(detections=found)
    if SEMANTIC in sensor.capture:
        sample[SEMANTIC] = fiftyone.Segmentation(mask_path=str(_path(sequence, SEMANTIC, frame)))
    if DEPTH in sensor.capture:
        metres = sequence.depth(frame).astype(np.float32)
        sample[DEPTH] = fiftyone.Heatmap(map=metres, range=[0.0, _FAR])
    return sample


def _detection(item: LabelRecord, label: str, width: int, height: int) -> fiftyone.Detection:
    import fiftyone

    x, y, w, h = item["bbox"]
    return fiftyone.Detection(
        label=label,
        bounding_box=[x / width, y / height, w / width, h / height],
        mask=unpacked(item["counts"], width, height)[y : y + h, x : x + w].astype(bool),
        index=item["instance"],
        actor=item["actor"],
        distance=float(item["distance"]),
        visible_fraction=float(item["visible_fraction"]),
        truncation=float(item["truncation"]),
    )


def _path(sequence: ExportSequence, modality: str, frame: int) -> Path:
    """Return the path of a picture, which is a regular file of the dataset and no link."""
    dataset = sequence.dataset
    path = layout.frame_file(sequence.variant.variant, sequence.sensor.name, modality, frame, dataset.plan.forms)
    if regular_file(dataset.root, path) is None:
        raise damaged_file(dataset, f"{path} is missing, or not a regular file")
    return (dataset.root / path).absolute()
