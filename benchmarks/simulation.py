"""Time the simulation of a town with 30, 60 and 100 actors, compared with PyBullet's steps of the same bodies.

    python -m benchmarks.simulation

The last line of output is a JSON object with a row for each number of actors. Half of the actors are vehicles, half are
pedestrians, and 30 frames a second are recorded. `real_time` is simulated seconds per second of CPU time, without
start-up. `bare` is the real-time factor of `stepSimulation` alone, with the same bodies at the velocities that they
have at the end, and `ratio` is how many times the CPU time of these bare steps the simulation takes.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.simulation.process import PINNED

SIZES = (30, 60, 100)
GOALS = {30: 10.0, 60: 6.0, 100: 4.0}  # times real time
SECONDS = 20


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulation", description=__doc__)
    parser.add_argument("--actors", type=int, help="measure one size in this process")
    parser.add_argument("--seconds", type=int, default=SECONDS, help=f"of simulated time (default: {SECONDS})")
    arguments = parser.parse_args()
    if arguments.actors is not None:
        print(json.dumps(measure(scene(arguments.actors, arguments.seconds))))
    else:
        found = {}
        for size in SIZES:
            row = found[str(size)] = measured(size, arguments.seconds)
            print(
                f"{size} actors: {row['real_time']:.1f} times real time (goal: {GOALS[size]:.0f}), "
                f"{row['ratio']:.1f} times the CPU time of PyBullet's steps alone"
            )
        print(json.dumps(found))


def measured(actors: int, seconds: int = SECONDS) -> dict[str, float]:
    """Measure one size in a process of its own, with the environment of a simulation."""
    command = [sys.executable, "-m", "benchmarks.simulation", "--actors", str(actors), "--seconds", str(seconds)]
    done = subprocess.run(command, env={**os.environ, **PINNED}, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads([line for line in done.stdout.splitlines() if line.startswith("{")][-1])
    return found


def scene(actors: int, seconds: int) -> ScenePlan:
    """Return a scene in downtown, half of whose actors are vehicles."""
    recipe = {
        "recipe": "simulation",
        "seed": 7,
        "base": {
            "clock": {"fps": 30, "frames": 30 * seconds + 1, "warmup": 0},
            "town": "downtown",
            "weather": "ClearNoon",
            "traffic": {"vehicles": actors // 2, "pedestrians": actors - actors // 2},
            "sensors": {"camera": {"mount": {"z": 20}, "camera": {"width": 64, "height": 48}, "capture": ["rgb"]}},
        },
    }
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as folder:
        path = Path(folder) / "simulation.yaml"
        path.write_text(yaml.safe_dump(recipe))
        return compile_recipe(path).plan.variants[0].scene


def measure(plan: ScenePlan) -> dict[str, float]:
    """Simulate a scene in this process and time it."""
    from recipe_runtime.simulation.loop import Simulation
    from recipe_runtime.simulation.recording import FrameRecorder

    clock = plan.clock
    simulation = Simulation(plan)
    recorder = FrameRecorder(simulation.agents, simulation.world.ground)
    steps = (clock.frames - 1) * clock.steps_per_frame
    recording, start = 0.0, time.process_time()
    for step in range(steps):
        if step % clock.steps_per_frame == 0:
            began = time.process_time()
            recorder.add(simulation.agents_now())
            if recorder.full:
                list(recorder.frames())
            recording += time.process_time() - began
        simulation.advance()
    ours = (time.process_time() - start) / steps
    start = time.process_time()
    for _ in range(clock.physics):
        simulation.world.step()
    bare = (time.process_time() - start) / clock.physics
    simulation.close()
    return {
        "actors": len(plan.actors),
        "real_time": 1.0 / (ours * clock.physics),
        "recording": recording / steps / ours,  # share of the time in which the poses of all parts are computed
        "bare": 1.0 / (bare * clock.physics),
        "ratio": ours / bare,
    }


if __name__ == "__main__":
    main()
