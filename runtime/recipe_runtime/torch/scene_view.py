"""Frames as a differentiable function of the textures of patches: a PyTorch module."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

import torch
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plurals import count

from recipe_runtime.attacks.joint_view import JointView
from recipe_runtime.torch.pictures import Batch, Pictures, check_texture
from recipe_runtime.torch.sampling import Weight, sampled
from recipe_runtime.torch.shots import Patches, Place, Recipe, Shot, shots_of
from recipe_runtime.torch.targets import target_of

Textures: TypeAlias = torch.Tensor | Mapping[str, torch.Tensor]
Augment: TypeAlias = Callable[[torch.Tensor], torch.Tensor]
Sizes = tuple[tuple[int, int], ...]


class SceneView(torch.nn.Module):
    """Pictures of frames as a differentiable function of the textures of patches.

        view = SceneView("recipes/attacks/poster.yaml", "poster", [("weather=rainy", 3), ("weather=night", 7)])
        pictures, targets = view(texture, batch=1, step=k)

    The gradient is that of the renderer without the rounding of texture, mip levels and picture to 8 bits. The sum of
    two views, of the same or of different recipes, patches and sensors, has the frames of both; textures of the same
    name are one texture.

    Args:
        recipe: Path of a recipe, its plan, or one of its variants.
        patch: Name of a patch of any mode but `green`; or the patch or patches that show each of several
            textures, by the texture's name: `{"logo": ["poster", "van"], "sign": "sign"}`.
        frames: Pairs of variant and frame number; a plain number is a frame of the first variant. By default, all
            frames of all variants that the sensors take.
        sensor: Name of a sensor, or of several, of which each takes each frame; the first by default.
        quantise: Round textures and pictures to 8 bits, so that pictures are the frames' bytes divided by 255. The
            gradient is that of the unrounded pictures (a straight-through estimator).
        augment: Applied to the textures of a batch, one for each picture, [n, 3, h, w], before they are rendered, such
            as `Photometric`; or what is applied to each of several textures, by its name.
        device: Device of the renderer: `cpu`, `cuda` or `cuda:N`.
        memory: About how many bytes of memory to use for frames kept between calls; others are rendered again.

    Attributes:
        shots: A `Shot` for each picture: scenario, frame, sensor and patches.
        frames: Variant and frame of each.
        textures: Names of the textures.

    Raises:
        InputError: The recipe is invalid, a named variant, patch or sensor does not exist, or there is no frame.
    """

    def __init__(
        self,
        recipe: Recipe,
        patch: Patches,
        frames: Sequence[Place | int] | None = None,
        *,
        sensor: str | Iterable[str] | None = None,
        quantise: bool = True,
        augment: Augment | Mapping[str, Augment] | None = None,
        device: str = "cpu",
        memory: int = 4 << 30,
    ) -> None:
        super().__init__()
        self._show(shots_of(recipe, patch, frames, sensor, device), quantise, augment, memory)

    def _show(
        self, shots: list[Shot], quantise: bool, augment: Augment | Mapping[str, Augment] | None, memory: int
    ) -> None:
        self.augment: Augment | Mapping[str, Augment] | None
        self.quantise, self.augment, self.memory = quantise, augment, memory
        self.shots, self.frames = shots, [shot.place for shot in shots]
        self.textures = tuple(dict.fromkeys(texture for shot in shots for _, texture in shot.patches))
        self._views: OrderedDict[tuple[Shot, Sizes], JointView] = OrderedDict()
        self._targets: dict[Shot, dict[str, torch.Tensor]] = {}
        unknown = [name for name in augment if name not in self.textures] if isinstance(augment, Mapping) else []
        if unknown:
            raise InputError(f"`augment` names the texture {unknown[0]}; the view has {', '.join(self.textures)}")

    def __add__(self, other: SceneView) -> SceneView:
        """Return a view of the frames of both, with the options of the first and the memory of both."""
        joined = SceneView.__new__(SceneView)
        torch.nn.Module.__init__(joined)
        joined._show(self.shots + other.shots, self.quantise, self.augment, self.memory + other.memory)
        return joined

    def __getstate__(self) -> dict[str, object]:
        """Return what a copy consists of: it renders its own frames, which are too large to copy."""
        return {**self.__dict__, "_views": OrderedDict()}

    def forward(
        self, texture: Textures, batch: int | None = None, step: int = 0, *, at: Sequence[int] | None = None
    ) -> tuple[torch.Tensor, list[dict[str, torch.Tensor]]]:
        """Return pictures and a target for each picture.

        Args:
            texture: As in `pictures`.
            batch: As in `pictures`.
            step: As in `pictures`.
            at: As in `pictures`.

        Returns:
            The pictures, and targets in torchvision's form: `boxes` float32 [N, 4] (x0, y0, x1, y1), `labels` int64
            [N], and more; see `RecipeDataset`.
        """
        shots = self._chosen(self._given(texture), batch, step, at)
        return self.pictures(texture, batch, step, at=at), [self._target(shot) for shot in shots]

    def pictures(
        self, texture: Textures, batch: int | None = None, step: int = 0, *, at: Sequence[int] | None = None
    ) -> torch.Tensor:
        """Return pictures of the textures.

        Args:
            texture: sRGB, floats from 0 to 1: [1, 3, h, w], which all pictures show, or [n, 3, h, w] for n pictures,
                of which each shows its own. Several textures are given by their names. Values outside 0 to 1 by at
                most 0.5, as after a step of an optimiser, are clipped, and have no gradient.
            batch: Number of pictures; by default, that of the textures if it is not 1, else that of all frames.
            step: The first frame is `step * batch`, modulo the number of frames.
            at: Indices of the frames, in place of `batch` and `step`: from `sample`, for example.

        Returns:
            Pictures [n, 3, H, W], 0 to 1, of the texture's dtype and device.

        Raises:
            InputError: A texture is not an image of floats, has values far outside 0 to 1, or is larger than a
                recipe's image may be, the number of textures is not that of pictures, the batch is empty, or its
                pictures differ in size.
        """
        given = self._given(texture)
        shots = self._chosen(given, batch, step, at)
        augments = self.augment if isinstance(self.augment, Mapping) else dict.fromkeys(given, self.augment)
        for name, augment in augments.items():
            if augment is not None:
                given[name] = check_texture(name, augment(given[name].expand(len(shots), -1, -1, -1)))
        sizes = {name: (int(values.shape[-2]), int(values.shape[-1])) for name, values in given.items()}
        shown = Batch([self._view(s, sizes) for s in shots], [s.patches for s in shots], tuple(given), self.quantise)
        pictures: torch.Tensor = Pictures.apply(shown, *given.values())  # type: ignore[no-untyped-call, unused-ignore]
        return pictures

    def sample(self, generator: torch.Generator, count: int = 1, weights: Weight | None = None) -> list[int]:
        """Return indices of frames, drawn independently, for `at`.

        Args:
            generator: The source of randomness.
            count: Number of indices.
            weights: The relative frequency of a shot, as a function of it; equal by default.

        Raises:
            InputError: A weight is negative or not finite, or all are 0.
        """
        return sampled(self.shots, generator, count, weights)

    def _given(self, textures: Textures) -> dict[str, torch.Tensor]:
        """Return the textures [n, 3, h, w] by name, in the order of `self.textures`."""
        if not isinstance(textures, Mapping):
            if len(self.textures) > 1:
                raise InputError(f"the view has the textures {', '.join(self.textures)}; give each, by its name")
            textures = {self.textures[0]: textures}
        wrong = set(textures) ^ set(self.textures)
        if wrong:
            raise InputError(
                f"the view has the textures {', '.join(self.textures)}, and those given are {', '.join(textures)}"
            )
        given = {name: check_texture(name, textures[name]) for name in self.textures}
        return {name: values[None] if values.ndim == 3 else values for name, values in given.items()}

    def _chosen(
        self, given: Mapping[str, torch.Tensor], batch: int | None, step: int, at: Sequence[int] | None
    ) -> list[Shot]:
        """Return the shots of a batch."""
        most = max(len(values) for values in given.values())
        if at is not None:
            if batch is not None or step:
                raise InputError("a batch is given by `at`, or by `batch` and `step`, and not by both")
            shots = [self.shots[int(k)] for k in at]
        else:
            size = batch if batch is not None else most if most > 1 else len(self.shots)
            shots = [self.shots[(step * size + k) % len(self.shots)] for k in range(size)]
        if not shots:
            raise InputError("a batch has one picture or more, and not 0")
        for name, values in given.items():
            if len(values) not in (1, len(shots)):
                raise InputError(
                    f"the texture of {name} has the shape {tuple(values.shape)}, but the view shows"
                    f" {count(len(shots), 'picture')}; give one texture, or {len(shots)}: one for each picture"
                )
        return shots

    def _view(self, shot: Shot, sizes: Mapping[str, tuple[int, int]]) -> JointView:
        key = shot, tuple(sizes[texture] for _, texture in shot.patches)
        if key not in self._views:
            frame = shot.scenario.retextured(shot.frame, shot.sensor)
            view = JointView(frame, {patch: sizes[texture] for patch, texture in shot.patches})
            while self._views and sum(v.memory for v in (view, *self._views.values())) > self.memory:
                self._views.popitem(last=False)
            self._views[key] = view
        self._views.move_to_end(key)
        return self._views[key]

    def _target(self, shot: Shot) -> dict[str, torch.Tensor]:
        if shot not in self._targets:
            self._targets[shot] = target_of(shot.scenario.labels(shot.frame, shot.sensor))
        return {name: values.clone() for name, values in self._targets[shot].items()}
