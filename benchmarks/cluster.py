"""`make bench-ray`: what Ray costs over this host's own processes, for the same frames with as many workers.

Both build the paper's listing, one after the other and twice; a build's steady time is compared, without the start of
processes or of Ray. Needs `ray`.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from benchmarks.listing import FIRST, FURTHER, RECIPE, last_line, run


def main() -> None:
    """Measure, and print the ratio."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cluster", description=__doc__)
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as name:
        for turn in range(2):
            for engine in ("local", "ray"):
                seconds = steady(Path(name) / f"{engine}{turn}", engine == "ray", arguments)
                best[engine] = min(best.get(engine, seconds), seconds)
                print(f"{engine}: {seconds:.2f} s of steady work", flush=True)
    print(f"Ray takes {best['ray'] / best['local']:.3f} times as long; {os.getloadavg()[0]:.1f} load after")


def steady(folder: Path, on_ray: bool, arguments: argparse.Namespace) -> float:
    """Seconds of a build without its start-up."""
    folder.mkdir()
    command = [sys.executable, "-m", "benchmarks.ours", str(RECIPE), str(folder), "--variants", FIRST, *FURTHER]
    command += ["--frames", str(arguments.frames), "--workers", str(arguments.workers)]
    found = last_line(run([*command, "--ray"] if on_ray else command))
    return float(found["wall"] - found["start_up"])


if __name__ == "__main__":
    main()
