"""Compares the locked motion of a scene with this host's simulation, and decides which frames may differ for it.

A lockfile or manifest may have been written by anyone, including the digest of its motion. A claim of different motion
therefore excuses a frame only if labels of that frame differ too.
"""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import ScenePlan
from recipe_compiler.ir.plurals import count, form

from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset import digests

CONTRADICTION = "the motion of every body agrees, and the digest of the whole does not: the lockfile contradicts itself"


@dataclass(frozen=True)
class OtherMotion:
    """Motion that differs from the locked motion. Frames are still rendered from this host's Trace and compared."""

    trace: Trace
    reason: str  # why this host need not agree
    agreed: int = 0  # number of frames at the start in which the motion agrees, according to the locked bodies

    def excuses(self, modality: str, frame: int) -> bool:
        """Whether a frame may differ whose first difference is in a given modality.

        Colours may not: if depth, instances and labels agree, the visible motion agrees too.
        """
        return modality != "rgb" and frame >= self.agreed


def parting(lock: Lockfile, scene: ScenePlan, trace: Trace) -> tuple[str, int, bool]:
    """Find where motion with another digest starts to differ from the locked motion.

    Returns:
        A description of the first body that differs, and when; the number of frames before that, or 0 if unknown; and
        whether the lockfile contradicts itself, because according to it no body differs.
    """
    ours, partings = digests.body_motions(trace), []
    locked = {actor: lock.bodies.get((scene.digest, actor)) for actor in ours}
    if ours and all(locked[actor] == motion for actor, motion in ours.items()):
        return CONTRADICTION, 0, True
    for actor, motion in ours.items():
        row = locked[actor]
        at = digests.first_divergence(row, motion) if row else None
        if at:
            partings.append((at[0], actor, at[1]))
    if not partings:
        return "the motion differs from the one that was locked", 0, False
    first, actor, last = min(partings)
    where = f"{digests.divergence_text(first, last)} (from step {first * scene.clock.steps_per_frame})"
    bodies = f"{len(partings)} of {count(len(ours), 'body', 'bodies')} {form(len(partings), 'differs', 'differ')}"
    return f"body {actor} parts {where}; {bodies}", 0 if None in locked.values() else max(0, first - 1), False
