"""The study of docs/attack-study.md: attacks on detectors trained on photographs.

    python -m examples.attacks.study --output datasets/attack-study

Requires `torch` and `tflite`. All seeds are fixed; PyTorch's convolutions may differ between CPUs in their last digits.
A finished attack is not repeated: an interrupted study goes on where it stopped.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from benchmarks.pages import markdown, write_table
from examples.attacks.detectors import DETECTORS, opened, use_one_thread
from examples.attacks.experiment import ATTACKS, SCENES, Found, attack, cosines, logo, start, tested
from examples.attacks.report import draw, tables
from examples.attacks.results import Results, Task, write

SEEDS, STEPS, WORKERS = 3, (40, 120), 2
COMMAND = "make attack-study"


def main(arguments: list[str] | None = None) -> None:
    """Run the study, write textures, scores and the sheet, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=Path("datasets/attack-study"), help="folder to write to")
    parser.add_argument("--again", action="store_true", help="report what this folder has, and measure nothing")
    parser.add_argument("--page", type=Path, help="page to write the tables into; the sheet lies beside it")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="attacks of each kind")
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS, help="steps after which attacks are tested")
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes, of one thread each")
    parser.add_argument("--device", default="cpu", help="device of the detectors, such as cuda")
    options = parser.parse_args(arguments)
    if not options.again:
        run(options.output, options.seeds, options.steps, options.workers, options.device)
    results = Results(options.output)
    for name, table in tables(results).items():
        print(f"\n{name}\n\n{markdown(table)}", flush=True)
        if options.page:
            write_table(options.page, f"{COMMAND}: {name}", table)
    draw(results, options.page.with_suffix(".jpg") if options.page else options.output / "sheet.jpg")
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(f"\n{sum(use.ru_utime + use.ru_stime for use in used) / 60:.1f} minutes of processor time")


def tasks(seeds: int) -> list[Task]:
    """Return the tasks of a study, seed by seed, so that an interrupted study has whole seeds."""
    found = [Task("logo", scene, "", 0) for scene in SCENES]
    for seed in range(seeds):
        found += [Task("noise on the logo", scene, "", seed) for scene in SCENES]
        for scene in SCENES:
            for name in DETECTORS:
                found += [Task(kind, scene, name, seed) for kind in (*ATTACKS, "gradients")]
    return found


def run(folder: Path, seeds: int, steps: Sequence[int], workers: int, device: str = "cpu") -> None:
    """Attack and test, in processes of one thread each, what a folder has not yet."""
    waiting = [task for task in tasks(seeds) if not (folder / f"{task.file}.json").exists()]
    for name in DETECTORS:
        opened(name)  # fetched once, before the processes start
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, initializer=use_one_thread, initargs=(device,)) as pool:
        jobs = [pool.submit(finish, folder, task, sorted(steps)) for task in waiting]
        for count, job in enumerate(as_completed(jobs), start=1):
            job.result()
            print(f"\r{count} of {len(jobs)} attacks", end="", flush=True)


def finish(folder: Path, task: Task, steps: Sequence[int]) -> None:
    """Do a task, and write what it found."""
    found: list[Found] = []
    losses: list[float] = []
    angles: dict[str, float] = {}
    if task.name == "gradients":
        angles = cosines(task.scene, task.detector, start(task.seed))
    elif task.name in ATTACKS:
        found, losses = attack(task.scene, task.detector, task.name, task.seed, steps)
    else:
        texture = logo() if task.name == "logo" else start(task.seed)
        found = [Found(texture, 0, tested(texture, [task.scene]))]
    write(folder, task, found, losses, angles)


if __name__ == "__main__":
    main()
