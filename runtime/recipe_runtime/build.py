"""A plan to a dataset in a folder.

    simulate   every scene once, kept by digest
    render     shards of frames, by worker processes: observe, annotate, shade, encode, hash, write
    annotate   the files over all frames: kwcoco, COCO, MOTS, tracks, plans
    check      a second look at them
    publish    pictures, card, manifest; then one rename

The bytes do not depend on the count of workers, the order of shards or their size, nor on how often a build was
stopped and taken up again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image
from recipe_compiler.canonical import pretty
from recipe_compiler.errors import InputError, RunError
from recipe_compiler.plan import DatasetPlan, ScenePlan

from recipe_runtime import layout, pool
from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.annotate.coco import flat_coco, kwcoco
from recipe_runtime.annotate.mots import mots_lines, seqinfo, seqmap
from recipe_runtime.annotate.validate import problems
from recipe_runtime.engines import Engines, Progress, real_engines
from recipe_runtime.harvest import Harvest, Video
from recipe_runtime.manifest import file_row, head, is_whole, manifest_text
from recipe_runtime.report.card import card
from recipe_runtime.report.sheets import contact_sheet, overlay_sheet
from recipe_runtime.schedule import SHARD_FRAMES, Shard, all_shards, simulations, views
from recipe_runtime.store import Store, default_cache, link_or_copy
from recipe_runtime.tracks import tracks_csv
from recipe_runtime.worker import Job, Stopwatch
from recipe_runtime.workspace import Workspace, check_out, read_manifest


@dataclass(frozen=True)
class BuildResult:
    """A dataset in its place. `seconds` are summed over workers by stage; `wall` is what a clock shows."""

    path: Path
    identity: str
    manifest: dict[str, Any]
    built: bool  # False: it was there already, whole
    resumed: int = 0  # shards taken over from an earlier build
    shards: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    wall: float = 0.0


def build(
    dataset: DatasetPlan,
    out: Path,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    cache: Path | None = None,
    device: str = "cpu",
    engines: Engines | None = None,
    shard_frames: int = SHARD_FRAMES,
) -> BuildResult:
    """Make the dataset in `out`, with so many worker processes (0: in this one).

    Returns at once if it is there, whole. Replaces another dataset of ours; InputError if `out` holds anything else.
    RunError if the host fails: what is done is kept, and the next build goes on from there.
    """
    start, out = time.perf_counter(), out.absolute()
    check_plan(dataset)
    check_out(out)
    manifest = read_manifest(out)
    if manifest is not None and is_whole(manifest, dataset, out):
        return BuildResult(out, manifest["identity"], manifest, built=False)
    studio = _Studio(dataset, engines or real_engines(), device, cache or default_cache(), progress or _silence)
    with Workspace(out, head(dataset)) as work:
        harvest = studio.simulate()
        resumed, shards = studio.render(work, harvest, workers, shard_frames)
        studio.finish(work, harvest)
        work.publish()
    manifest = read_manifest(out)
    assert manifest is not None
    seconds, wall = studio.watch.seconds, time.perf_counter() - start
    return BuildResult(out, manifest["identity"], manifest, True, resumed, shards, seconds, wall)


def check_plan(dataset: DatasetPlan) -> None:
    """InputError for a plan whose dataset could not be written or annotated."""
    layout.check_names(dataset)
    for scene in simulations(dataset):
        for actor in scene.actors:
            if actor.tag not in CATEGORIES:
                raise InputError(f"actor {actor.name}: tag {actor.tag} is none that is annotated: {sorted(CATEGORIES)}")


@dataclass
class _Studio:
    """The stages of one build."""

    dataset: DatasetPlan
    engines: Engines
    device: str
    cache: Path
    progress: Progress
    watch: Stopwatch = field(default_factory=Stopwatch)

    def simulate(self) -> Harvest:
        """Simulate every scene, two at once; their traces are in the store then."""
        wanted, harvest = simulations(self.dataset), Harvest(self.dataset)
        self.progress("simulate", 0, len(wanted))
        with self.watch("simulate"), ThreadPoolExecutor(max_workers=2) as threads:
            tasks = {threads.submit(self._trace_digest, scene): scene for scene in wanted}
            try:
                for done, task in enumerate(as_completed(tasks), start=1):
                    harvest.traces[tasks[task].digest] = task.result()
                    self.progress("simulate", done, len(wanted))
            except BaseException:
                threads.shutdown(wait=False, cancel_futures=True)
                raise
        return harvest

    def _trace_digest(self, scene: ScenePlan) -> str:
        return Store(self.cache).trace(scene, lambda: self.engines.simulate(scene)).digest

    def render(self, work: Workspace, harvest: Harvest, workers: int, size: int) -> tuple[int, int]:
        """Do the shards that no earlier build has finished: how many were, and how many there are."""
        shards, seen = all_shards(self.dataset, size), views(self.dataset)
        todo = []
        for shard in shards:
            records = work.finished(shard, seen[shard.view])
            if records is None:
                todo.append(shard)
            else:
                harvest.add(shard, records)

        def done(shard: Shard, records: list[dict[str, Any]]) -> None:
            work.keep(shard, seen[shard.view], records)
            harvest.add(shard, records)

        total, so_far = sum(len(s.frames) * len(s.variants) for s in todo), 0

        def tick(count: int) -> None:
            nonlocal so_far
            so_far += count
            self.progress("render", so_far, total)

        self.progress("render", 0, total)
        job = Job(self.dataset, self.engines, self.device, self.cache, work.dataset)
        for stage, seconds in pool.run(job, todo, workers, done, tick).items():
            self.watch.add(stage, seconds)
        return len(shards) - len(todo), len(shards)

    def finish(self, work: Workspace, harvest: Harvest) -> None:
        """Everything that is written once all frames are known."""
        files, videos = harvest.files(), harvest.videos()
        identity = harvest.identity()
        texts = [*self._annotations(identity, videos), *self._plans()]
        steps = len(texts) + 4
        with self._step("annotate", steps) as step:
            for path, text in texts:
                files[path] = _write(work, path, text())
                step()
            files.update(self._tracks(work))
            step()
            self._check(work)
            step()
            for path, draw in (
                (layout.CONTACT_SHEET, contact_sheet),
                (layout.OVERLAY_SHEET, overlay_sheet),
            ):
                body = draw(self.dataset.recipe, videos, lambda v, k: self._picture(work, v, k))
                work.write(path, body)
                files[path] = file_row(body)
                step()
            files[layout.CARD] = _write(work, layout.CARD, card(self.dataset, identity, videos))
            _write(work, layout.MANIFEST, manifest_text(self.dataset, harvest, files))

    def _annotations(self, identity: str, videos: list[Video]) -> Iterator[tuple[str, Callable[[], str]]]:
        kinds = self.dataset.annotations
        if "kwcoco" in kinds:
            yield layout.KWCOCO, lambda: kwcoco(self.dataset, identity, videos)
        if "coco" in kinds:
            yield layout.coco_file("rgb"), lambda: flat_coco(self.dataset, identity, videos, "rgb")
        if "mots_txt" in kinds:
            names = [layout.sequence(v.variant, v.sensor.name) for v in videos]
            yield layout.MOTS_SEQMAP, lambda: seqmap(names)
            for name, video in zip(names, videos, strict=True):
                yield f"{layout.MOTS_SEQUENCES}/{name}/gt/gt.txt", lambda v=video: _mots(v)  # type: ignore[misc]
                yield f"{layout.MOTS_SEQUENCES}/{name}/seqinfo.ini", lambda v=video, n=name: _seqinfo(n, v)  # type: ignore[misc]

    def _plans(self) -> Iterator[tuple[str, Callable[[], str]]]:
        for variant in self.dataset.variants:
            yield layout.plan_file(variant.variant), lambda v=variant: pretty(v.document())  # type: ignore[misc]

    def _tracks(self, work: Workspace) -> dict[str, list[Any]]:
        """A `tracks.csv` a scene, under the name of each of its variants."""
        files: dict[str, list[Any]] = {}
        for scene in simulations(self.dataset):
            trace = Store(self.cache).trace(scene, lambda s=scene: self.engines.simulate(s))  # type: ignore[misc]
            names = [v.variant for v in self.dataset.variants if v.scene.digest == scene.digest]
            paths = [layout.tracks_file(name) for name in names]
            row = _write(work, paths[0], tracks_csv(scene, trace))
            for path in paths[1:]:
                link_or_copy(work.dataset / paths[0], work.dataset / path)
            files.update(dict.fromkeys(paths, row))
        return files

    def _check(self, work: Workspace) -> None:
        """RunError if an annotation file does not hold what the pixels say: a fault of ours, never of the recipe."""
        for path, root in ((layout.KWCOCO, None), (layout.coco_file("rgb"), work.dataset)):
            if (work.dataset / path).is_file():
                found = problems(work.dataset / path, root)
                if found:
                    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
                    raise RunError(
                        f"{path} does not pass its own check, which is a fault of this program: {found[0]}{more}"
                    )

    def _picture(self, work: Workspace, video: Video, frame: int) -> Image.Image:
        path = layout.frame_file(video.variant, video.sensor.name, "rgb", frame, self.dataset.depth)
        with Image.open(work.dataset / path) as picture:
            colour: Image.Image = picture.convert("RGB")
        return colour

    @contextmanager
    def _step(self, stage: str, total: int) -> Iterator[Callable[[], None]]:
        done = 0

        def step() -> None:
            nonlocal done
            done += 1
            self.progress(stage, done, total)

        self.progress(stage, 0, total)
        with self.watch("finish"):
            yield step


def _write(work: Workspace, path: str, text: str) -> list[Any]:
    body = text.encode()
    work.write(path, body)
    return file_row(body)


def _mots(video: Video) -> str:
    camera = video.sensor.camera
    return mots_lines([record["objects"] for record in video.frames], camera.width, camera.height)


def _seqinfo(name: str, video: Video) -> str:
    camera = video.sensor.camera
    directory = f"../../../{layout.folder(video.variant)}/{layout.folder(video.sensor.name)}/rgb"
    return seqinfo(name, directory, video.fps, len(video.frames), camera.width, camera.height)


def _silence(stage: str, done: int, total: int) -> None:
    """Progress that nobody watches."""
