"""Rows of digests for plans, Traces and frames, shared by `recipe build`, `recipe lock` and `recipe verify`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from recipe_compiler.ir.lockfile import BodyMotion, FrameKey, Lockfile, VariantRow, skeleton
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan

from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import STAGES, host_versions
from recipe_runtime.dataset.schedule import View

CHECKPOINTS = 64  # most checkpoints per body; they locate the frame at which two motions diverge
CHECKPOINT_DIGITS = 8


def bare(plan: DatasetPlan, source: str, files: dict[str, str]) -> Lockfile:
    """Return the lockfile of a plan, without traces, bodies and frames."""
    return skeleton(plan, source, files, host_versions(), STAGES)


def with_rows(
    bare_lock: Lockfile, traces: dict[str, Trace], scenes: list[ScenePlan], frames: dict[FrameKey, str]
) -> Lockfile:
    """Return the same lockfile with its traces, bodies and frames filled in."""
    bodies = {
        (scene.digest, actor): motion
        for scene in scenes
        for actor, motion in body_motions(traces[scene.digest]).items()
    }
    return replace(bare_lock, traces={key: trace.digest for key, trace in traces.items()}, bodies=bodies, frames=frames)


def frame_rows(plan: DatasetPlan, view: View, record: FrameRecord) -> Iterator[tuple[FrameKey, str]]:
    """Return the rows of one frame of one view: labels and depth once per observation, colours once per scenario."""
    by_name = {plan.variants[i].variant: plan.variants[i] for i in view.variants}
    for scenario in by_name.values():
        key = VariantRow(scenario.scene.digest, scenario.rig.digest, scenario.appearance.digest)
        for modality, value in record["digests"].items():
            yield (key.frame_key(modality), view.sensor.name, modality, record["frame"]), value
        if scenario.variant in record["rgb"]:
            yield (key.frame_key("rgb"), view.sensor.name, "rgb", record["frame"]), record["rgb"][scenario.variant]


def frame_keys(plan: DatasetPlan) -> Iterator[FrameKey]:
    """Return the key of every row that `frame_rows` yields for a whole dataset."""
    for v in plan.variants:
        row = VariantRow(v.scene.digest, v.rig.digest, v.appearance.digest)
        for sensor in v.rig.sensors:
            for modality in (*sensor.capture, "labels"):
                key = row.frame_key(modality)
                yield from ((key, sensor.name, modality, frame) for frame in sensor.frames(v.scene.clock.frames))


def body_motions(trace: Trace) -> dict[str, BodyMotion]:
    """Return the digest of each actor's motion, and short digests of its prefixes."""
    stride = -(-trace.frames // CHECKPOINTS)
    digests = trace.prefix_digests([*range(stride, trace.frames + 1, stride), trace.frames])
    return {
        actor: BodyMotion(whole, stride, tuple(point[:CHECKPOINT_DIGITS] for point in points))
        for actor, (*points, whole) in digests.items()
    }


def first_divergence(locked: BodyMotion, ours: BodyMotion) -> tuple[int, int] | None:
    """Return the frames [first, last] within which two motions diverge; None if they are equal.

    `last` is -1 if the checkpoints do not bound it.
    """
    if locked == ours:
        return None
    if locked.stride == ours.stride:
        for index, (a, b) in enumerate(zip(locked.checkpoints, ours.checkpoints, strict=False)):
            if a != b:
                return index * ours.stride, (index + 1) * ours.stride - 1
    return len(ours.checkpoints) * ours.stride, -1


def divergence_text(first: int, last: int) -> str:
    """Return the result of `first_divergence` as text."""
    if last < first:
        return f"from frame {first} on"
    return f"at frame {first}" if first == last else f"between frames {first} and {last}"
