"""Writes what depends on all frames: annotation files, plans, contact sheets, README and manifest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FileRow, Video, by_variant
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.build.workspace import Workspace
from recipe_runtime.core import layout
from recipe_runtime.core.interfaces import Progress
from recipe_runtime.core.timings import Timings
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset.assembly import FrameAssembly
from recipe_runtime.dataset.events import distinct_events
from recipe_runtime.dataset.manifest import file_row, manifest_text
from recipe_runtime.dataset.schedule import simulations, views
from recipe_runtime.dataset.text_files import Text, annotation_texts, closing_texts, labels_text, with_labels
from recipe_runtime.dataset.tracks import tracks_csv
from recipe_runtime.report.contact_sheets import contact_sheet, overlay_sheet
from recipe_runtime.report.page import page_files

Task = Callable[[], dict[str, FileRow]]


@dataclass
class Finisher:
    """Writes the files that complete a dataset after all of its frames are rendered."""

    dataset: DatasetPlan
    harvest: FrameAssembly
    work: Workspace
    progress: Progress
    timings: Timings
    sources: RecipeFiles | None = None
    videos: list[Video] = field(init=False)
    identity: str = field(init=False)
    labels: dict[str, tuple[str, list[str]]] = field(init=False)  # view -> text, and the files that get it

    def __post_init__(self) -> None:
        self.identity = self.harvest.identity()
        homes = {(i, view.sensor.name): view.key for view in views(self.dataset) for i in view.variants}
        places = {variant.variant: index for index, variant in enumerate(self.dataset.variants)}
        self.videos, self.labels = [], {}
        seen: dict[str, Video] = {}
        for video in self.harvest.videos():
            home = homes[places[video.variant], video.sensor.name]
            if home not in seen:
                text = labels_text(video)
                seen[home], self.labels[home] = with_labels(video, text), (text, [])
            self.videos.append(replace(video, frames=seen[home].frames))
            self.labels[home][1].append(layout.labels_file(video.variant, video.sensor.name))

    def finish(self, trace: Callable[[ScenePlan], Trace]) -> dict[str, FileRow]:
        """Write all files, and return the manifest rows of every file of the dataset, by path."""
        files = self.harvest.files()
        known = self.dataset, self.identity, self.videos
        annotate: list[Task] = [self._labels, *self._texts(annotation_texts(*known)), lambda: self._motion(trace)]
        place = layout.recipe_file(self.dataset.recipe) if self.sources else None
        rest = [*self._texts(closing_texts(*known, place)), *self._sheets(), self._recipe, lambda: self._page(place)]
        for stage, tasks in (("annotate", annotate), ("finish", rest)):
            self.progress(stage, 0, len(tasks))
            for done, task in enumerate(tasks, start=1):
                with self.timings(stage):
                    files.update(task())
                self.progress(stage, done, len(tasks))
        with self.timings("finish"):
            return files | self._write(layout.MANIFEST, manifest_text(self.dataset, self.harvest, files, place))

    def _write(self, path: str, content: str | bytes) -> dict[str, FileRow]:
        body = content.encode() if isinstance(content, str) else content
        self.work.write(path, body)
        return {path: file_row(body)}

    def _texts(self, texts: Iterable[Text]) -> Iterator[Task]:
        for path, make in texts:
            yield lambda path=path, make=make: self._write_pieces(path, make())  # type: ignore[misc]

    def _write_pieces(self, path: str, pieces: Iterable[str]) -> dict[str, FileRow]:
        return {path: self.work.write_pieces(path, (piece.encode() for piece in pieces))}

    def _labels(self) -> dict[str, FileRow]:
        """Write one `labels.jsonl` per view, linked into the folder of each of its variants."""
        files: dict[str, FileRow] = {}
        for text, (first, *others) in self.labels.values():
            files |= self._linked(first, others, text)
        return files

    def _linked(self, first: str, others: list[str], content: str) -> dict[str, FileRow]:
        return self._shared(self._write(first, content)[first], first, others)

    def _shared(self, row: FileRow, first: str, others: list[str]) -> dict[str, FileRow]:
        for path in others:
            self.work.link(first, path)
        return dict.fromkeys([first, *others], row)

    def _motion(self, trace: Callable[[ScenePlan], Trace]) -> dict[str, FileRow]:
        """Write `tracks.csv` and `events.csv`, each linked into the folder of every variant with the same content."""
        files: dict[str, FileRow] = {}
        videos = by_variant(self.videos)
        for scene in simulations(self.dataset):
            names = [v.variant for v in self.dataset.variants if v.scene.digest == scene.digest]
            first, *others = (layout.tracks_file(name) for name in names)
            motion = trace(scene)
            files |= self._shared(self.work.write_pieces(first, tracks_csv(scene, motion)), first, others)
            for same, pieces in distinct_events(scene, motion, {name: videos.get(name, []) for name in names}):
                first, *others = (layout.events_file(name) for name in same)
                files |= self._shared(self.work.write_pieces(first, pieces), first, others)
        return files

    def _recipe(self) -> dict[str, FileRow]:
        """Write the pack of the recipe."""
        name = self.dataset.recipe
        return self._write(layout.recipe_file(name), self.sources.pack(name, self.identity)) if self.sources else {}

    def _page(self, place: str | None) -> dict[str, FileRow]:
        """Write the page, from files that are written; `place` is that of the recipe's pack."""
        known = self.dataset, self.identity, self.videos, self.work.dataset
        return {path: self.work.write_pieces(path, pieces) for path, pieces in page_files(*known, place)}

    def _sheets(self) -> Iterator[Task]:
        title = self.dataset.recipe
        yield lambda: self._write(layout.CONTACT_SHEET, contact_sheet(title, self.videos, self._picture))
        yield lambda: self._write(layout.OVERLAY_SHEET, overlay_sheet(title, self.videos, self._picture))

    def _picture(self, video: Video, frame: int) -> Path:
        path = layout.frame_file(video.variant, video.sensor.name, "rgb", frame, self.dataset.forms)
        return self.work.dataset / path
