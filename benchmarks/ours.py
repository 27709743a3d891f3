"""Time one real build: compiled, simulated, rendered, annotated, encoded, hashed and written.

    python -m benchmarks.ours RECIPE FOLDER --variants weather=sunny --frames 300 --workers 1

The last line of output is a JSON object: seconds by stage, summed over workers, and wall-clock seconds. Start-up is
separate: the time until the first picture, minus the time of one picture, and minus the time by which the simulation,
which runs meanwhile, exceeds the loading of the scene. `rate` is pictures per second once all workers are running,
after a fifth of the pictures. `peak` is the memory of the largest process, in MiB.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build import local
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.build.resume import Runner


def main() -> None:
    """Build, and print the time."""
    parser = argparse.ArgumentParser()
    parser.add_argument("recipe", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--variants", nargs="+", required=True)
    parser.add_argument("--frames", type=int, required=True)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--ray", action="store_true", help="on a Ray cluster of this host's own")
    arguments = parser.parse_args()
    dataset = part_of(compile_recipe(arguments.recipe).plan, arguments.variants, arguments.frames)
    ticks: list[tuple[float, int]] = []

    def progress(stage: str, done: int, total: int) -> None:
        if stage == "render":
            ticks.append((time.perf_counter(), done))

    folder: Path = arguments.folder
    start = time.perf_counter()
    with runner(arguments.ray) as run:
        result = build(
            dataset,
            folder / "dataset",
            BuildOptions(workers=arguments.workers, cache=folder / "cache", progress=progress, run=run),
        )
    (first, pictures), (last, total) = ticks[1], ticks[-1]
    workers = max(arguments.workers, 1)
    waited = max(0.0, result.seconds["simulate"] - result.seconds["load"] / workers)
    start_up = first - start - waited - (last - first) / (total - pictures) * pictures / workers
    fifth, so_far = next((at, done) for at, done in ticks if done >= total / 5)
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
    print(
        json.dumps(
            {
                "frames": arguments.frames,
                "pictures": total,
                "wall": result.wall,
                "start_up": start_up,
                "rate": (total - so_far) / (last - fifth),
                "seconds": result.seconds,
                "peak": peak,
                "bytes": sum(row["size"] for row in result.manifest["files"].values()),
            }
        )
    )


@contextmanager
def runner(on_ray: bool) -> Iterator[Runner]:
    """Return what runs the shards: local processes, or Ray."""
    if not on_ray:
        yield local.run
        return
    from recipe_runtime.build.ray import joined

    with joined(None) as run:
        yield run


def part_of(dataset: DatasetPlan, variants: list[str], frames: int) -> DatasetPlan:
    """Return the dataset with only those variants and the first frames."""
    chosen = []
    for variant in dataset.variants:
        if variant.variant in variants:
            clock = variant.scene.clock.model_copy(update={"frames": frames})
            scene = variant.scene.model_copy(update={"clock": clock})
            chosen.append(variant.model_copy(update={"scene": scene}))
    part = dataset.model_copy(update={"variants": tuple(chosen)})
    return DatasetPlan.model_validate(part.document())  # as if read from a file: no digest is known


if __name__ == "__main__":
    main()
