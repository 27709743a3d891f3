"""A scene's motion as it is locked and as this host simulates it: where they part, and what that may excuse.

A lockfile or manifest may be anyone's, and so may the digest of its motion. A claim of other motion excuses a frame
only if the frame's own labels bear it out.
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
    """Motion that differs from the locked one: this host's Trace, from which frames are compared nevertheless."""

    trace: Trace
    reason: str  # why this host need not agree
    agreed: int = 0  # frames at the start in which, by the locked bodies, the motion is this host's

    def excuses(self, modality: str, frame: int) -> bool:
        """Whether a frame whose first difference is in that modality may differ.

        Colours may not: where depth, instances and labels agree, so does the motion that is seen.
        """
        return modality != "rgb" and frame >= self.agreed


def parting(lock: Lockfile, scene: ScenePlan, trace: Trace) -> tuple[str, int, bool]:
    """Where motion of another digest parts from the locked one.

    Returns:
        Which body parts first, and about when, in words; the number of frames before that, 0 if it is not known; and
        whether the lockfile contradicts itself, since it says that no body parts.
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
