"""Pictures of textures as a function that PyTorch differentiates, and maps over batches of textures (`torch.func`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import torch
from recipe_compiler.ir.errors import Code, InputError

from recipe_runtime.attacks.joint_view import JointView
from recipe_runtime.render.retexture.tensor_exchange import on_stream

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

    def pictures(self, textures: Sequence[torch.Tensor]) -> torch.Tensor:
        """Return the pictures [n, 3, H, W], float32 if they are quantised, else float64, of textures [1 or n, 3, h, w].

        They are on the renderer's device, and nothing is copied from it if the textures are there as well.
        """
        sizes = {f"{view.picture.shape[1]} x {view.picture.shape[0]}" for view in self.views}
        if len(sizes) > 1:
            raise InputError(
                f"pictures of {' and '.join(sorted(sizes))} pixels are no batch; choose frames of one size"
            )
        values = [_clipped(name, given, self.device) for name, given in zip(self.names, textures, strict=True)]
        shape, dtype = self.views[0].picture.shape, torch.float32 if self.quantise else torch.float64
        out = torch.empty((len(self.views), 3, shape[0], shape[1]), dtype=dtype, device=self.device)
        with _on_its_stream(out):
            for number, view in enumerate(self.views):
                view.write_picture(self._shown(values, number), out[number], self.quantise)
        return out

    def gradients(self, textures: Sequence[torch.Tensor], gradients: torch.Tensor) -> list[torch.Tensor]:
        """Return the gradients [1 or n, 3, h, w] of textures, float64, summed in the order of pictures and patches.

        Args:
            textures: [1 or n, 3, h, w].
            gradients: Of the pictures, [n, 3, H, W].
        """
        given = [_float64(texture, self.device) for texture in textures]
        values = [texture.clamp(0.0, 1.0) for texture in given]
        totals = {name: torch.zeros_like(texture) for name, texture in zip(self.names, values, strict=True)}
        upstream = _float64(gradients, self.device)
        with _on_its_stream(upstream):
            for number, view in enumerate(self.views):
                shown = self._shown(values, number)
                found = {patch: torch.empty_like(texture) for patch, texture in shown.items()}
                view.write_gradients(shown, upstream[number], found)
                for patch, texture in self.patches[number]:
                    totals[texture][number if len(totals[texture]) > 1 else 0] += found[patch]
        return [
            torch.where(clipped != texture, 0.0, total)
            for clipped, texture, total in zip(values, given, totals.values(), strict=True)
        ]

    @property
    def device(self) -> torch.device:
        """The renderer's device.

        Raises:
            InputError: The views are on several devices.
        """
        devices = sorted({view.device for view in self.views})
        if len(devices) > 1:
            raise InputError(f"a batch has pictures of the devices {' and '.join(devices)}; choose one device")
        return torch.device(devices[0])

    def _shown(self, values: Sequence[torch.Tensor], number: int) -> dict[str, torch.Tensor]:
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
        return batch.pictures(textures).to(dtype=textures[0].dtype, device=textures[0].device)

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
    def vmap(
        info: Any, in_dims: tuple[int | None, ...], batch: Batch, *textures: torch.Tensor
    ) -> tuple[torch.Tensor, int]:
        """Return the pictures of each element of a batch of textures."""
        each = [Pictures.apply(batch, *_element(textures, in_dims[1:], k)) for k in range(info.batch_size)]
        return torch.stack(each), 0


class Gradients(torch.autograd.Function):
    """The gradients of textures, which have no derivative themselves."""

    @staticmethod
    def forward(batch: Batch, gradient: torch.Tensor, *textures: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return the gradient of each texture, of that of the pictures."""
        found = zip(batch.gradients(textures, gradient), textures, strict=True)
        return tuple(total.to(dtype=texture.dtype, device=texture.device) for total, texture in found)

    @staticmethod
    def setup_context(ctx: object, inputs: tuple[object, ...], output: tuple[torch.Tensor, ...]) -> None:
        """Nothing is kept."""

    @staticmethod
    def backward(ctx: object, *gradients: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
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


def _float64(tensor: torch.Tensor, device: torch.device) -> torch.Tensor:
    return tensor.detach().to(device, torch.float64).contiguous()


def _clipped(name: str, textures: torch.Tensor, device: torch.device) -> torch.Tensor:
    """Return textures, clipped to 0 to 1, as float64; raise InputError if values are far outside or not finite."""
    values = _float64(textures, device)
    low, high = torch.stack(torch.aminmax(values)).tolist()  # the only numbers that a GPU sends to the host
    if not math.isfinite(low + high):
        raise InputError(f"the texture of {name} has values that are not finite; give floats from 0 to 1")
    if low < -_EXCESS or high > 1.0 + _EXCESS:
        raise InputError(
            f"the texture of {name} has values from {low:g} to {high:g}; textures are from 0 to 1: divide 8-bit values"
            " by 255, and clamp the texture after each step",
            code=Code.OUT_OF_RANGE,
        )
    return values.clamp(0.0, 1.0)


def _on_its_stream(tensor: torch.Tensor) -> AbstractContextManager[object]:
    """Return a context in which the renderer runs on the stream that PyTorch uses on a tensor's device."""
    stream = torch.cuda.current_stream(tensor.device).cuda_stream if tensor.is_cuda else 0
    return on_stream(str(tensor.device), stream)


def _element(tensors: Sequence[torch.Tensor], dims: Sequence[int | None], number: int) -> list[torch.Tensor]:
    """Return an element of each batched tensor."""
    return [t if dim is None else t.select(dim, number) for t, dim in zip(tensors, dims, strict=True)]
