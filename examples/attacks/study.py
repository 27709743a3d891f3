"""The study of docs/attack-study.md: attacks on a detector trained on photographs, with tables and a sheet.

    python -m examples.attacks.study --output attack-study

Requires `torch` and `tflite`. Everything is seeded; runs of equal textures differ between CPUs in the last digits only
as far as PyTorch's convolutions do.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import torch
from recipe_runtime.core import codecs
from recipe_runtime.torch import Place

from examples.attacks.experiment import ATTACKS, Experiment, Outcome, logo, noise, start
from examples.attacks.report import Results, draw, tables

SEEDS, STEPS, WORKERS = 5, 40, 2


def main(arguments: list[str] | None = None) -> None:
    """Run the study: write textures, scores and the sheet, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=Path("attack-study"), help="folder to write to")
    parser.add_argument("--sheet", type=Path, help="file of the sheet; sheet.jpg in that folder by default")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="attacks of each kind, 2 to 10")
    parser.add_argument("--steps", type=int, default=STEPS, help="steps of an attack")
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes of one thread each")
    options = parser.parse_args(arguments)
    results = run(options.seeds, options.steps, options.workers)
    options.output.mkdir(parents=True, exist_ok=True)
    write(results, experiment().test, options.output)
    draw(results, experiment(), options.sheet or options.output / "sheet.jpg")
    print("\n\n".join(tables(results)))
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(f"\n{sum(use.ru_utime + use.ru_stime for use in used) / 60:.1f} minutes of processor time")


def run(seeds: int, steps: int, workers: int) -> Results:
    """Attack and test, in processes of one thread each."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, spawn, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        attacks = {name: [pool.submit(_attack, name, seed, steps) for seed in range(seeds)] for name in ATTACKS}
        plain = {
            "logo": [pool.submit(_test, logo())],
            "random texture": [pool.submit(_test, noise(seed)) for seed in range(seeds)],
            "noise on the logo": [pool.submit(_test, start(seed)) for seed in range(seeds)],
        }
        cosines = [pool.submit(_cosines, start(seed)) for seed in range(seeds)]
        outcomes = {name: [job.result() for job in jobs] for name, jobs in (plain | attacks).items()}
        return Results(experiment().weathers(), outcomes, [job.result() for job in cosines])


def write(results: Results, test: Sequence[Place], folder: Path) -> None:
    """Write each texture as a PNG, and all scores as JSON."""
    rows = []
    for name, seed, outcome in _rows(results):
        slug = f"{name.replace(', ', '-').replace(' ', '-')}-{seed}"
        pixels = (outcome.texture[0] * 255).round().to(torch.uint8).permute(1, 2, 0).numpy()
        (folder / f"{slug}.png").write_bytes(codecs.png(pixels))
        rows.append({"name": name, "seed": seed, "losses": outcome.losses, "rendered": outcome.rendered})
        rows[-1]["inserted"] = outcome.inserted
    frames = [[variant, frame] for variant, frame in test]
    body = {"frames": frames, "results": rows, "cosines": results.cosines}
    (folder / "results.json").write_text(json.dumps(body, indent=1) + "\n", encoding="utf-8")


def _rows(results: Results) -> Iterator[tuple[str, int, Outcome]]:
    for name, outcomes in results.outcomes.items():
        for seed, outcome in enumerate(outcomes):
            yield name, seed, outcome


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
