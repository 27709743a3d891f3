"""`make bench-ray`: the cost of Ray compared with local processes, for the same frames and number of workers.

Both build the paper's listing in three weathers, alternately. The benchmark compares the CPU time of all processes that
a build starts, including Ray's own: that of a long build minus that of a short one, which excludes the start of
processes and of Ray. It also prints wall-clock time, which is meaningful on an idle machine only. Needs `ray`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.listing import FIRST, FURTHER, RECIPE, last_line, run
from benchmarks.spending import Meter


@dataclass(frozen=True)
class Cost:
    """Seconds of a build: CPU time of all processes, and wall-clock time without start-up."""

    processors: float
    wall: float


def main() -> None:
    """Measure, and print the ratios."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cluster", description=__doc__)
    parser.add_argument("--frames", type=int, nargs=2, default=(40, 240), metavar=("SHORT", "LONG"))
    parser.add_argument("--turns", type=int, default=6, help="at least two, to say how sure the mean is (default: 6)")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()
    spent: dict[str, list[float]] = {"local": [], "ray": []}
    waited: dict[str, list[float]] = {"local": [], "ray": []}
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as name:
        for turn in range(arguments.turns):
            for engine in spent:
                short, long = (
                    cost(Path(name) / f"{engine}{turn}-{n}", engine == "ray", n, arguments.workers)
                    for n in arguments.frames
                )
                spent[engine].append(long.processors - short.processors)
                waited[engine].append(long.wall)
                print(
                    f"{engine}: {spent[engine][-1]:.2f} s of processor time for the further frames; "
                    f"{long.wall:.2f} s of steady work on the wall",
                    flush=True,
                )
    ratios = [ray / local for ray, local in zip(spent["ray"], spent["local"], strict=True)]
    error = statistics.stdev(ratios) / len(ratios) ** 0.5
    apart = f"standard error {error:.3f}; runs {', '.join(f'{ratio:.3f}' for ratio in ratios)}"
    print(f"Ray takes {statistics.mean(ratios):.3f} times the processor time ({apart})")
    print(f"and {min(waited['ray']) / min(waited['local']):.3f} times as long; {os.getloadavg()[0]:.1f} load after")


def cost(folder: Path, on_ray: bool, frames: int, workers: int) -> Cost:
    """Measure a build of that number of frames."""
    folder.mkdir()
    command = [sys.executable, "-m", "benchmarks.ours", str(RECIPE), str(folder), "--variants", FIRST, *FURTHER]
    command += ["--frames", str(frames), "--workers", str(workers)]
    with Meter() as meter:
        found = last_line(run([*command, "--ray"] if on_ray else command, meter.environment))
    return Cost(meter.seconds, float(found["wall"] - found["start_up"]))


if __name__ == "__main__":
    main()
