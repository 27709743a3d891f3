"""Simulates a scene in a child process whose floating-point results do not depend on the CPU.

Bullet calls glibc's sin, cos, pow and so on, and glibc selects an implementation by CPU, with or without FMA. The
simulation therefore always runs in a child process in which those CPU features are hidden from glibc, whatever the
parent's environment is.

The child reads the plan as JSON from its standard input. While it runs, it writes to its standard output: a line
`parts` with the names of the parts as JSON; lines `progress STEP STEPS`; for each frame a line `frame NUMBER`, followed
by the frame's bytes on the Trace's integer grid; and at the end a line `event` with each contact of two bodies as JSON,
and a line `end`. Neither process keeps more than one frame in memory: the parent writes each frame to a temporary file,
from which the Trace is read.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import asdict, replace
from typing import IO, Any

from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.body.skeleton import part_names
from recipe_runtime.core import subprocesses
from recipe_runtime.core.trace import ContactEvent, Trace, TraceWriter

PINNED = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4",
    "PYTHONHASHSEED": "0",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "LC_ALL": "C",
}
"""Environment variables of the child process that fix its numeric behaviour."""

Progress = Callable[[int, int], None]


def simulate(scene: ScenePlan, progress: Progress | None = None) -> Trace:
    """Return the motion of a scene, with its contacts.

    Args:
        scene: The plan of the scene.
        progress: Called with the steps done and the total number of steps.

    Raises:
        RunError: The child process failed.
    """
    environment = {**os.environ, **PINNED}
    environment.pop("LD_PRELOAD", None)
    command = subprocesses.command("recipe_runtime.simulation.process", "main")
    with tempfile.TemporaryFile() as errors:
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, env=environment)
        try:
            with subprocesses.registered(child):
                trace = _converse(child, scene, progress)
        finally:
            if child.poll() is None and sys.exc_info()[0] is not None:
                child.kill()
            code = child.wait()
        if trace is None or code != 0:
            errors.seek(0)
            raise RunError(_explain(code, errors.read()))
        return trace


def _converse(child: subprocess.Popen[bytes], scene: ScenePlan, progress: Progress | None) -> Trace | None:
    """Send the plan, report progress, collect frames and contacts; None if the child ended before the last frame."""
    assert child.stdin is not None and child.stdout is not None
    with child.stdout as out, ExitStack() as stack:
        try:
            with child.stdin as stdin:
                stdin.write(scene.model_dump_json().encode())
        except BrokenPipeError:
            return None
        writer, frames, contacts = None, 0, list[ContactEvent]()
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
            elif word == b"event":
                contacts.append(ContactEvent(**json.loads(rest)))
            elif line == b"end\n" and writer is not None and frames == scene.clock.frames:
                return replace(writer.trace(), contacts=tuple(contacts))
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


def _serve(plan: IO[bytes], answer: IO[Any]) -> None:
    from recipe_runtime.simulation.loop import run

    scene = ScenePlan.model_validate_json(plan.read())

    def report(step: int, steps: int) -> None:
        answer.write(b"progress %d %d\n" % (step, steps))
        answer.flush()

    def take(frame: int, data: bytes) -> None:
        answer.write(b"frame %d\n" % frame)
        answer.write(data)

    parts = [f"{actor.name}/{part}" for actor in scene.actors for part in part_names(actor.shape)]
    answer.write(b"parts %s\n" % json.dumps(parts).encode())
    for event in run(scene, take, report):
        answer.write(b"event %s\n" % json.dumps(asdict(event)).encode())
    answer.write(b"end\n")
    answer.flush()


def main() -> None:
    """Entry point of the child: results go to the original standard output, all other output to standard error."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    _serve(sys.stdin.buffer, answer)
