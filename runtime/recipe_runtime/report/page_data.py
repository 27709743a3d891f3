"""The data that a page shows, as plain JSON: short forms of labels, tracks, events and patches, and the overview."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from recipe_compiler.ir.modalities import MODALITIES, form_of
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.annotate.records import LabelledFrame
from recipe_runtime.attacks.truth import FrameTruth
from recipe_runtime.core import codecs, layout
from recipe_runtime.core.documents import decode
from recipe_runtime.dataset.schedule import View, simulations
from recipe_runtime.modalities import declared
from recipe_runtime.report.canvas import Box, Canvas
from recipe_runtime.report.town_ground import town_canvas

_MAP_SIDE, _MAP_MARGIN, _MAP_EXTENT = 900, 12.0, 400.0  # pixels of the map's longer side; metres
_PATH_POINTS = 80  # of an actor's whole path
_LEFT_OUT = ("box3d_world", "tight3d", "tight3d_world")  # the page draws `box3d`
_EVENT = ("event", "frame", "end_frame", "sensor", "subject", "object", "value")


@dataclass(frozen=True)
class Scene:
    """A scene, and the variant whose files have its motion."""

    plan: ScenePlan
    variant: str


def scenes(dataset: DatasetPlan) -> list[Scene]:
    """Return the scenes of a dataset, each with its first variant."""
    first: dict[str, str] = {}
    for variant in dataset.variants:
        first.setdefault(variant.scene.digest, variant.variant)
    return [Scene(scene, first[scene.digest]) for scene in simulations(dataset)]


def short(value: object, decimals: int = 3) -> object:
    """Return a JSON value with fewer decimals."""
    if isinstance(value, float):
        rounded = round(value, decimals)
        return int(rounded) if rounded.is_integer() else rounded
    if isinstance(value, dict):
        return {key: short(item, decimals) for key, item in value.items()}
    if isinstance(value, list):
        return [short(item, decimals) for item in value]
    return value


def labels(frame: LabelledFrame) -> dict[str, object]:
    """Return the labels of a frame: every key of its objects but boxes that follow from others."""
    objects = [{key: short(item) for key, item in row.items() if key not in _LEFT_OUT} for row in frame["objects"]]
    return {"frame": frame["frame"], "time": short(frame["time"]), "objects": objects}


def pose(calibration: Calibration) -> list[float]:
    """Return position, metres, and heading, degrees, of a camera: x, y, z, yaw."""
    rows = calibration["camera_to_world"]
    yaw = math.degrees(math.atan2(rows[1][2], rows[0][2]))
    return [round(value, 2) for value in (rows[0][3], rows[1][3], rows[2][3], yaw)]


def patches(body: bytes) -> list[dict[str, object]]:
    """Return the patches of a frame from its file.

    Raises:
        ValueError: The file is damaged.
    """
    rows = decode(body, FrameTruth)["patches"]
    return [{key: short(value) for key, value in row.items() if key != "homography"} for row in rows]


def events(body: bytes) -> list[list[object]]:
    """Return the rows of an `events.csv` in the page's order of columns.

    Raises:
        ValueError: A row lacks a column, or a frame is no number.
    """
    try:
        rows = csv.DictReader(io.StringIO(body.decode(), newline=""), strict=True)
        return [[int(row[key]) if "frame" in key else row[key] for key in _EVENT] for row in rows]
    except (csv.Error, KeyError, TypeError) as error:
        raise ValueError(f"events.csv is damaged: {error}") from None


@dataclass
class Paths:
    """The actors of a scene and where they go, from its `tracks.csv`."""

    frames: int
    actors: list[tuple[str, int, float, float]] = field(default_factory=list)  # name, instance, length, width
    paths: list[list[list[float] | None]] = field(default_factory=list)  # by actor; None: outside of the scene
    low: list[float] = field(default_factory=lambda: [math.inf, math.inf])
    high: list[float] = field(default_factory=lambda: [-math.inf, -math.inf])

    def read(self, file: BinaryIO) -> Iterator[list[list[float] | None]]:
        """Yield each frame: x, y and heading, degrees, of every actor; None for one outside of the scene.

        Raises:
            ValueError: The file is damaged.
        """
        every = max(1, self.frames // _PATH_POINTS)
        try:
            with io.TextIOWrapper(file, "utf-8", newline="") as text:
                rows = csv.reader(text, strict=True)
                columns = {name: number for number, name in enumerate(next(rows))}
                order = [columns["frame"], columns["actor"], columns["instance"], columns["present"]]
                order += [columns["x"], columns["y"], columns["yaw"]]
                size = [columns[key] for key in ("length", "width")]
                now, found = 0, list[list[float] | None]()
                for row in rows:
                    frame, name, instance, present, x, y, yaw = (row[number] for number in order)
                    if int(frame) != now:
                        yield found
                        now, found = int(frame), []
                    if now == 0:
                        length, width = (round(float(row[n]), 2) for n in size)
                        self.actors.append((name, int(instance), length, width))
                        self.paths.append([])
                    point = [round(float(x), 2), round(float(y), 2)] if present == "1" else None
                    self._include(point)
                    if now % every == 0 or now == self.frames - 1:
                        self.paths[len(found)].append(point)
                    found.append(None if point is None else [*point, round(float(yaw), 1)])
                yield found
        except (csv.Error, KeyError, IndexError, StopIteration) as error:
            raise ValueError(f"tracks.csv is damaged: {error}") from None

    def _include(self, point: list[float] | None) -> None:
        if point is not None:
            self.low = [min(a, b) for a, b in zip(self.low, point, strict=True)]
            self.high = [max(a, b) for a, b in zip(self.high, point, strict=True)]

    def document(self) -> dict[str, object]:
        """Return actors and paths."""
        return {"actors": self.actors, "paths": self.paths}


def ground(scene: Scene, paths: Paths, dataset: DatasetPlan) -> tuple[bytes, Box]:
    """Return a PNG of the town where actors and cameras are, and what it shows: x0, y0, x1, y1, metres."""
    canvas = ground_canvas(scene, paths, dataset)
    return codecs.png(np.asarray(canvas.finished()), level=6), canvas.box


def ground_canvas(scene: Scene, paths: Paths, dataset: DatasetPlan) -> Canvas:
    """Return a canvas with the town where actors and cameras are; `paths` has read all frames."""
    fixed = [
        (sensor.poses[0].x, sensor.poses[0].y)
        for variant in dataset.variants
        if variant.scene.digest == scene.plan.digest
        for sensor in variant.rig.sensors
        if sensor.on is None
    ]
    points = [*fixed, *((p[0], p[1]) for p in (paths.low, paths.high) if math.isfinite(p[0]))] or [(0.0, 0.0)]
    ends = []
    for axis in (0, 1):
        low, high = (edge(point[axis] for point in points) for edge in (min, max))
        low, high = low - _MAP_MARGIN, high + _MAP_MARGIN
        if high - low > _MAP_EXTENT:
            middle = sum(point[axis] for point in fixed or points) / len(fixed or points)
            low, high = max(low, middle - _MAP_EXTENT / 2), min(high, middle + _MAP_EXTENT / 2)
        ends.append((math.floor(low), math.ceil(high)))
    box = (float(ends[0][0]), float(ends[1][0]), float(ends[0][1]), float(ends[1][1]))
    return town_canvas(scene.plan.town, box, _MAP_SIDE)


def overview(dataset: DatasetPlan, seen: Sequence[View], events: Sequence[int]) -> dict[str, object]:
    """Return what the page needs of variants, views, scenes and modalities.

    Args:
        dataset: The plan.
        seen: Its views.
        events: The number of the file with the events of each variant.
    """
    homes = {(place, view.sensor.name): n for n, view in enumerate(seen) for place in view.variants}
    numbers = {scene.digest: n for n, scene in enumerate(simulations(dataset))}
    variants = [
        {
            "name": variant.variant,
            "folder": layout.folder(variant.variant),
            "scene": numbers[variant.scene.digest],
            "views": [homes[place, sensor.name] for sensor in variant.rig.sensors],
            "events": events[place],
            "patches": bool(variant.appearance.patches),
        }
        for place, variant in enumerate(dataset.variants)
    ]
    return {
        "recipe": dataset.recipe,
        "description": dataset.description,
        "variants": variants,
        "views": [_view(view) for view in seen],
        "scenes": [
            {"town": scene.town.name, "fps": scene.clock.fps, "frames": scene.clock.frames}
            for scene in simulations(dataset)
        ],
        "modalities": _modalities(dataset, {name for view in seen for name in view.sensor.capture}),
        "categories": {str(tag): name for tag, name in CATEGORIES.items()},
    }


def _view(view: View) -> dict[str, object]:
    camera = view.sensor.camera
    return {
        "sensor": view.sensor.name,
        "folder": layout.folder(view.sensor.name),
        "on": view.sensor.on,
        "capture": list(view.sensor.capture),
        "interval": view.sensor.interval,
        "frames": len(view.frames),
        "width": camera.width,
        "height": camera.height,
        "fov": camera.fov,
        "lens": [camera.lens_k, camera.lens_kcube],
    }


def _modalities(dataset: DatasetPlan, captured: Iterable[str]) -> Mapping[str, object]:
    """Return how a page shows each captured modality, in the order of the registry."""
    there, found = set(captured), {}
    for name in MODALITIES:
        if name in there:
            screen, ending = declared(name).screen, form_of(name, dataset.forms).ending
            found[name] = {
                "ending": ending,
                "kind": screen.kind if ending == "png" or screen.kind == "masks" else "file",
                "colours": screen.colours,
                "names": screen.names,
                "weights": screen.weights,
                "unit": screen.unit,
            }
    return found
