"""A PyTorch dataset of all frames of a recipe, rendered on demand."""

from __future__ import annotations

import operator
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan
from torch.utils.data import Dataset

from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.torch.targets import target_of

Sample = dict[str, Any]


class RecipeDataset(Dataset[Sample]):
    """All frames of all sensors of all variants, in the recipe's order.

    A sample has `variant`, `sensor` and `frame`, and a tensor for each modality with the values that docs/dataset.md
    lists, channels first: rgb uint8 [3, H, W], depth float32 [H, W] in metres. Tensors of uint16 arrays are int32.

    Args:
        recipe: Path of a recipe, or its plan.
        variants: Names of the variants to include; all by default.
        sensors: Names of the sensors to include; all by default.
        modalities: Modalities of a sample; all that the sensor captures by default.
        target: Add `target` to samples, in the form of torchvision's detection models with more fields: `boxes`
            float32 [N, 4] (x0, y0, x1, y1), `labels` int64 [N] (CARLA tags), `instances` int64 [N], `area` int64 [N],
            `iscrowd` int64 [N], `visible_fraction` float32 [N]. Batches need a `collate_fn` that keeps lists.
        transform: Applied to each sample.
        device: `cpu`, `cuda` or `cuda:N`.
        disk_cache: A folder in which rendered arrays are cached.
        allow_large: Accept recipes that exceed the size limits.

    Raises:
        InputError: The recipe is invalid, a named variant, sensor or modality does not exist, or a name is given in
            place of a list.
    """

    def __init__(
        self,
        recipe: str | PathLike[str] | DatasetPlan,
        *,
        variants: Iterable[str] | None = None,
        sensors: Iterable[str] | None = None,
        modalities: Iterable[str] | None = None,
        target: bool = False,
        transform: Callable[[Sample], Any] | None = None,
        device: str = "cpu",
        disk_cache: str | PathLike[str] | None = None,
        allow_large: bool = False,
    ) -> None:
        names = {"variants": variants, "sensors": sensors, "modalities": modalities}
        variants, sensors, modalities = (_names(argument, given) for argument, given in names.items())
        plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe, allow_large)
        scenes, kept = Scenes(device, engines), Path(disk_cache) if disk_cache is not None else None
        chosen = plan.variants if variants is None else [plan.named(name) for name in variants]
        self.scenarios = [Scenario(variant, scenes, kept) for variant in chosen]
        self._videos = [(s, sensor) for s in self.scenarios for sensor in (s.sensors if sensors is None else sensors)]
        self._modalities = modalities
        for scenario, sensor in self._videos:
            _check(scenario, sensor, self._modalities or ())
        self._ends = list(accumulate(len(scenario.frames(sensor)) for scenario, sensor in self._videos))
        self._target, self._transform = target, transform

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index: int) -> Any:
        """Return a sample.

        Raises:
            IndexError: There is no sample with this index.
        """
        scenario, sensor, frame = self._at(index)
        sample: Sample = {"variant": scenario.variant, "sensor": sensor, "frame": frame}
        for modality in scenario.modalities(sensor) if self._modalities is None else self._modalities:
            sample[modality] = _tensor(scenario.render(frame, sensor, modality))
        if self._target:
            sample["target"] = target_of(scenario.labels(frame, sensor))
        return self._transform(sample) if self._transform else sample

    def _at(self, index: int) -> tuple[Scenario, str, int]:
        if not -len(self) <= index < len(self):
            raise IndexError(f"there is no sample {index}: the dataset has {len(self)}")
        at = operator.index(index) % len(self)
        video = bisect_right(self._ends, at)
        scenario, sensor = self._videos[video]
        frames = scenario.frames(sensor)
        return scenario, sensor, frames[at - (self._ends[video] - len(frames))]


def _names(argument: str, given: Iterable[str] | None) -> tuple[str, ...] | None:
    if isinstance(given, str):
        raise InputError(f"{argument} is a list of names, such as [{given!r}], and not one name")
    return None if given is None else tuple(given)


def _check(scenario: Scenario, sensor: str, modalities: Sequence[str]) -> None:
    captured = scenario.modalities(sensor)
    for modality in modalities:
        if modality not in captured:
            raise InputError(f"the sensor {sensor} does not capture {modality!r}; it captures {', '.join(captured)}")


def _tensor(pixels: NDArray[np.generic]) -> torch.Tensor:
    if pixels.ndim == 3:
        return torch.from_numpy(np.ascontiguousarray(pixels.transpose(2, 0, 1)))
    return torch.from_numpy(pixels.astype(np.int32) if pixels.dtype == np.uint16 else pixels)
