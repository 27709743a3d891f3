"""Print the measurements as a Markdown table, followed by violations.

python -m tests.soak [TOWN [COUNT [SEED]]]
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor

from tests.soak import runs
from tests.soak.measures import Measures


def _one(task: tuple[str, int, int]) -> Measures:
    return runs.run(*task)


def main() -> int:
    """Run all scenes in two processes; return 1 if there are violations."""
    towns = sys.argv[1:2] or list(runs.TOWNS)
    counts = [int(n) for n in sys.argv[2:3]] or list(runs.COUNTS)
    seeds = [int(n) for n in sys.argv[3:4]] or list(runs.SEEDS)
    tasks = [(town, count, seed) for town in towns for count in counts for seed in seeds]
    broken = 0
    columns = ["town", "vehicles + pedestrians", "seed", "mean speed, first 30 s", "last 30 s", "pedestrians"]
    columns += ["longest stand, s", "contacts"]
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    with ProcessPoolExecutor(2) as pool:
        for (town, _, seed), made in zip(tasks, pool.map(_one, tasks), strict=True):
            speeds = [f"{speed:.2f}" for speed in (made.first_speed, made.last_speed, made.walking_speed)]
            row = [town, f"{made.vehicles} + {made.pedestrians}", seed, *speeds, f"{made.longest_stand:.0f}"]
            print(f"| {' | '.join(map(str, [*row, made.collisions]))} |")
            for fault in made.faults():
                broken += 1
                print(f"    {fault}")
            sys.stdout.flush()
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
