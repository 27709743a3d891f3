"""Pictures of a texture as a function that PyTorch differentiates."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from recipe_compiler.ir.errors import InputError

from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.textures import as_array, as_image


class Pictures(torch.autograd.Function):
    """Pictures of a texture in several views; gradients are summed in the order of the views."""

    @staticmethod
    def forward(ctx: Any, texture: torch.Tensor, views: list[TextureView], quantise: bool) -> torch.Tensor:
        """Return the pictures."""
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
        """Return the gradient of the texture."""
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
