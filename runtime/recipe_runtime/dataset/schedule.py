"""Divides the work of a dataset into views and shards, so that equal work is done once.

Variants that share a scene share its simulation. Variants whose scene and sensor are equal share a view: its frames
are observed once, their labels are one set of files, and only colours are computed for each appearance. A shard is a
few frames of one view; shards may be processed in any order, by any number of workers, with the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from recipe_compiler.ir.canonical import digest
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan, SensorPlan

SHARD_FRAMES = 5


@dataclass(frozen=True)
class View:
    """One sensor in one scene, and the variants with equal observations, by their indices in the plan."""

    key: str
    scene: ScenePlan
    sensor: SensorPlan
    variants: tuple[int, ...]

    @property
    def frames(self) -> range:
        """The numbers of the frames that the sensor takes."""
        return self.sensor.frames(self.scene.clock.frames)


@dataclass(frozen=True)
class Shard:
    """Some frames of one view (by its index among the plan's views), for some of its variants."""

    view: int
    frames: tuple[int, ...]
    variants: tuple[int, ...]

    @property
    def pictures(self) -> int:
        """Number of frames of the dataset that the shard renders: each variant has its own."""
        return len(self.frames) * len(self.variants)


@dataclass(frozen=True)
class _Group:
    """The scene and the sensor of a view, and the variants found so far."""

    scene: ScenePlan
    sensor: SensorPlan
    variants: list[int] = field(default_factory=list)


def views(dataset: DatasetPlan) -> list[View]:
    """Return every view of a dataset, grouped by scene, in the order of the first variants."""
    keys: dict[tuple[str, str], tuple[str, ...]] = {}  # of all sensors, by the digests of scene and rig
    groups: dict[tuple[str, str], _Group] = {}
    for index, variant in enumerate(dataset.variants):
        scene, rig = variant.scene.digest, variant.rig
        if (scene, rig.digest) not in keys:
            keys[scene, rig.digest] = tuple(_view_key(scene, sensor) for sensor in rig.sensors)
        for key, sensor in zip(keys[scene, rig.digest], rig.sensors, strict=True):
            groups.setdefault((scene, key), _Group(variant.scene, sensor)).variants.append(index)
    order = {scene: number for number, scene in enumerate(dict.fromkeys(scene for scene, _ in groups))}
    by_scene = sorted(groups.items(), key=lambda item: order[item[0][0]])
    return [View(key, group.scene, group.sensor, tuple(group.variants)) for (_, key), group in by_scene]


def _view_key(scene: str, sensor: SensorPlan) -> str:
    return digest("view/1", [scene, sensor.document()])


def all_shards(dataset: DatasetPlan, size: int = SHARD_FRAMES) -> list[Shard]:
    """Return shards of `size` frames that cover every frame that the sensor of each view takes."""
    shards = []
    for index, view in enumerate(views(dataset)):
        frames = view.frames
        shards += [Shard(index, tuple(frames[k : k + size]), view.variants) for k in range(0, len(frames), size)]
    return shards


def chosen_shards(dataset: DatasetPlan, chosen: Iterable[tuple[str, str, int]]) -> list[Shard]:
    """Return shards of chosen frames only, given as (variant, sensor, frame)."""
    places = {variant.variant: index for index, variant in enumerate(dataset.variants)}
    homes = {(v, view.sensor.name): n for n, view in enumerate(views(dataset)) for v in view.variants}
    wanted: dict[tuple[int, int], set[int]] = {}
    for variant, sensor, frame in chosen:
        place = places[variant]
        wanted.setdefault((homes[place, sensor], frame), set()).add(place)
    shards: list[Shard] = []
    for (view, frame), found in sorted(wanted.items()):
        variants, last = tuple(sorted(found)), shards[-1] if shards else None
        if last and (last.view, last.variants) == (view, variants) and len(last.frames) < SHARD_FRAMES:
            shards[-1] = Shard(view, (*last.frames, frame), variants)
        else:
            shards.append(Shard(view, (frame,), variants))
    return shards


def simulations(dataset: DatasetPlan) -> list[ScenePlan]:
    """Return every distinct scene of a dataset."""
    return list({v.scene.digest: v.scene for v in dataset.variants}.values())


@dataclass(frozen=True)
class ReusedFrames:
    """The frames of a view that are reused, for some of its variants."""

    variants: tuple[int, ...]
    frames: frozenset[int]


def missing_shards(shards: Sequence[Shard], reused: Mapping[int, ReusedFrames]) -> list[Shard]:
    """Return shards of the frames that are not reused; `reused` is by the number of the view."""
    found = []
    for shard in shards:
        there = reused.get(shard.view, ReusedFrames((), frozenset()))
        known = tuple(k for k in shard.frames if k in there.frames)
        other = tuple(k for k in shard.frames if k not in there.frames)
        rest = tuple(n for n in shard.variants if n not in there.variants)
        parts = (known, rest), (other, shard.variants)
        found += [Shard(shard.view, frames, variants) for frames, variants in parts if frames and variants]
    return found
