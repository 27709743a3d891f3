"""Compares a scene's locked motion with this host's, and decides which differences of frames it may excuse.

A lockfile or manifest is untrusted, and so is the digest of its motion. A claim of other motion alone excuses
little: a frame may differ only from the frame on in which the recorded motion of a body differs, and its colours only
if such motion is recorded at all, as rows of bodies in a lockfile or as the tracks of a dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_compiler.ir.plurals import count, form

from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset import digests
from recipe_runtime.dataset.reader import Dataset, tracks_difference
from recipe_runtime.frames.engines import Engines
from recipe_runtime.verify.excuses import release_excuse
from recipe_runtime.verify.sampling import draw_scenes
from recipe_runtime.verify.verdict import Difference

CONTRADICTION = "the motion of every body agrees, and the digest of the whole does not: the lockfile contradicts itself"


@dataclass(frozen=True)
class OtherMotion:
    """Motion of this host that differs from the locked motion. Frames are rendered from it and compared."""

    trace: Trace
    message: str  # the first body that differs, and the frames
    agreed: int = 0  # number of frames at the start with equal motion, according to the locked bodies; 0 if unknown
    recorded: bool = False  # whether the locked motion of some body is recorded, and differs from this host's
    contradiction: bool = False  # according to the lockfile's rows, no body differs
    reason: str = ""  # why this host's motion may differ

    def excuses(self, modality: str, frame: int) -> bool:
        """Return whether a frame may differ whose first difference is in a given modality.

        If depth, instances or labels differ, the frame itself shows other motion. If they agree, colours may differ by
        the shadow, light or reflection of a body outside the picture, or by motion below the resolution of the labels.
        Nothing in the frame shows that, so the motion must be recorded.
        """
        return frame >= self.agreed and (modality != "rgb" or self.recorded)


def motion_difference(lock: Lockfile, scene: ScenePlan, trace: Trace) -> OtherMotion:
    """Compare the locked motion of a scene with a Trace that has another digest."""
    ours, divergences = digests.body_motions(trace), []
    locked = {actor: lock.bodies.get((scene.digest, actor)) for actor in ours}
    if all(locked[actor] == motion for actor, motion in ours.items()):
        return OtherMotion(trace, CONTRADICTION, contradiction=True)
    for actor, motion in ours.items():
        row = locked[actor]
        at = digests.first_divergence(row, motion) if row else None
        if at:
            divergences.append((at[0], actor, at[1]))
    if not divergences:
        return OtherMotion(trace, "the motion differs from the one that was locked")
    first, actor, last = min(divergences)
    where = f"{digests.divergence_text(first, last)} (from step {first * scene.clock.steps_per_frame})"
    bodies = f"{len(divergences)} of {count(len(ours), 'body', 'bodies')} {form(len(divergences), 'differs', 'differ')}"
    agreed = 0 if None in locked.values() else max(0, first - 1)
    return OtherMotion(trace, f"body {actor} diverges {where}; {bodies}", agreed, recorded=True)


def body_differences(
    plan: DatasetPlan, lock: Lockfile, trace_of: Callable[[ScenePlan], Trace | None]
) -> list[Difference]:
    """Compare a lockfile's rows of bodies with the Traces that it lists.

    Args:
        plan: the plan.
        lock: the lockfile.
        trace_of: returns a scene's Trace, or None. Scenes without the locked Trace are left out.
    """
    found = []
    for digest, scene in {v.scene.digest: v.scene for v in plan.variants}.items() if lock.bodies else ():
        trace = trace_of(scene)
        if trace is None or trace.digest != lock.traces.get(digest):
            continue
        for actor, motion in digests.body_motions(trace).items():
            if lock.bodies.get((digest, actor), motion) != motion:
                found.append(Difference("trace", f"body {actor}: its row contradicts the trace's"))
                break
    return found


def matching_traces(
    plan: DatasetPlan, lock: Lockfile, traces: Mapping[str, Trace], engines: Engines
) -> tuple[list[Difference], dict[str, Trace]]:
    """Separate locked Traces, by scene digest, that cannot be rendered: anyone may have written them.

    Returns:
        A difference for each of these, and the other Traces.
    """
    scenes = {variant.scene.digest: variant.scene for variant in plan.variants}
    unfit = [digest for digest, t in traces.items() if digest in scenes and not _fits(t, scenes[digest], engines)]
    message = "the locked Trace of scene {} has other frames, actors or parts than the scene, or no valid rotations"
    found = [Difference("trace", message.format(digest[:16]), release_excuse("trace", lock)) for digest in unfit]
    return found, {digest: trace for digest, trace in traces.items() if digest not in unfit}


def _fits(trace: Trace, scene: ScenePlan, engines: Engines) -> bool:
    """Return whether a Trace has the frames, actors and parts of a scene, and rotations."""
    if trace.frames != scene.clock.frames or trace.actors != tuple(actor.name for actor in scene.actors):
        return False
    return trace.has_unit_rotations() and trace.parts == tuple(
        f"{body.name}/{part}" for body in engines.actors(scene) for part, _ in body.parts
    )


def scenes_to_simulate(
    plan: DatasetPlan, lock: Lockfile, drawn: Collection[str], nonce: int
) -> tuple[dict[str, ScenePlan], list[str]]:
    """Choose the scenes whose motion is compared with the locked motion; none if no frame is.

    Args:
        plan: the plan.
        lock: the lockfile; only a scene with a row of a Trace is chosen in addition to the drawn ones.
        drawn: the digests of the scenes of the frames that are compared.
        nonce: the seed of the draw, if there are more than `sampling.MAX_SCENES`.

    Returns:
        The scenes by digest, and notes on scenes that are left out.
    """
    every = {v.scene.digest: v.scene for v in plan.variants if v.scene.digest in lock.traces or v.scene.digest in drawn}
    chosen = draw_scenes(list(every), drawn, nonce) if drawn else []
    scenes, notes = {digest: every[digest] for digest in chosen}, []
    if chosen and len(chosen) < len(every):
        which = f"{len(every) - len(chosen):,} of {count(len(every), 'scene')}"
        notes.append(f"the motion of {which}, and so their tracks.csv and events.csv, was not compared")
    return scenes, notes


def tracks_differ(dataset: Dataset, scene: ScenePlan, trace: Trace) -> bool:
    """Return whether a dataset's tracks of a scene, in every variant, differ from those of a Trace."""
    variants = sum(variant.scene.digest == scene.digest for variant in dataset.plan.variants)
    return bool(variants) and len(tracks_difference(dataset, scene, trace)) == variants
