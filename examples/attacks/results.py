"""What the study measured, in memory and as files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from recipe_runtime.torch import Place

from examples.attacks.experiment import Outcome, weather_of

FOUND = 0.5  # score from which a person counts as found


@dataclass(frozen=True)
class Results:
    """What the study measured.

    Attributes:
        frames: The test frames.
        outcomes: By attack or texture, one a seed.
        cosines: Between the exact and the false gradient, by weather, one a seed.
    """

    frames: list[Place]
    outcomes: dict[str, list[Outcome]]
    cosines: list[dict[str, float]]

    @property
    def weathers(self) -> list[str]:
        """The weather of each test frame."""
        return [weather_of(variant) for variant, _ in self.frames]

    def scores(self, name: str, weathers: Sequence[str], inserted: bool = False) -> list[NDArray[np.float64]]:
        """Return the scores of each seed in the test frames of some weathers, rendered or inserted digitally."""
        chosen = np.isin(self.weathers, weathers)
        return [np.array(o.inserted if inserted else o.rendered)[chosen] for o in self.outcomes[name]]

    def found(self, name: str, weathers: Sequence[str], inserted: bool = False) -> list[float]:
        """Return, for each seed, the percentage of the test frames of some weathers in which a person is found."""
        return [100 * float(np.mean(scores >= FOUND)) for scores in self.scores(name, weathers, inserted)]


def write(results: Results, folder: Path) -> None:
    """Write each texture as a PNG, and everything else as JSON."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, outcomes in results.outcomes.items():
        for seed, outcome in enumerate(outcomes):
            file = f"{name.replace(', ', '-').replace(' ', '-')}-{seed}.png"
            pixels = (outcome.texture[0] * 255).round().to(torch.uint8).permute(1, 2, 0).numpy()
            Image.fromarray(pixels).save(folder / file)
            rows.append(
                {
                    "name": name,
                    "seed": seed,
                    "texture": file,
                    "losses": outcome.losses,
                    "rendered": outcome.rendered,
                    "inserted": outcome.inserted,
                }
            )
    body = {"frames": results.frames, "results": rows, "cosines": results.cosines}
    (folder / "results.json").write_text(json.dumps(body, indent=1) + "\n", encoding="utf-8")


def read(folder: Path) -> Results:
    """Return the results that `write` wrote."""
    body = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    outcomes: dict[str, list[Outcome]] = {}
    for row in body["results"]:
        with Image.open(folder / row["texture"]) as image:
            pixels = np.asarray(image, np.float32).transpose(2, 0, 1)[None] / 255
        outcome = Outcome(torch.tensor(pixels), row["losses"], row["rendered"], row["inserted"])
        outcomes.setdefault(row["name"], []).append(outcome)
    return Results([(variant, frame) for variant, frame in body["frames"]], outcomes, body["cosines"])
