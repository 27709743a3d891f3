"""Frames as a differentiable function of the texture of a patch: a PyTorch module."""

from __future__ import annotations

import operator
from collections import OrderedDict
from collections.abc import Sequence
from os import PathLike
from typing import SupportsIndex

import torch
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import differentiable_patch
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.torch.pictures import Pictures
from recipe_runtime.torch.targets import target_of

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
        pictures: torch.Tensor = Pictures.apply(texture, views, self.quantise)  # type: ignore[no-untyped-call, unused-ignore]
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
            self._targets[place] = target_of(self._scenarios[place[0]].labels(place[1], self.sensor))
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


def _scenarios(recipe: str | PathLike[str] | DatasetPlan | Scenario, device: str) -> dict[str, Scenario]:
    """Return the variants by name; they share engines."""
    if isinstance(recipe, Scenario):
        return {recipe.variant: recipe}
    plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe)
    scenes = Scenes(device, engines)
    return {variant.variant: Scenario(variant, scenes) for variant in plan.variants}
