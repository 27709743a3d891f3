"""Print the measurements as two Markdown tables, followed by violations.

python -m tests.soak [--town TOWN] [--vehicles N] [--pedestrians N] [--seed N] [--seconds N] [--jobs N]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

from tests.soak import runs
from tests.soak.driving import quantiles
from tests.soak.measures import Measures

FLOW = ("mean speed, first 30 s", "last 30 s", "pedestrians", "longest stand, s", "contacts")
DRIVING = (
    *("crashes", "lateral, m/s²", "entry braking, m/s²", "brakings over 5 m/s²", "lane changes per km"),
    *("undone", "duration, s", "headway, s: 5 %", "median", "95 %", "speed / limit: median", "95 %", "above"),
)

Task = tuple[str, int, int, int, int]  # town, vehicles, pedestrians, seed, seconds


def _one(task: Task) -> Measures:
    return runs.run(*task)


def _options() -> argparse.Namespace:
    options = argparse.ArgumentParser(prog="python -m tests.soak", description="Measure minutes of traffic.")
    options.add_argument("--town", nargs="+", choices=list(runs.TOWNS), default=list(runs.TOWNS))
    options.add_argument("--vehicles", nargs="+", type=int, default=list(runs.COUNTS))
    options.add_argument("--pedestrians", type=int, help="as many as vehicles by default")
    options.add_argument("--seed", nargs="+", type=int, default=list(runs.SEEDS))
    options.add_argument("--seconds", type=int, default=runs.SECONDS)
    options.add_argument("--jobs", type=int, default=2, help="processes")
    return options.parse_args()


def _flow(made: Measures) -> list[str]:
    speeds = [f"{speed:.2f}" for speed in (made.first_speed, made.last_speed, made.walking_speed)]
    return [*speeds, f"{made.longest_stand:.0f}", str(made.collisions)]


def _driving(made: Measures) -> list[str]:
    seen = made.driving
    row = [str(len(seen.crashes)), f"{seen.lateral:.1f}", f"{seen.entry_braking:.1f}", str(seen.hard_brakings)]
    row += [f"{seen.change_rate:.2f}", f"{seen.undone:.0%}", f"{seen.duration:.1f}"]
    row += [f"{value:.2f}" for value in quantiles(seen.headways, 0.05, 0.5, 0.95)]
    row += [f"{value:.2f}" for value in quantiles(seen.speeds, 0.5, 0.95)] + [f"{seen.above:.0%}"]
    return ["-" if "nan" in cell else cell for cell in row]


def _print_row(cells: Sequence[str]) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


def _print_head(columns: Sequence[str]) -> None:
    _print_row(["town", "vehicles + pedestrians", "seed", *columns])
    print("|" + "---|" * (3 + len(columns)))


def main() -> int:
    """Run all scenes in several processes; return 1 if there are violations."""
    given = _options()
    tasks: list[Task] = [
        (town, count, count if given.pedestrians is None else given.pedestrians, seed, given.seconds)
        for town in given.town
        for count in given.vehicles
        for seed in given.seed
    ]
    rows: list[tuple[list[str], Measures]] = []
    _print_head(FLOW)
    with ProcessPoolExecutor(given.jobs) as pool:
        for (town, _, _, seed, _), made in zip(tasks, pool.map(_one, tasks), strict=True):
            rows.append(([town, f"{made.vehicles} + {made.pedestrians}", str(seed)], made))
            _print_row([*rows[-1][0], *_flow(made)])
    print()
    _print_head(DRIVING)
    for row, made in rows:
        _print_row([*row, *_driving(made)])
    broken = 0
    for row, made in rows:
        for fault in made.faults():
            broken += 1
            print(f"{'' if broken > 1 else chr(10)}{', '.join(row)}: {fault}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
