"""`make bench-estimates`: the estimates of `recipe plan` compared with builds of ten recipes of different kinds.

Each recipe is built with one worker, in its own process and without cached motion. Its time is the CPU time of all
processes (user and system), which other users of the machine affect less than the clock. Its bytes are the disk space
of the dataset, each file once. Its memory is the peak of the largest process. Estimates are for a reference core, so
times are divided by one factor for all recipes, the geometric mean of their ratios. The exit code is 1 if time or bytes
of any recipe differ from the estimate by more than a factor of 2.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from recipe_compiler.compile import compile_recipe
from recipe_compiler.estimate import Cost
from recipe_runtime.cache.store import kernel_cache

from benchmarks.estimate_recipes import RECIPES

FACTOR = 2.0


@dataclass(frozen=True)
class Taken:
    """Cost of a build: CPU seconds, bytes on disk, bytes of memory of its largest process."""

    seconds: float
    bytes: int
    memory: int


def main(names: list[str]) -> int:
    """Build the recipes of these names, by default all, and print estimate, measurement and ratio."""
    rows = []
    for name in names or RECIPES:
        cost, taken = _measure(RECIPES[name])
        print(f"{name}: {taken.seconds:.1f} s, estimated {60 * cost.minutes:.1f}", file=sys.stderr)
        rows.append((name, cost, taken))
    pace = math.exp(sum(math.log(taken.seconds / (60 * cost.minutes)) for _, cost, taken in rows) / len(rows))
    print(f"this host takes {pace:.2f} times the estimated time; ratios of time are without this factor\n")
    print("| recipe | CPU s, estimate | actual | ratio | MiB, estimate | actual | ratio | memory | actual | ratio |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    wrong = 0
    for name, cost, taken in rows:
        largest = max(cost.main_memory, cost.worker_memory)
        pairs = [(60 * cost.minutes, taken.seconds / pace, 1), (cost.bytes, taken.bytes, 1 << 20)]
        wrong += any(not 1 / FACTOR <= actual / estimate <= FACTOR for estimate, actual, _ in pairs)
        cells = [_cells(*pair) for pair in [*pairs, (largest, taken.memory, 1 << 20)]]
        print(f"| {name} | {' | '.join(cells)} |")
    return 1 if wrong else 0


def _cells(estimate: float, actual: float, unit: int) -> str:
    return f"{estimate / unit:.1f} | {actual / unit:.1f} | {actual / estimate:.2f}"


def _measure(recipe: dict[str, Any]) -> tuple[Cost, Taken]:
    """Return a recipe's estimate and the cost of its build; build again if kernels were compiled meanwhile."""
    while True:
        kernels = _kernels()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recipe.yaml"
            path.write_text(json.dumps(recipe))
            cost, taken = compile_recipe(path, allow_large=True).cost, _build(path)
        if _kernels() == kernels:
            return cost, taken


def _kernels() -> int:
    """Count the files of compiled kernels."""
    return sum(1 for path in kernel_cache().glob("kernels/**/*") if path.is_file())


def _build(path: Path) -> Taken:
    """Build a recipe beside its file, and wait for the build."""
    out = path.with_name("out")
    places = {"RECIPE_CACHE": str(path.with_name("cache")), "RECIPE_KERNEL_CACHE": str(kernel_cache())}
    command = [sys.executable, "-m", "recipe_cli", "build", str(path), "--out", str(out), "--workers", "1"]
    child = subprocess.Popen([*command, "--allow-large"], env={**os.environ, **places}, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f"the build of {path} failed with exit code {child.returncode}")
    files = {found.st_ino: found.st_blocks * 512 for p in out.rglob("*") if (found := p.lstat()) and p.is_file()}
    return Taken(usage.ru_utime + usage.ru_stime, sum(files.values()), usage.ru_maxrss << 10)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
