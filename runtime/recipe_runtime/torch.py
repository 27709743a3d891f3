"""A PyTorch dataset over a recipe, with frames rendered on demand and nothing on disk. Requires `torch`.

    from torch.utils.data import DataLoader
    from recipe_runtime.torch import RecipeDataset

    street = RecipeDataset("recipes/weather_sweep.yaml", modalities=("rgb", "depth"))
    for batch in DataLoader(street, batch_size=8, shuffle=True, num_workers=4):
        batch["rgb"], batch["depth"]                     # uint8 [8, 3, H, W], float32 [8, H, W]

Any frame in any order, in any worker, has the bytes of the built dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan
from torch.utils.data import Dataset

from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes

Sample = dict[str, Any]


class RecipeDataset(Dataset[Sample]):
    """Every frame that a sensor takes, of every sensor of every variant, in the recipe's order.

    A sample has `variant`, `sensor` and `frame`, and a tensor for each modality: rgb uint8 [3, H, W]; depth float32
    [H, W] in metres; instance int32 [H, W]; semantic uint8 [H, W].

    Args:
        recipe: Path of a recipe, or its plan.
        variants: Names of the variants to include; all by default.
        sensors: Names of the sensors to include; all by default.
        modalities: Modalities of a sample; all that the sensor captures by default.
        target: Add `target` to samples, in the form of torchvision's detection models, with more fields: `boxes`
            float32 [N, 4] (x0, y0, x1, y1), `labels` int64 [N] (CARLA tags), `instances` int64 [N], `area` int64 [N],
            `iscrowd` int64 [N], `visible_fraction` float32 [N]. Batches need a `collate_fn` that keeps lists.
        transform: Applied to each sample.
        device: `cpu`, `cuda` or `cuda:N`.
        disk_cache: A folder for rendered arrays.
        allow_large: Accept recipes over the limits of size.

    Raises:
        InputError: The recipe is invalid, or has no variant, sensor or modality of a given name.
    """

    def __init__(
        self,
        recipe: str | PathLike[str] | DatasetPlan,
        *,
        variants: Sequence[str] | None = None,
        sensors: Sequence[str] | None = None,
        modalities: Sequence[str] | None = None,
        target: bool = False,
        transform: Callable[[Sample], Any] | None = None,
        device: str = "cpu",
        disk_cache: str | PathLike[str] | None = None,
        allow_large: bool = False,
    ) -> None:
        plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe, allow_large)
        scenes, kept = Scenes(device, engines), Path(disk_cache) if disk_cache is not None else None
        chosen = plan.variants if variants is None else [plan.named(name) for name in variants]
        self.scenarios = [Scenario(variant, scenes, kept) for variant in chosen]
        self._places = [(s, sensor) for s in self.scenarios for sensor in _sensors(s, sensors)]
        self._modalities = tuple(modalities) if modalities is not None else None
        for scenario, sensor in self._places:
            _check(scenario, sensor, self._modalities or ())
        self._ends = _running([len(scenario.frames(sensor)) for scenario, sensor in self._places])
        self._target, self._transform = target, transform

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index: int) -> Any:
        """Return a sample; IndexError beyond the last."""
        scenario, sensor, frame = self._at(index)
        sample: Sample = {"variant": scenario.variant, "sensor": sensor, "frame": frame}
        for modality in self._modalities or scenario.modalities(sensor):
            sample[modality] = _tensor(modality, scenario.render(frame, sensor, modality))
        if self._target:
            sample["target"] = _target(scenario.labels(frame, sensor))
        return self._transform(sample) if self._transform else sample

    def _at(self, index: int) -> tuple[Scenario, str, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"sample {index} is not there: the dataset has {len(self)}")
        index %= len(self)
        place = next(n for n, end in enumerate(self._ends) if index < end)
        scenario, sensor = self._places[place]
        frames = scenario.frames(sensor)
        return scenario, sensor, frames[index - (self._ends[place] - len(frames))]


def _sensors(scenario: Scenario, wanted: Sequence[str] | None) -> Sequence[str]:
    return scenario.sensors if wanted is None else wanted


def _check(scenario: Scenario, sensor: str, modalities: Sequence[str]) -> None:
    captured = scenario.modalities(sensor)
    for modality in modalities:
        if modality not in captured:
            raise InputError(f"the sensor {sensor} does not capture {modality!r}; it captures {', '.join(captured)}")


def _running(counts: Sequence[int]) -> list[int]:
    ends: list[int] = []
    for count in counts:
        ends.append((ends[-1] if ends else 0) + count)
    return ends


def _tensor(modality: str, pixels: NDArray[np.generic]) -> torch.Tensor:
    if modality == "rgb":
        return torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))
    return torch.from_numpy(pixels.astype(np.int32) if pixels.dtype == np.uint16 else pixels)


def _target(records: Sequence[LabelRecord]) -> dict[str, torch.Tensor]:
    boxes = [[x, y, x + w, y + h] for x, y, w, h in (record["bbox"] for record in records)]
    return {
        "boxes": torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4),
        "labels": torch.tensor([record["instance"] // 1000 for record in records], dtype=torch.int64),
        "instances": torch.tensor([record["instance"] for record in records], dtype=torch.int64),
        "area": torch.tensor([record["area"] for record in records], dtype=torch.int64),
        "iscrowd": torch.zeros(len(records), dtype=torch.int64),
        "visible_fraction": torch.tensor([record["visible_fraction"] for record in records], dtype=torch.float32),
    }
