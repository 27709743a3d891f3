"""What the study measured: one folder of files, each written when an attack is finished."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from examples.attacks.detectors import DETECTORS
from examples.attacks.experiment import MOMENTS, SCENES, WEATHERS, Found

FOUND = 0.5  # score from which a person counts as found

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """An attack on a detector in a scene with a seed, or a texture without attack, or a comparison of gradients."""

    name: str
    scene: str
    detector: str  # attacked; empty for a texture without attack
    seed: int

    @property
    def file(self) -> str:
        """The name of its file, without ending."""
        parts = [self.scene, self.detector or "all", self.name.replace(",", "").replace(" ", "-"), str(self.seed)]
        return "_".join(parts).lower()


def write(
    folder: Path, task: Task, found: Sequence[Found], losses: Sequence[float], cosines: Mapping[str, float]
) -> None:
    """Write the textures of a task as PNG, then all else as JSON; a task whose JSON exists is finished."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for one in found:
        file = f"{task.file}_{one.steps}.png"
        pixels = (one.texture[0] * 255).round().to(torch.uint8).permute(1, 2, 0).numpy()
        Image.fromarray(pixels).save(folder / file)
        rows.append({"steps": one.steps, "texture": file, "scores": one.scores})
    body = {**vars(task), "found": rows, "losses": list(losses), "cosines": dict(cosines)}
    unfinished = folder / f"{task.file}.part"
    unfinished.write_text(json.dumps(body) + "\n", encoding="utf-8")
    unfinished.replace(folder / f"{task.file}.json")


class Results:
    """The finished tasks of a folder.

    Args:
        folder: To which `write` wrote.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._tasks: dict[tuple[str, str, str, int], dict[str, Any]] = {}
        for path in sorted(folder.glob("*.json")):
            body = json.loads(path.read_text(encoding="utf-8"))
            self._tasks[body["name"], body["scene"], body["detector"], body["seed"]] = body
        if not self._tasks:
            raise FileNotFoundError(f"{folder} has no results; run the study without --again first")
        attacked = {seed for _, _, detector, seed in self._tasks if detector}
        needed = {key[:3] for key in self._tasks if key[2]}
        self.seeds = sorted(seed for seed in attacked if all((*key, seed) in self._tasks for key in needed))
        if not self.seeds:
            raise ValueError(f"{folder} has no seed for which all attacks are finished; continue the study")
        self.steps = sorted({row["steps"] for body in self._tasks.values() for row in body["found"] if row["steps"]})

    def scores(
        self,
        name: str,
        weathers: Sequence[str],
        *,
        attacked: Sequence[str] = tuple(DETECTORS),
        scenes: Sequence[str] = tuple(SCENES),
        tested: str | None = None,
        where: str | None = None,
        steps: int | None = None,
        inserted: bool = False,
    ) -> Values:
        """Return scores of a person [scenes, detectors * seeds, moments, weathers].

        Args:
            name: Of the attack, or of a texture without.
            weathers: Of the tests.
            attacked: The detectors.
            scenes: That are attacked.
            tested: The detector of the tests: the attacked one by default.
            where: The scene of the tests: the attacked one by default.
            steps: Of the attack: the most by default.
            inserted: Whether the texture is inserted digitally in the tests.
        """
        columns = [WEATHERS.index(weather) for weather in weathers]
        found = [
            [
                self._row(name, scene, one, seed, steps)["scores"][
                    "inserted" if inserted else f"{tested or one} in {where or scene}"
                ]
                for one in attacked
                for seed in (self.seeds if self._has(name, scene, one) else [0])
            ]
            for scene in scenes
        ]
        values = np.array(found, np.float64)
        return values.reshape(*values.shape[:2], MOMENTS, len(WEATHERS))[..., columns]

    def cosines(self, attacked: str) -> dict[str, list[float]]:
        """Return the cosines between both gradients by weather, one a scene and seed."""
        rows = [self._tasks["gradients", scene, attacked, seed]["cosines"] for scene in SCENES for seed in self.seeds]
        return {weather: [row[weather] for row in rows] for weather in WEATHERS}

    def texture(self, name: str, scene: str, attacked: str, seed: int) -> torch.Tensor:
        """Return a texture [1, 3, h, w], 0 to 1, after the most steps."""
        with Image.open(self._folder / self._row(name, scene, attacked, seed, None)["texture"]) as image:
            pixels = np.asarray(image, np.float32).transpose(2, 0, 1)[None] / 255
        return torch.tensor(pixels)

    def _has(self, name: str, scene: str, attacked: str) -> bool:
        """Whether an attack, or a texture without, has a row for each seed."""
        return self._key(name, scene, attacked, self.seeds[-1]) in self._tasks

    def _row(self, name: str, scene: str, attacked: str, seed: int, steps: int | None) -> dict[str, Any]:
        rows: list[dict[str, Any]] = self._tasks[self._key(name, scene, attacked, seed)]["found"]
        return rows[-1] if steps is None else next(row for row in rows if row["steps"] == steps)

    def _key(self, name: str, scene: str, attacked: str, seed: int) -> tuple[str, str, str, int]:
        known = (name, scene, attacked, seed)
        return known if (name, scene, attacked, self.seeds[0]) in self._tasks else (name, scene, "", seed)


def found(scores: Values) -> Values:
    """Return 1 where a person is found, else 0."""
    return (scores >= FOUND).astype(np.float64)
