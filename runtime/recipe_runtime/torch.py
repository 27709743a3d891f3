"""PyTorch: a dataset that renders a recipe on demand, and frames as a differentiable function of a patch's texture.

Requires `torch`: without it, the import of this module raises InputError.

    from torch.utils.data import DataLoader
    from recipe_runtime.torch import RecipeDataset

    street = RecipeDataset("recipes/weather_sweep.yaml", modalities=("rgb", "depth"))
    for batch in DataLoader(street, batch_size=8, shuffle=True, num_workers=4):
        batch["rgb"], batch["depth"]                     # uint8 [8, 3, H, W], float32 [8, H, W]

Frames have the bytes of the built dataset, in any order and in any worker. `SceneView` is a module that maps a texture
to pictures, with the exact gradient.
"""

from __future__ import annotations

import operator
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate
from os import PathLike
from pathlib import Path
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import as_array, as_image, differentiable_patch
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes

try:
    import torch
    from torch.utils.data import Dataset
except ModuleNotFoundError as error:
    if error.name != "torch":  # torch is installed, and lacks a library itself
        raise
    raise InputError(
        "PyTorch is not installed", help="install it: pip install 'torch>=2.6'", code=Code.MISSING_LIBRARY
    ) from None

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
            sample["target"] = _target(scenario.labels(frame, sensor))
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


class SceneView(torch.nn.Module):
    """Pictures of frames as a differentiable function of the texture of a patch.

        view = SceneView("recipes/attacks/poster.yaml", "poster", [("weather=rainy", 3), ("weather=night", 7)])
        pictures, targets = view(texture, batch=1, step=k)

    The gradient is that of the renderer without the rounding of texture, mip levels and picture to 8 bits.

    Args:
        recipe: Path of a recipe, its plan, or one of its variants.
        patch: Name of a patch of mode `rendered` or `digital`.
        frames: Pairs of variant and frame number; a plain number is a frame of the first variant. By default, all
            frames of all variants that the sensor takes.
        sensor: Name of a sensor; the first by default.
        quantise: Round textures and pictures to 8 bits, so that pictures are the frames' bytes divided by 255. The
            gradient is that of the unrounded pictures (a straight-through estimator).
        device: Device of the renderer: `cpu`, `cuda` or `cuda:N`.
        memory: About how many bytes of memory to use for frames kept between calls; others are rendered again.

    Raises:
        InputError: The recipe is invalid, a named variant, patch or sensor does not exist, or there is no frame.
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
        memory: int = 4 << 30,
    ) -> None:
        super().__init__()
        self.patch, self.sensor, self.quantise, self.memory = patch, sensor, quantise, memory
        self._scenarios = _scenarios(recipe, device)
        first = next(iter(self._scenarios))
        if frames is None:
            frames = [(name, k) for name, scenario in self._scenarios.items() for k in scenario.frames(sensor)]
        self.frames: list[Place] = [
            (first, operator.index(p)) if isinstance(p, SupportsIndex) else (p[0], p[1]) for p in frames
        ]
        if not self.frames:
            raise InputError("a SceneView has one frame or more, and `frames` has none")
        unknown = [variant for variant, _ in self.frames if variant not in self._scenarios]
        if unknown:
            raise InputError(f"there is no variant {unknown[0]!r}; the variants are {', '.join(self._scenarios)}")
        for variant in dict.fromkeys(variant for variant, _ in self.frames):
            self._scenarios[variant].modalities(sensor)  # InputError if there is no such sensor
            differentiable_patch(self._scenarios[variant].plan.appearance.patches, patch)
        self._views: OrderedDict[tuple[Place, tuple[int, int]], TextureView] = OrderedDict()
        self._targets: dict[Place, dict[str, torch.Tensor]] = {}

    def __getstate__(self) -> dict[str, object]:
        """Return what a copy consists of: it renders its own frames, which are too large to copy."""
        return {**self.__dict__, "_views": OrderedDict()}

    def forward(
        self, texture: torch.Tensor, batch: int | None = None, step: int = 0
    ) -> tuple[torch.Tensor, list[dict[str, torch.Tensor]]]:
        """Return pictures and a target for each picture.

        Args:
            texture: As in `pictures`.
            batch: As in `pictures`.
            step: As in `pictures`.

        Returns:
            The pictures, and targets in torchvision's form: `boxes` float32 [N, 4] (x0, y0, x1, y1), `labels` int64
            [N], and more; see `RecipeDataset`.
        """
        return self.pictures(texture, batch, step), [self._target(place) for place in self._places(batch, step)]

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """Return pictures of the texture.

        Args:
            texture: sRGB, floats from 0 to 1, [1, 3, h, w]; values outside are clipped, and have no gradient.
            batch: Number of frames to render; all by default.
            step: The first frame is `step * batch`, modulo the number of frames.

        Returns:
            Pictures [n, 3, H, W], 0 to 1, of the texture's dtype and device.

        Raises:
            InputError: The texture is not an image of floats, or is larger than a recipe's image may be, the batch is
                empty, or its pictures differ in size.
        """
        _check_texture(self.patch, texture)
        size = int(texture.shape[-2]), int(texture.shape[-1])
        views = [self._view(place, size) for place in self._places(batch, step)]
        pictures: torch.Tensor = _Pictures.apply(texture, views, self.quantise)  # type: ignore[no-untyped-call, unused-ignore]
        return pictures

    def _places(self, batch: int | None, step: int) -> list[Place]:
        size = len(self.frames) if batch is None else batch
        if size < 1:
            raise InputError(f"a batch has one picture or more, and not {size}")
        return [self.frames[(step * size + k) % len(self.frames)] for k in range(size)]

    def _view(self, place: Place, size: tuple[int, int]) -> TextureView:
        if (place, size) not in self._views:
            scenario = self._scenarios[place[0]]
            view = scenario.patch_view(place[1], self.patch, self.sensor, size=size)
            while self._views and sum(v.memory for v in (view, *self._views.values())) > self.memory:
                self._views.popitem(last=False)
            self._views[place, size] = view
        self._views.move_to_end((place, size))
        return self._views[place, size]

    def _target(self, place: Place) -> dict[str, torch.Tensor]:
        if place not in self._targets:
            self._targets[place] = _target(self._scenarios[place[0]].labels(place[1], self.sensor))
        return {name: values.clone() for name, values in self._targets[place].items()}


def _check_texture(patch: str, texture: object) -> None:
    """Raise InputError if a texture is not a tensor of floats of at least two axes; `as_array` checks the rest."""
    if not isinstance(texture, torch.Tensor) or not texture.is_floating_point() or texture.ndim < 2:
        kind = f"{texture.dtype}" if isinstance(texture, torch.Tensor) else type(texture).__name__
        shape = f" of the shape {tuple(texture.shape)}" if isinstance(texture, torch.Tensor) else ""
        raise InputError(
            f"the texture of {patch} is {kind}{shape}; give a tensor [1, 3, height, width] of floats from 0 to 1, such"
            " as 8-bit values divided by 255"
        )


class _Pictures(torch.autograd.Function):
    """Pictures of a texture in several views; gradients are summed in the order of the views."""

    @staticmethod
    def forward(ctx: Any, texture: torch.Tensor, views: list[TextureView], quantise: bool) -> torch.Tensor:
        given = as_array(views[0].patch, texture).astype(np.float64)
        values = np.clip(given, 0.0, 1.0)
        ctx.views, ctx.values, ctx.texture, ctx.clipped = views, values, texture, values != given
        if quantise:
            image = as_image(views[0].patch, values)
            pictures = [view.render(image) / np.float32(255.0) for view in views]
        else:
            pictures = [view.forward(values) for view in views]
        sizes = {f"{picture.shape[1]} x {picture.shape[0]}" for picture in pictures}
        if len(sizes) > 1:
            raise InputError(
                f"pictures of {' and '.join(sorted(sizes))} pixels are no batch; choose frames of one size"
            )
        stacked = np.ascontiguousarray(np.stack(pictures).transpose(0, 3, 1, 2))
        return torch.from_numpy(stacked).to(dtype=texture.dtype, device=texture.device)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        pictures = gradients[0].detach().cpu().to(torch.float64).numpy().transpose(0, 2, 3, 1)
        total = np.zeros(ctx.values.shape)
        for view, gradient in zip(ctx.views, pictures, strict=True):
            total = total + view.backward(ctx.values, gradient)
        total = np.where(ctx.clipped, 0.0, total)
        found = torch.from_numpy(np.ascontiguousarray(total.transpose(2, 0, 1))).reshape(ctx.texture.shape)
        found = found.to(dtype=ctx.texture.dtype, device=ctx.texture.device)
        if torch.is_grad_enabled():  # create_graph=True
            found = _Once.apply(found, ctx.texture, gradients[0])  # type: ignore[no-untyped-call, unused-ignore]
        return found, None, None


class _Once(torch.autograd.Function):
    """A gradient that depends on texture and pictures, and has no derivative itself."""

    @staticmethod
    def forward(ctx: Any, found: torch.Tensor, *_: torch.Tensor) -> torch.Tensor:
        return found.clone()

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> Any:
        raise InputError("the gradient of a SceneView cannot be differentiated again; use no penalty on gradients")


def _scenarios(recipe: str | PathLike[str] | DatasetPlan | Scenario, device: str) -> dict[str, Scenario]:
    """Return the variants by name; they share engines."""
    if isinstance(recipe, Scenario):
        return {recipe.variant: recipe}
    plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe)
    scenes = Scenes(device, engines)
    return {variant.variant: Scenario(variant, scenes) for variant in plan.variants}
