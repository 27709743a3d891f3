"""Assemble the frame records of workers into videos, and compute the dataset's identity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import FileRow, FrameRecord, Video
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.schedule import Shard, views


@dataclass
class FrameAssembly:
    """The frame records of a dataset, by view and frame, in any order of arrival."""

    dataset: DatasetPlan
    traces: dict[str, str] = field(default_factory=dict)  # scene digest -> trace digest
    records: dict[tuple[int, int], FrameRecord] = field(default_factory=dict)

    def add(self, shard: Shard, records: Sequence[FrameRecord]) -> None:
        """Add a finished shard. Shards with other variants of the same frame have equal shared parts."""
        for record in records:
            place = shard.view, record["frame"]
            there = self.records.get(place)
            if there is not None:
                record = {
                    **record,
                    "rgb": {**there["rgb"], **record["rgb"]},
                    "files": {**there["files"], **record["files"]},
                }
            self.records[place] = record

    def videos(self) -> list[Video]:
        """Return all videos, variants and sensors in the plan's order."""
        homes = self._homes()
        found = []
        for index, variant in enumerate(self.dataset.variants):
            clock = variant.scene.clock
            for sensor in variant.rig.sensors:
                view = homes[index, sensor.name]
                frames = tuple(self.records[view, k] for k in sensor.frames(clock.frames) if (view, k) in self.records)
                found.append(Video(variant.variant, variant.scene.digest, sensor, clock.fps, frames))
        return found

    def files(self) -> dict[str, FileRow]:
        """Return the size and SHA-256 of every file that the workers wrote."""
        return {path: row for record in self.records.values() for path, row in record["files"].items()}

    def pixels(self, video: Video) -> dict[str, dict[int, str]]:
        """Return the digests of a video's frames: modality -> frame -> digest.

        `labels` is the digest of the label records.
        """
        found: dict[str, dict[int, str]] = {}
        for record in video.frames:
            for modality, value in record["digests"].items():
                found.setdefault(modality, {})[record["frame"]] = value
            if video.variant in record["rgb"]:
                found.setdefault("rgb", {})[record["frame"]] = record["rgb"][video.variant]
        return found

    def identity(self) -> str:
        """Return the dataset's identity, which is that of its lockfile, computed from the same rows."""
        lock, seen = digests.bare(self.dataset, "", {}), views(self.dataset)
        frames = {
            key: value
            for (view, _), record in self.records.items()
            for key, value in digests.frame_rows(self.dataset, seen[view], record)
        }
        return replace(lock, traces=self.traces, frames=frames).identity

    def _homes(self) -> dict[tuple[int, str], int]:
        return {(v, view.sensor.name): n for n, view in enumerate(views(self.dataset)) for v in view.variants}
