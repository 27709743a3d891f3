"""Pictures of textures as a function that PyTorch differentiates, and maps over batches of textures (`torch.func`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.attacks.joint_view import JointView
from recipe_runtime.attacks.textures import Values, as_array, as_image

_EXCESS = 0.5  # by which a step of an optimiser may leave 0 to 1; larger values are in other units


@dataclass(frozen=True)
class Batch:
    """What a batch of pictures shows.

    Attributes:
        views: The frame of each picture.
        patches: Pairs of patch and texture of each picture.
        names: Of the textures, in the order in which they are given.
        quantise: Whether textures and pictures are rounded to 8 bits.
    """

    views: Sequence[JointView]
    patches: Sequence[tuple[tuple[str, str], ...]]
    names: tuple[str, ...]
    quantise: bool

    def pictures(self, textures: Sequence[torch.Tensor]) -> list[NDArray[np.generic]]:
        """Return the pictures [H, W, 3] of textures [1 or n, 3, h, w]."""
        values = [_clipped(name, given) for name, given in zip(self.names, textures, strict=True)]
        pictures: list[NDArray[np.generic]] = []
        for number, view in enumerate(self.views):
            shown = self._shown(values, number)
            if self.quantise:
                images = {patch: as_image(patch, texture) for patch, texture in shown.items()}
                pictures.append(view.render(images) / np.float32(255.0))
            else:
                pictures.append(view.forward(shown))
        sizes = {f"{picture.shape[1]} x {picture.shape[0]}" for picture in pictures}
        if len(sizes) > 1:
            raise InputError(
                f"pictures of {' and '.join(sorted(sizes))} pixels are no batch; choose frames of one size"
            )
        return pictures

    def gradients(self, textures: Sequence[torch.Tensor], gradients: NDArray[np.float64]) -> list[Values]:
        """Return the gradients [1 or n, h, w, 3] of textures, summed in the order of pictures and patches.

        Args:
            textures: [1 or n, 3, h, w].
            gradients: Of the pictures, [n, H, W, 3].
        """
        given = [as_array_of(name, tensor) for name, tensor in zip(self.names, textures, strict=True)]
        values = [np.clip(texture, 0.0, 1.0) for texture in given]
        totals = {name: np.zeros(texture.shape) for name, texture in zip(self.names, values, strict=True)}
        for number, (view, gradient) in enumerate(zip(self.views, gradients, strict=True)):
            found = view.backward(self._shown(values, number), gradient)
            for patch, texture in self.patches[number]:
                at = number if len(totals[texture]) > 1 else 0
                totals[texture][at] = totals[texture][at] + found[patch]
        return [
            np.where(clipped != texture, 0.0, total)
            for clipped, texture, total in zip(values, given, totals.values(), strict=True)
        ]

    def _shown(self, values: Sequence[Values], number: int) -> dict[str, Values]:
        """Return the texture of each patch in a picture."""
        by_name = dict(zip(self.names, values, strict=True))
        return {
            patch: by_name[texture][number if len(by_name[texture]) > 1 else 0]
            for patch, texture in self.patches[number]
        }


class Pictures(torch.autograd.Function):
    """Pictures of textures."""

    @staticmethod
    def forward(batch: Batch, *textures: torch.Tensor) -> torch.Tensor:
        """Return the pictures [n, 3, H, W]."""
        stacked = np.ascontiguousarray(np.stack(batch.pictures(textures)).transpose(0, 3, 1, 2))
        return torch.from_numpy(stacked).to(dtype=textures[0].dtype, device=textures[0].device)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: torch.Tensor) -> None:
        """Keep what the gradient needs."""
        ctx.batch = inputs[0]
        ctx.save_for_backward(*inputs[1:])

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        """Return the gradients of the textures."""
        return None, *Gradients.apply(ctx.batch, gradients[0], *ctx.saved_tensors)

    @staticmethod
    def vmap(info: Any, in_dims: tuple[int | None, ...], batch: Batch, *textures: torch.Tensor) -> tuple[Any, int]:
        """Return the pictures of each element of a batch of textures."""
        each = [Pictures.apply(batch, *_element(textures, in_dims[1:], k)) for k in range(info.batch_size)]
        return torch.stack(each), 0


class Gradients(torch.autograd.Function):
    """The gradients of textures, which have no derivative themselves."""

    @staticmethod
    def forward(batch: Batch, gradient: torch.Tensor, *textures: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return the gradient of each texture, of that of the pictures."""
        pictures = gradient.detach().cpu().to(torch.float64).numpy().transpose(0, 2, 3, 1)
        found = zip(batch.gradients(textures, pictures), textures, strict=True)
        return tuple(
            torch.from_numpy(np.ascontiguousarray(total.transpose(0, 3, 1, 2))).to(
                dtype=texture.dtype, device=texture.device
            )
            for total, texture in found
        )

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[torch.Tensor, ...]) -> None:
        """Nothing is kept."""

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        """Raise InputError."""
        raise InputError("the gradient of a SceneView cannot be differentiated again; use no penalty on gradients")

    @staticmethod
    def vmap(
        info: Any, in_dims: tuple[int | None, ...], batch: Batch, *given: torch.Tensor
    ) -> tuple[tuple[torch.Tensor, ...], tuple[int, ...]]:
        """Return the gradients of each element of a batch."""
        each = [Gradients.apply(batch, *_element(given, in_dims[1:], k)) for k in range(info.batch_size)]
        found = tuple(torch.stack(parts) for parts in zip(*each, strict=True))
        return found, (0,) * len(found)


def check_texture(name: str, texture: object) -> torch.Tensor:
    """Return a texture; raise InputError if it is not a tensor of floats [3, h, w] or [n, 3, h, w]."""
    if isinstance(texture, torch.Tensor):
        image = texture.ndim in (3, 4) and texture.shape[-3] == 3 and texture.numel()
        if image and texture.is_floating_point():
            return texture
        kind = f"{texture.dtype} of the shape {tuple(texture.shape)}"
    else:
        kind = type(texture).__name__
    raise InputError(
        f"the texture of {name} is {kind}; give a tensor [1, 3, height, width] of floats from 0 to 1, such as 8-bit"
        " values divided by 255"
    )


def as_array_of(name: str, textures: torch.Tensor) -> Values:
    """Return textures as float64 [n, h, w, 3]; raise InputError as `as_array` does."""
    return np.stack([as_array(name, texture).astype(np.float64) for texture in textures])


def _clipped(name: str, textures: torch.Tensor) -> Values:
    """Return textures, clipped to 0 to 1, as float64 [n, h, w, 3]; raise InputError if values are far outside."""
    values = as_array_of(name, textures)
    low, high = float(values.min()), float(values.max())
    if low < -_EXCESS or high > 1.0 + _EXCESS:
        raise InputError(
            f"the texture of {name} has values from {low:g} to {high:g}; textures are from 0 to 1: divide 8-bit values"
            " by 255, and clamp the texture after each step",
            code=Code.OUT_OF_RANGE,
        )
    clipped: Values = np.clip(values, 0.0, 1.0)
    return clipped


def _element(tensors: Sequence[torch.Tensor], dims: Sequence[int | None], number: int) -> list[torch.Tensor]:
    """Return an element of each batched tensor."""
    return [t if dim is None else t.select(dim, number) for t, dim in zip(tensors, dims, strict=True)]
