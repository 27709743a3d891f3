"""What is written once all frames are known: annotation files and their check, plans, pictures, card, manifest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recipe_compiler.canonical import pretty
from recipe_compiler.errors import RunError
from recipe_compiler.plan import DatasetPlan, ScenePlan

from recipe_runtime import layout
from recipe_runtime.annotate.coco import flat_coco, kwcoco
from recipe_runtime.annotate.mots import mots_lines, seqinfo, seqmap
from recipe_runtime.annotate.validate import problems
from recipe_runtime.engines import Progress
from recipe_runtime.harvest import Harvest, Video
from recipe_runtime.manifest import file_row, manifest_text
from recipe_runtime.report.card import card
from recipe_runtime.report.sheets import contact_sheet, overlay_sheet
from recipe_runtime.schedule import simulations
from recipe_runtime.trace import Trace
from recipe_runtime.tracks import tracks_csv
from recipe_runtime.worker import Stopwatch
from recipe_runtime.workspace import Workspace

FileRow = list[Any]  # size, SHA-256
Task = Callable[[], dict[str, FileRow]]


@dataclass
class Finisher:
    """The end of one build."""

    dataset: DatasetPlan
    harvest: Harvest
    work: Workspace
    progress: Progress
    watch: Stopwatch
    videos: list[Video] = field(init=False)
    identity: str = field(init=False)

    def __post_init__(self) -> None:
        self.videos, self.identity = self.harvest.videos(), self.harvest.identity()

    def finish(self, trace: Callable[[ScenePlan], Trace]) -> set[str]:
        """Write all of it; the paths of every file that belongs to the dataset."""
        files = self.harvest.files()
        annotate = [*self._annotations(), lambda: self._tracks(trace), self._check]
        rest = [*self._plans(), *self._sheets(), self._card]
        for stage, tasks in (("annotate", annotate), ("finish", rest)):
            self.progress(stage, 0, len(tasks))
            for done, task in enumerate(tasks, start=1):
                with self.watch(stage):
                    files.update(task())
                self.progress(stage, done, len(tasks))
        with self.watch("finish"):
            self._write(layout.MANIFEST, manifest_text(self.dataset, self.harvest, files))
        return {*files, layout.MANIFEST}

    def _write(self, path: str, content: str | bytes) -> dict[str, FileRow]:
        body = content.encode() if isinstance(content, str) else content
        self.work.write(path, body)
        return {path: file_row(body)}

    def _text(self, path: str, text: Callable[[], str]) -> Task:
        return lambda: self._write(path, text())

    def _annotations(self) -> Iterator[Task]:
        dataset, identity, videos, kinds = self.dataset, self.identity, self.videos, self.dataset.annotations
        if "kwcoco" in kinds:
            yield self._text(layout.KWCOCO, lambda: kwcoco(dataset, identity, videos))
        if "coco" in kinds:
            yield self._text(layout.coco_file("rgb"), lambda: flat_coco(dataset, identity, videos, "rgb"))
        if "mots_txt" in kinds:
            yield self._mots

    def _mots(self) -> dict[str, FileRow]:
        names = [layout.sequence(video.variant, video.sensor.name) for video in self.videos]
        files = self._write(layout.MOTS_SEQMAP, seqmap(names))
        for name, video in zip(names, self.videos, strict=True):
            camera, frames = video.sensor.camera, [record["objects"] for record in video.frames]
            folder = f"{layout.MOTS_SEQUENCES}/{name}"
            pictures = f"../../../{layout.folder(video.variant)}/{layout.folder(video.sensor.name)}/rgb"
            files |= self._write(f"{folder}/gt/gt.txt", mots_lines(frames, camera.width, camera.height))
            info = seqinfo(name, pictures, video.fps, len(frames), camera.width, camera.height)
            files |= self._write(f"{folder}/seqinfo.ini", info)
        return files

    def _tracks(self, trace: Callable[[ScenePlan], Trace]) -> dict[str, FileRow]:
        """A `tracks.csv` a scene, under the name of each of its variants."""
        files: dict[str, FileRow] = {}
        for scene in simulations(self.dataset):
            names = [v.variant for v in self.dataset.variants if v.scene.digest == scene.digest]
            first, *others = (layout.tracks_file(name) for name in names)
            row = self._write(first, tracks_csv(scene, trace(scene)))[first]
            for path in others:
                self.work.link(first, path)
            files.update(dict.fromkeys([first, *others], row))
        return files

    def _check(self) -> dict[str, FileRow]:
        """RunError if an annotation file does not hold what the pixels say: a fault of ours, never of the recipe."""
        root = self.work.dataset
        for path, start in ((layout.KWCOCO, None), (layout.coco_file("rgb"), root)):
            found = problems(root / path, start) if (root / path).is_file() else []
            if found:
                more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
                raise RunError(f"{path} fails its check, which is a fault of this program: {found[0]}{more}")
        return {}

    def _plans(self) -> Iterator[Task]:
        for variant in self.dataset.variants:
            yield self._text(layout.plan_file(variant.variant), lambda v=variant: pretty(v.document()))  # type: ignore[misc]

    def _sheets(self) -> Iterator[Task]:
        title = self.dataset.recipe
        yield lambda: self._write(layout.CONTACT_SHEET, contact_sheet(title, self.videos, self._picture))
        yield lambda: self._write(layout.OVERLAY_SHEET, overlay_sheet(title, self.videos, self._picture))

    def _card(self) -> dict[str, FileRow]:
        return self._write(layout.CARD, card(self.dataset, self.identity, self.videos))

    def _picture(self, video: Video, frame: int) -> Path:
        path = layout.frame_file(video.variant, video.sensor.name, "rgb", frame, self.dataset.depth)
        return self.work.dataset / path
