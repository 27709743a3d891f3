"""Numbers that describe a dataset: those that follow from its plan, and histograms of its labels."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import CameraPlan, DatasetPlan

from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.annotate.records import LabelledFrame, LabelRecord
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset, labels
from recipe_runtime.dataset.schedule import View, simulations, views
from recipe_runtime.report.annotated import box_pixels

MAX_EXAMPLES = 4  # places that are kept for a class and a bin, each of another actor

Example = tuple[int, int, int]
"""View by its number, frame, instance value of the object."""


@dataclass(frozen=True)
class Quantity:
    """A number of each annotation, and the lower bounds of the bins of its histogram; the last bin has no upper one."""

    title: str
    unit: str
    bounds: tuple[float, ...]
    value: Callable[[LabelRecord, CameraPlan], float]


def misfit(item: LabelRecord, camera: CameraPlan) -> float:
    """Return the share of an object's boxes outside of its projected tight box, 0 in labels that agree.

    Both follow from the same motion in different ways, so a box, a mask or a pose that is wrong is seen here. 0 for an
    object of which a corner is behind the camera.
    """
    places = box_pixels(item["tight3d"], camera)
    found = [place for place in places if place is not None]
    if len(found) < len(places):
        return 0.0
    x0, x1 = min(x for x, _ in found) - _MARGIN, max(x for x, _ in found) + _MARGIN
    y0, y1 = min(y for _, y in found) - _MARGIN, max(y for _, y in found) + _MARGIN
    shares = []
    for x, y, w, h in (item["bbox"], item["amodal_bbox"]):
        wide, high = min(x + w, x1) - max(x, x0), min(y + h, y1) - max(y, y0)
        shares.append(1.0 - max(wide, 0.0) * max(high, 0.0) / (w * h) if w * h > 0 else 0.0)
    return max(shares)


_MARGIN = 1.0  # pixels: labels are those of whole pixels
_TENTHS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
QUANTITIES: dict[str, Quantity] = {
    "size": Quantity(
        "visible pixels",
        "px",
        (0.0, 10.0, 32.0, 100.0, 320.0, 1024.0, 3200.0, 9216.0, 32000.0, 100000.0),
        lambda item, _: item["area"],
    ),
    "distance": Quantity(
        "distance",
        "m",
        (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0, 200.0),
        lambda item, _: item["distance"],
    ),
    "visibility": Quantity("visible share", "", (*_TENTHS, 1.0), lambda item, _: item["visible_fraction"]),
    "truncation": Quantity("share outside of the picture", "", _TENTHS, lambda item, _: item["truncation"]),
    "misfit": Quantity("share of the box outside of its 3-D box", "", (0.0, 0.01, *_TENTHS[1:]), misfit),
}


@dataclass
class ClassCounts:
    """What the labels have of one class: annotations, and their histograms with examples, by quantity."""

    annotations: int = 0
    actors: set[int] = field(default_factory=set)
    counts: dict[str, list[int]] = field(
        default_factory=lambda: {name: [0] * len(quantity.bounds) for name, quantity in QUANTITIES.items()}
    )
    examples: dict[tuple[str, int], list[Example]] = field(default_factory=dict)

    def add(self, item: LabelRecord, camera: CameraPlan, place: Example, times: int) -> None:
        """Count an annotation that so many variants have."""
        self.annotations += times
        self.actors.add(item["instance"])
        for name, quantity in QUANTITIES.items():
            number = max(bisect_right(quantity.bounds, quantity.value(item, camera)) - 1, 0)
            self.counts[name][number] += times
            kept = self.examples.setdefault((name, number), [])
            if len(kept) < MAX_EXAMPLES and all(other[::2] != place[::2] for other in kept):
                kept.append(place)

    def document(self) -> dict[str, object]:
        """Return plain JSON, without the examples."""
        return {"annotations": self.annotations, "actors": len(self.actors), "histograms": self.counts}


@dataclass
class LabelStatistics:
    """The histograms of all labels, by class name, and the number of annotated frames."""

    classes: dict[str, ClassCounts] = field(default_factory=dict)
    frames: int = 0
    empty: int = 0  # frames without an annotation

    def add(self, number: int, view: View, frame: LabelledFrame) -> None:
        """Count a frame of a view, which its variants share."""
        times, objects = len(view.variants), frame["objects"]
        self.frames += times
        self.empty += 0 if objects else times
        for item in objects:
            name = CATEGORIES.get(item["instance"] // 1000, "other")
            place = (number, frame["frame"], item["instance"])
            self.classes.setdefault(name, ClassCounts()).add(item, view.sensor.camera, place, times)

    def document(self) -> dict[str, object]:
        """Return plain JSON: counts by class and bin."""
        return {
            "annotated_frames": self.frames,
            "empty_frames": self.empty,
            "annotations": sum(found.annotations for found in self.classes.values()),
            "bins": {name: list(quantity.bounds) for name, quantity in QUANTITIES.items()},
            "classes": {name: found.document() for name, found in sorted(self.classes.items())},
        }


def label_statistics(dataset: DatasetPlan, labels_of: Callable[[View], Iterable[LabelledFrame]]) -> LabelStatistics:
    """Return the statistics of all labels; `labels_of` returns those of a view, which its variants share."""
    found = LabelStatistics()
    for number, view in enumerate(views(dataset)):
        for frame in labels_of(view):
            found.add(number, view, frame)
    return found


def dataset_statistics(dataset: Dataset) -> dict[str, object]:
    """Return the numbers of a dataset folder, as plain JSON: those of its plan, and those of its labels.

    Raises:
        InputError: Its labels are missing or damaged.
    """

    def of(view: View) -> Iterator[LabelledFrame]:
        variant = dataset.plan.variants[view.variants[0]]
        try:
            yield from labels(dataset, variant, view.sensor)
        except (OSError, ValueError) as error:
            raise InputError(
                f"{dataset.name}: {layout.labels_file(variant.variant, view.sensor.name)}: {error}",
                help="repair the dataset",
                code=Code.INVALID_DATASET,
            ) from None

    found = label_statistics(dataset.plan, of)
    return {"identity": dataset.lock.identity, **plan_statistics(dataset.plan), "labels": found.document()}


def plan_statistics(dataset: DatasetPlan) -> dict[str, object]:
    """Return the numbers that follow from the plan alone, as plain JSON; known before a build."""
    scenes, seen = simulations(dataset), views(dataset)
    pictures: dict[str, int] = {}
    pixels = frames = 0
    for view in seen:
        taken, camera = len(view.frames) * len(view.variants), view.sensor.camera
        frames += taken
        pixels += taken * camera.width * camera.height
        for modality in view.sensor.capture:
            pictures[modality] = pictures.get(modality, 0) + taken
    return {
        "recipe": dataset.recipe,
        "plan": dataset.digest,
        "variants": len(dataset.variants),
        "scenes": len(scenes),
        "views": len(seen),
        "sensors": sorted({view.sensor.name for view in seen}),
        "frames": frames,
        "pixels": pixels,
        "pictures": pictures,
        "seconds": round(sum(v.scene.clock.frames / v.scene.clock.fps for v in dataset.variants), 3),
        "towns": sorted({scene.town.name for scene in scenes}),
        "actors": _actors(dataset),
        "patches": max(len(variant.appearance.patches) for variant in dataset.variants),
    }


def _actors(dataset: DatasetPlan) -> Mapping[str, int]:
    """Return the number of distinct actors of all scenes by class, whether visible or not."""
    found = {(actor.tag, actor.instance) for scene in simulations(dataset) for actor in scene.actors}
    tags = [tag for tag, _ in found]
    return {CATEGORIES.get(tag, "other"): tags.count(tag) for tag in sorted(set(tags))}
