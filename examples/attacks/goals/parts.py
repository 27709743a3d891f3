"""Parts of a study: attacks and tests that are run in several processes, each kept in a file when it is finished."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image

from benchmarks.pages import Table
from examples.attacks.detectors import use_one_thread


@dataclass(frozen=True)
class Part:
    """What one attack or test has found.

    Attributes:
        values: As JSON.
        textures: [k, 3, h, w], 0 to 1: one, or one for each frame.
    """

    values: dict[str, Any]
    textures: torch.Tensor


Parts = dict[str, list[Part]]  # of a study: by kind, one a seed


@dataclass(frozen=True)
class Study:
    """A study.

    Attributes:
        name: Of its folder and tables.
        plain: Kinds of parts that have no seed.
        seeded: Kinds of parts that have one for each seed; slow ones first.
        steps: Of an attack.
        cost: Processor time of all parts, relative to other studies.
        run: From kind, seed and number of steps to a part.
        tables: By name, from the parts.
        draw: Writes a picture of the parts.
    """

    name: str
    plain: tuple[str, ...]
    seeded: tuple[str, ...]
    steps: int
    cost: float
    run: Callable[[str, int, int], Part]
    tables: Callable[[Parts], dict[str, Table]]
    draw: Callable[[Parts, Path], None]

    def jobs(self, seeds: int) -> list[tuple[str, int]]:
        """Return the kind and the seed of each part."""
        return [(kind, seed) for kind in self.seeded for seed in range(seeds)] + [(kind, 0) for kind in self.plain]


def run(
    studies: Sequence[Study], folder: Path, *, seeds: int, steps: int | None, workers: int, device: str = "cpu"
) -> None:
    """Run the parts that are not in the folder yet, in processes of one thread each, and keep each when it is finished.

    A process works for one study, whose scenes stay in its memory. With fewer processes than studies, one study follows
    the other.

    Args:
        studies: Studies.
        folder: Of finished parts, one folder a study.
        seeds: Of each seeded kind.
        steps: Of an attack, in place of the study's.
        workers: Number of processes.
        device: Of the detectors.
    """
    together = [list(studies)] if workers >= len(studies) else [[study] for study in studies]
    spawn = multiprocessing.get_context("spawn")
    for group in together:
        running: dict[Future[None], str] = {}
        with ExitStack() as pools:
            for study, share in zip(group, _shares([study.cost for study in group], workers), strict=True):
                count = study.steps if steps is None else steps
                pool = pools.enter_context(
                    ProcessPoolExecutor(share, spawn, initializer=use_one_thread, initargs=(device,))
                )
                for kind, seed in study.jobs(seeds):
                    path = _path(folder, study, kind, seed)
                    if not _finished(path, count):
                        running[pool.submit(_part, study.run, kind, seed, count, path)] = f"{study.name}: {kind}"
            for number, job in enumerate(as_completed(running), 1):
                job.result()
                print(f"{number} of {len(running)}: {running[job]}", flush=True)


def read(study: Study, folder: Path, *, seeds: int) -> Parts:
    """Return the parts of a study that are in a folder, plain kinds first, then the seeded ones from the last."""
    parts: Parts = {}
    for kind in (*study.plain, *reversed(study.seeded)):
        paths = [_path(folder, study, kind, seed) for seed in range(seeds if kind in study.seeded else 1)]
        found = [_read(path) for path in paths if path.exists()]
        if found:
            parts[kind] = found
    return parts


def write(part: Part, path: Path) -> None:
    """Write textures as a PNG, one below the other, then the values as JSON beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = (part.textures.permute(0, 2, 3, 1).flatten(0, 1) * 255).round().to(torch.uint8).numpy()
    Image.fromarray(pixels).save(path.with_suffix(".png"))
    unfinished = path.with_suffix(".tmp")
    unfinished.write_text(json.dumps({"textures": len(part.textures), "values": part.values}) + "\n", encoding="utf-8")
    unfinished.replace(path)


def _read(path: Path) -> Part:
    body = json.loads(path.read_text(encoding="utf-8"))
    with Image.open(path.with_suffix(".png")) as image:
        pixels = np.asarray(image.convert("RGB"), np.float32) / 255
    rows = pixels.reshape(body["textures"], -1, *pixels.shape[1:])
    return Part(body["values"], torch.tensor(rows.transpose(0, 3, 1, 2)))


def _shares(costs: Sequence[float], workers: int) -> list[int]:
    """Return a number of workers for each study, at least one, that are in proportion to the costs."""
    shares = [1] * len(costs)
    for _ in range(workers - len(costs)):
        busiest = max(range(len(costs)), key=lambda k: costs[k] / shares[k])
        shares[busiest] += 1
    return shares


def _part(run: Callable[[str, int, int], Part], kind: str, seed: int, steps: int, path: Path) -> None:
    part = run(kind, seed, steps)
    write(Part({**part.values, "steps": steps}, part.textures), path)


def _finished(path: Path, steps: int) -> bool:
    """Return whether a part is there, with this number of steps."""
    return path.exists() and json.loads(path.read_text(encoding="utf-8"))["values"]["steps"] == steps


def _path(folder: Path, study: Study, kind: str, seed: int) -> Path:
    return folder / study.name / f"{kind.replace(', ', '-').replace(' ', '-')}-{seed}.json"
