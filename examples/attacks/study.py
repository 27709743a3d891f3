"""The study of docs/attack-study.md: attacks on a detector trained on photographs.

    python -m examples.attacks.study --output datasets/attack-study

Requires `torch` and `tflite`. All seeds are fixed; PyTorch's convolutions may differ between CPUs in their last digits.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
from concurrent.futures import Future, ProcessPoolExecutor
from functools import cache
from pathlib import Path

import torch

from benchmarks.pages import markdown, write_table
from examples.attacks.experiment import ATTACKS, Experiment, Outcome, logo, noise, start
from examples.attacks.report import draw, tables
from examples.attacks.results import Results, read, write

SEEDS, STEPS, WORKERS = 5, 40, 2
COMMAND = "make attack-study"


def main(arguments: list[str] | None = None) -> None:
    """Run the study, write textures, scores and the sheet, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=Path("datasets/attack-study"), help="folder to write to")
    parser.add_argument("--again", action="store_true", help="report what this folder has, and measure nothing")
    parser.add_argument("--page", type=Path, help="page to write the tables into; the sheet lies beside it")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="attacks of each kind, 2 to 10")
    parser.add_argument("--steps", type=int, default=STEPS, help="steps of an attack")
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes, of one thread each")
    options = parser.parse_args(arguments)
    if not options.again:
        write(run(options.seeds, options.steps, options.workers), options.output)
    results = read(options.output)
    for name, table in tables(results).items():
        print(f"\n{name}\n\n{markdown(table)}", flush=True)
        if options.page:
            write_table(options.page, f"{COMMAND}: {name}", table)
    draw(results, experiment(), options.page.with_suffix(".jpg") if options.page else options.output / "sheet.jpg")
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(f"\n{sum(use.ru_utime + use.ru_stime for use in used) / 60:.1f} minutes of processor time")


def run(seeds: int, steps: int, workers: int) -> Results:
    """Attack and test, in processes of one thread each."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        jobs: dict[str, list[Future[Outcome]]] = {
            "logo": [pool.submit(_test, logo())],
            "random texture": [pool.submit(_test, noise(seed)) for seed in range(seeds)],
            "noise on the logo": [pool.submit(_test, start(seed)) for seed in range(seeds)],
        }
        jobs |= {name: [pool.submit(_attack, name, seed, steps) for seed in range(seeds)] for name in ATTACKS}
        cosines = [pool.submit(_cosines, start(seed)) for seed in range(seeds)]
        outcomes = {name: [job.result() for job in seeded] for name, seeded in jobs.items()}
        return Results(experiment().test, outcomes, [job.result() for job in cosines])


@cache
def experiment() -> Experiment:
    """Return the experiment of this process."""
    return Experiment()


def _attack(name: str, seed: int, steps: int) -> Outcome:
    return experiment().attack(name, seed, steps)


def _test(texture: torch.Tensor) -> Outcome:
    return experiment().test_texture(texture)


def _cosines(texture: torch.Tensor) -> dict[str, float]:
    return experiment().cosines(texture)


if __name__ == "__main__":
    main()
