"""Simulate in the process of the tests, because starting a child process takes half a second.

The last bits of a Trace may differ from those of a child, which hides CPU features from the C library.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.body.skeleton import part_names
from recipe_runtime.core.trace import Trace, TraceWriter
from recipe_runtime.simulation.loop import run


def simulate(scene: ScenePlan) -> Trace:
    """Return the motion of a scene, with its contacts."""
    parts = [f"{actor.name}/{part}" for actor in scene.actors for part in part_names(actor.shape)]
    with closing(TraceWriter([actor.name for actor in scene.actors], parts, scene.clock.frames)) as writer:
        contacts = run(scene, writer.write, lambda *_: None)
        return replace(writer.trace(), contacts=tuple(contacts))
