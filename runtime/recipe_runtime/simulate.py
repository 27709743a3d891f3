"""ScenePlan -> Trace, in a process of its own whose numbers do not depend on the CPU.

glibc picks its sin, cos, pow ... by CPU, with and without FMA, and Bullet calls them. So the simulation always runs
in a child that hides those CPU features from glibc, whatever the parent's environment says. The child reads the plan
as JSON from its standard input and answers on its standard output: lines `progress STEP STEPS`, then a line `trace`
and the Trace's bytes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.errors import RunError
from recipe_compiler.plan import ScenePlan

from recipe_runtime import children
from recipe_runtime.meshes.skeleton import part_names
from recipe_runtime.trace import METRE, UNIT, Trace

if TYPE_CHECKING:
    from recipe_runtime.bullet import World
    from recipe_runtime.mover import Mover

PINNED = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4",
    "PYTHONHASHSEED": "0",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "LC_ALL": "C",
}
"""The numeric environment of every simulation."""

Progress = Callable[[int, int], None]


def simulate(scene: ScenePlan, progress: Progress | None = None, *, timeout: float = 3600.0) -> Trace:
    """The motion of a scene. `progress` hears (steps done, steps in all). RunError if the child fails or hangs."""
    environment = {**os.environ, **PINNED}
    environment.pop("LD_PRELOAD", None)
    command = children.command("recipe_runtime.simulate", "main")
    with tempfile.TemporaryFile() as errors:
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, env=environment)
        timer = threading.Timer(timeout, child.kill)
        timer.start()
        try:
            answer = _converse(child, scene.model_dump_json().encode(), progress)
        finally:
            hung = not timer.is_alive()
            timer.cancel()
            if child.poll() is None and sys.exc_info()[0] is not None:
                child.kill()
            code = child.wait()
        if hung:
            raise RunError(f"the simulation took more than {timeout:.0f} s and was stopped; try fewer frames or actors")
        if answer is None or code != 0:
            errors.seek(0)
            raise RunError(_explain(code, errors.read()))
    try:
        return Trace.from_bytes(answer)
    except ValueError as error:
        raise RunError(f"the simulation's answer cannot be read: {error}") from error


def _converse(child: subprocess.Popen[bytes], plan: bytes, progress: Progress | None) -> bytes | None:
    """Send the plan; pass progress on; return the Trace's bytes, or None if the child ended without."""
    assert child.stdin is not None and child.stdout is not None
    with child.stdout as out:
        try:
            with child.stdin as stdin:
                stdin.write(plan)
        except BrokenPipeError:
            return None
        for line in out:
            word, *rest = line.split()
            if word == b"trace":
                return out.read()
            if word == b"progress" and progress is not None:
                progress(int(rest[0]), int(rest[1]))
    return None


def _explain(code: int, errors: bytes) -> str:
    lines = errors.decode(errors="replace").strip().splitlines()
    ending = f"signal {-code}" if code < 0 else f"exit code {code}"
    return f"the simulation ended with {ending}" + (f": {lines[-1]}" if lines else "")


def _run(scene: ScenePlan, report: Progress) -> Trace:
    """Simulate in this very process; `simulate` is the way in."""
    from recipe_runtime.bullet import World
    from recipe_runtime.motion import movers

    clock = scene.clock
    world = World(scene.town, clock.physics, scene.props)
    cast = movers(world, scene)
    record = _Record(scene)
    decide_every = max(1, clock.physics // 30)
    steps = (clock.frames - 1) * clock.steps_per_frame
    for step in range(steps + 1):
        if step % clock.steps_per_frame == 0:
            record.take(step // clock.steps_per_frame, world, cast)
            report(step, steps)
        if step == steps:
            break
        if step % decide_every == 0:
            for m in cast:
                m.decide([other for other in cast if other is not m])
        for m in cast:
            m.act()
        world.step()
        for m in cast:
            m.sense()
            m.advance()
    world.close()
    return record.trace()


class _Record:
    """The Trace while it is written."""

    def __init__(self, scene: ScenePlan) -> None:
        self._names = [(actor.name, part_names(actor.shape)) for actor in scene.actors]
        frames, parts = scene.clock.frames, sum(len(names) for _, names in self._names)
        self._positions = np.zeros((frames, parts, 3))
        self._rotations = np.zeros((frames, parts, 4))
        self._linear = np.zeros((frames, len(self._names), 3))
        self._angular = np.zeros((frames, len(self._names), 3))

    def take(self, frame: int, world: World, movers: list[Mover]) -> None:
        """Write down where everything is."""
        row = 0
        for a, m in enumerate(movers):
            for position, rotation in m.parts():
                self._positions[frame, row], self._rotations[frame, row] = position, rotation
                row += 1
            self._linear[frame, a], self._angular[frame, a] = world.velocity(m.body)

    def trace(self) -> Trace:
        """What was written, on the grid; of a rotation's two quaternions the one with w > 0."""
        rotations = _snap(self._rotations, UNIT)
        key = np.zeros(rotations.shape[:-1], np.int64)
        for axis in (0, 1, 2, 3):  # the sign of w, or of the last component before it that is not 0
            key = np.where(rotations[..., axis] != 0, rotations[..., axis], key)
        rotations = np.where(key[..., None] < 0, -rotations, rotations)
        return Trace(
            actors=tuple(name for name, _ in self._names),
            parts=tuple(f"{name}/{part}" for name, parts in self._names for part in parts),
            positions=_snap(self._positions, METRE),
            rotations=rotations.astype(np.int32),
            linear=_snap(self._linear, METRE),
            angular=_snap(self._angular, METRE),
        )


def _snap(values: NDArray[np.float64], grid: int) -> NDArray[np.int64]:
    if not np.isfinite(values).all():
        raise RunError("a body left the world: its position or velocity is no number; move what touches it apart")
    return np.floor(values * grid + 0.5).astype(np.int64)


def _serve(plan: IO[bytes], answer: IO[Any]) -> None:
    scene = ScenePlan.model_validate_json(plan.read())

    def report(step: int, steps: int) -> None:
        answer.write(b"progress %d %d\n" % (step, steps))
        answer.flush()

    trace = _run(scene, report)
    answer.write(b"trace\n" + trace.to_bytes())
    answer.flush()


def main() -> None:
    """What the child runs: answer on the real standard output; whatever else prints goes to standard error."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _serve(sys.stdin.buffer, answer)
