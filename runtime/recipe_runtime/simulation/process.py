"""Simulates a scene in a child process whose floating-point results do not depend on the CPU.

Bullet calls glibc's sin, cos, pow and so on, and glibc selects an implementation by CPU, with or without FMA. The
simulation therefore always runs in a child process in which those CPU features are hidden from glibc, whatever the
parent's environment is.

The child reads the plan as JSON from its standard input. While it runs, it writes to its standard output: a line
`parts` with the names of the parts as JSON; lines `progress STEP STEPS`; for each frame a line `frame NUMBER`, followed
by the frame's bytes on the Trace's integer grid; and at the end a line `end`. Neither process keeps more than one frame
in memory: the parent writes each frame to a temporary file, from which the Trace is read.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.body.skeleton import part_names
from recipe_runtime.core import subprocesses
from recipe_runtime.core.trace import METRE, UNIT, Trace, TraceWriter, frame_bytes

if TYPE_CHECKING:
    from recipe_runtime.simulation.agent import Agent
    from recipe_runtime.simulation.bullet import World

PINNED = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4",
    "PYTHONHASHSEED": "0",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "LC_ALL": "C",
}
"""Environment variables of the child process that fix its numeric behaviour."""

Progress = Callable[[int, int], None]


def simulate(scene: ScenePlan, progress: Progress | None = None, *, timeout: float = 3600.0) -> Trace:
    """Simulate a scene in a child process and return its motion.

    Args:
        scene: The plan of the scene.
        progress: Called with the steps done and the total number of steps.
        timeout: Seconds after which the simulation is stopped.

    Raises:
        RunError: The child process failed or exceeded the time limit.
    """
    environment = {**os.environ, **PINNED}
    environment.pop("LD_PRELOAD", None)
    command = subprocesses.command("recipe_runtime.simulation.process", "main")
    with tempfile.TemporaryFile() as errors:
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, env=environment)
        timer = threading.Timer(timeout, child.kill)
        timer.start()
        try:
            trace = _converse(child, scene, progress)
        finally:
            hung = not timer.is_alive()
            timer.cancel()
            if child.poll() is None and sys.exc_info()[0] is not None:
                child.kill()
            code = child.wait()
        if hung:
            raise RunError(f"the simulation took more than {timeout:.0f} s and was stopped; try fewer frames or actors")
        if trace is None or code != 0:
            errors.seek(0)
            raise RunError(_explain(code, errors.read()))
        return trace


def _converse(child: subprocess.Popen[bytes], scene: ScenePlan, progress: Progress | None) -> Trace | None:
    """Send the plan to the child, report its progress and store its frames.

    Returns None if the child ended before the last frame.
    """
    assert child.stdin is not None and child.stdout is not None
    with child.stdout as out, ExitStack() as stack:
        try:
            with child.stdin as stdin:
                stdin.write(scene.model_dump_json().encode())
        except BrokenPipeError:
            return None
        writer, frames = None, 0
        for line in out:
            word, _, rest = line.partition(b" ")
            if word == b"parts":
                names = [actor.name for actor in scene.actors]
                writer = stack.enter_context(closing(TraceWriter(names, json.loads(rest), scene.clock.frames)))
            elif word == b"progress" and progress is not None:
                progress(*map(int, rest.split()))
            elif word == b"frame" and writer is not None:
                data = out.read(writer.frame_size)
                if len(data) < writer.frame_size:
                    return None
                _keep(writer, int(rest), data)
                frames += 1
            elif line == b"end\n" and writer is not None and frames == scene.clock.frames:
                return writer.trace()
    return None


def _keep(writer: TraceWriter, frame: int, data: bytes) -> None:
    try:
        writer.write(frame, data)
    except OSError as error:
        raise RunError(
            f"cannot write the simulation's motion to the temporary folder {tempfile.gettempdir()}: "
            f"{error.strerror}; free some space there, or set TMPDIR to another folder"
        ) from error


def _explain(code: int, errors: bytes) -> str:
    lines = errors.decode(errors="replace").strip().splitlines()
    ending = f"signal {-code}" if code < 0 else f"exit code {code}"
    return f"the simulation ended with {ending}" + (f": {lines[-1]}" if lines else "")


def _run(scene: ScenePlan, take: Callable[[int, bytes], None], report: Progress) -> None:
    """Simulate in the current process; `take` is called with each frame's number and bytes. See `simulate`."""
    from recipe_runtime.simulation.agents import create_agents
    from recipe_runtime.simulation.bullet import World

    clock = scene.clock
    world = World(scene.town, clock.physics, scene.props)
    agents = create_agents(world, scene)
    decide_every = max(1, clock.physics // 30)
    steps = (clock.frames - 1) * clock.steps_per_frame
    for step in range(steps + 1):
        if step % clock.steps_per_frame == 0:
            take(step // clock.steps_per_frame, _motion(world, agents))
            report(step, steps)
        if step == steps:
            break
        if step % decide_every == 0:
            for m in agents:
                m.choose_motion([other for other in agents if other is not m])
        for m in agents:
            m.apply_velocity()
        world.step()
        for m in agents:
            m.read_state()
            m.update_distance()
    world.close()


def _motion(world: World, create_agents: Sequence[Agent]) -> bytes:
    """Return the current state as the bytes of a Trace frame.

    A rotation corresponds to two quaternions; the one whose w is positive is stored. If w is 0, the last component
    that is not 0 is positive.
    """
    poses = [pose for m in create_agents for pose in m.parts()]
    velocities = [world.velocity(m.body) for m in create_agents]
    rotations = _snap(_rows([rotation for _, rotation in poses], 4), UNIT)
    key = np.zeros(rotations.shape[:-1], np.int64)
    for axis in (0, 1, 2, 3):  # the sign of w, or of the last component before it that is not 0
        key = np.where(rotations[..., axis] != 0, rotations[..., axis], key)
    return frame_bytes(
        positions=_snap(_rows([position for position, _ in poses], 3), METRE),
        rotations=np.where(key[..., None] < 0, -rotations, rotations).astype(np.int32),
        linear=_snap(_rows([linear for linear, _ in velocities], 3), METRE),
        angular=_snap(_rows([angular for _, angular in velocities], 3), METRE),
    )


def _rows(values: Sequence[Sequence[float]], width: int) -> NDArray[np.float64]:
    return np.array(values, np.float64).reshape(-1, width)


def _snap(values: NDArray[np.float64], grid: int) -> NDArray[np.int64]:
    if not np.isfinite(values).all():
        raise RunError(
            "the simulation diverged: a position or velocity is not a finite number; separate overlapping bodies"
        )
    return np.floor(values * grid + 0.5).astype(np.int64)


def _serve(plan: IO[bytes], answer: IO[Any]) -> None:
    scene = ScenePlan.model_validate_json(plan.read())

    def report(step: int, steps: int) -> None:
        answer.write(b"progress %d %d\n" % (step, steps))
        answer.flush()

    def take(frame: int, data: bytes) -> None:
        answer.write(b"frame %d\n" % frame)
        answer.write(data)

    parts = [f"{actor.name}/{part}" for actor in scene.actors for part in part_names(actor.shape)]
    answer.write(b"parts %s\n" % json.dumps(parts).encode())
    _run(scene, take, report)
    answer.write(b"end\n")
    answer.flush()


def main() -> None:
    """Entry point of the child: results go to the original standard output, all other output to standard error."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _serve(sys.stdin.buffer, answer)
