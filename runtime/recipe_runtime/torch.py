"""PyTorch: a dataset over a recipe, rendered on demand, and frames as a function of a patch's texture.

Requires `torch`.

    from torch.utils.data import DataLoader
    from recipe_runtime.torch import RecipeDataset

    street = RecipeDataset("recipes/weather_sweep.yaml", modalities=("rgb", "depth"))
    for batch in DataLoader(street, batch_size=8, shuffle=True, num_workers=4):
        batch["rgb"], batch["depth"]                     # uint8 [8, 3, H, W], float32 [8, H, W]

Any frame in any order, in any worker, has the bytes of the built dataset. `SceneView` is a module from a texture to
pictures, with the exact gradient.
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
from recipe_runtime.attacks.inserted_view import InsertedView
from recipe_runtime.attacks.patch_view import PatchView
from recipe_runtime.attacks.textures import as_array, as_image, differentiable_patch
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


Place = tuple[str, int]  # variant, frame
View = PatchView | InsertedView


class SceneView(torch.nn.Module):
    """Pictures of frames as a function of the texture of a patch.

        view = SceneView("recipes/attacks/poster.yaml", "poster", [("weather=rainy", 3), ("weather=night", 7)])
        pictures, targets = view(texture, batch=1, step=k)

    The gradient is that of the renderer, without the rounding of texture, mip levels and picture to 8 bits.

    Args:
        recipe: Path of a recipe, its plan, or one of its variants.
        patch: Name of a patch of mode `rendered` or `digital`.
        frames: Pairs of variant and frame number; numbers alone are frames of the first variant. By default, all frames
            that the sensor takes of all variants.
        sensor: Name of a sensor, the first by default.
        quantise: Round textures and pictures to 8 bits, so that pictures are the frames' bytes, divided by 255; the
            gradient is that of unrounded pictures.
        device: Of the renderer: `cpu`, `cuda` or `cuda:N`.

    Raises:
        InputError: The recipe is invalid, or has no such variant, patch or sensor.
    """

    def __init__(
        self,
        recipe: str | PathLike[str] | DatasetPlan | Scenario,
        patch: str,
        frames: Sequence[Place | int] | None = None,
        *,
        sensor: str | None = None,
        quantise: bool = True,
        device: str = "cpu",
    ) -> None:
        super().__init__()
        self.patch, self.sensor, self.quantise = patch, sensor, quantise
        self._scenarios = _scenarios(recipe, device)
        first = next(iter(self._scenarios))
        if frames is None:
            frames = [(name, k) for name, scenario in self._scenarios.items() for k in scenario.frames(sensor)]
        self.frames: list[Place] = [(first, place) if isinstance(place, int) else place for place in frames]
        unknown = [variant for variant, _ in self.frames if variant not in self._scenarios]
        if unknown:
            raise InputError(f"there is no variant {unknown[0]!r}; there is {', '.join(self._scenarios)}")
        for variant in dict.fromkeys(variant for variant, _ in self.frames):
            differentiable_patch(self._scenarios[variant].plan.appearance.patches, patch)
        self._views: dict[tuple[Place, tuple[int, int]], View] = {}
        self._targets: dict[Place, dict[str, torch.Tensor]] = {}

    def forward(
        self, texture: torch.Tensor, batch: int | None = None, step: int = 0
    ) -> tuple[torch.Tensor, list[dict[str, torch.Tensor]]]:
        """Return pictures, see `pictures`, and a target for each, as `RecipeDataset` has it.

        That is torchvision's form: `boxes` float32 [N, 4] (x0, y0, x1, y1), `labels` int64 [N], and more.
        """
        return self.pictures(texture, batch, step), [self._target(place) for place in self._places(batch, step)]

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """Return pictures of the texture.

        Args:
            texture: sRGB, 0 to 1, [1, 3, h, w].
            batch: Frames to render, all by default.
            step: The frames are those from `step * batch` on, in order, from the start again after the last.

        Returns:
            Pictures [n, 3, H, W], 0 to 1, of the texture's type and device.

        Raises:
            InputError: The texture is not an image, or larger than a recipe's may be.
        """
        size = int(texture.shape[-2]), int(texture.shape[-1])
        views = [self._view(place, size) for place in self._places(batch, step)]
        pictures: torch.Tensor = _Pictures.apply(texture, views, self.quantise)  # type: ignore[no-untyped-call, unused-ignore]
        return pictures

    def _places(self, batch: int | None, step: int) -> list[Place]:
        size = len(self.frames) if batch is None else batch
        return [self.frames[(step * size + k) % len(self.frames)] for k in range(size)]

    def _view(self, place: Place, size: tuple[int, int]) -> View:
        if (place, size) not in self._views:
            scenario = self._scenarios[place[0]]
            self._views[place, size] = scenario.patch_view(place[1], self.patch, self.sensor, size=size)
        return self._views[place, size]

    def _target(self, place: Place) -> dict[str, torch.Tensor]:
        if place not in self._targets:
            self._targets[place] = _target(self._scenarios[place[0]].labels(place[1], self.sensor))
        return {name: values.clone() for name, values in self._targets[place].items()}


class _Pictures(torch.autograd.Function):
    """Pictures of a texture by several views; the gradient is summed in their order."""

    @staticmethod
    def forward(ctx: Any, texture: torch.Tensor, views: list[View], quantise: bool) -> torch.Tensor:
        values = as_array(views[0].patch, texture).astype(np.float64)
        ctx.views, ctx.values, ctx.texture = views, values, texture
        if quantise:
            image = as_image(views[0].patch, values)
            pictures = [view.render(image) / np.float32(255.0) for view in views]
        else:
            pictures = [view.forward(values) for view in views]
        stacked = np.ascontiguousarray(np.stack(pictures).transpose(0, 3, 1, 2))
        return torch.from_numpy(stacked).to(dtype=texture.dtype, device=texture.device)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        pictures = gradients[0].detach().cpu().to(torch.float64).numpy().transpose(0, 2, 3, 1)
        total = np.zeros(ctx.values.shape)
        for view, gradient in zip(ctx.views, pictures, strict=True):
            total = total + view.backward(ctx.values, gradient)
        found = torch.from_numpy(np.ascontiguousarray(total.transpose(2, 0, 1)))
        return found.reshape(ctx.texture.shape).to(dtype=ctx.texture.dtype, device=ctx.texture.device), None, None


def _scenarios(recipe: str | PathLike[str] | DatasetPlan | Scenario, device: str) -> dict[str, Scenario]:
    """Return the variants by name; they share engines."""
    if isinstance(recipe, Scenario):
        return {recipe.variant: recipe}
    plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe)
    scenes = Scenes(device, engines)
    return {variant.variant: Scenario(variant, scenes) for variant in plan.variants}
