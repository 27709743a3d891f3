"""Three ways to see a texture in a frame: rendered, with MART's false gradient, and warped in digitally.

All have `frames` and `pictures` of `SceneView`.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import torch
from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.attacks.texture_view import TextureView
from recipe_runtime.attacks.truth import PatchRecord
from recipe_runtime.scenario import Scenario
from recipe_runtime.torch import Place
from torch.nn import functional


class View(Protocol):
    """Pictures of frames as a function of a texture."""

    frames: list[Place]

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """As `SceneView.pictures`."""


class DigitalView:
    """Frames with a texture warped into the finished picture by the patch's homography, without light or weather.

    Args:
        scenarios: The variants by name.
        patch: Name of a patch on a rectangle.
        frames: Pairs of variant and frame number.
    """

    def __init__(self, scenarios: dict[str, Scenario], patch: str, frames: Sequence[Place]) -> None:
        self.frames = list(frames)
        self._parts = [_part(scenarios[variant], patch, frame) for variant, frame in self.frames]

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """As `SceneView.pictures`."""
        size = len(self.frames) if batch is None else batch
        parts = [self._parts[(step * size + k) % len(self._parts)] for k in range(size)]
        grids = torch.stack([grid for _, _, grid in parts])
        shown = functional.grid_sample(
            texture.expand(size, -1, -1, -1), grids, padding_mode="border", align_corners=False
        )
        masks = torch.stack([mask for _, mask, _ in parts])[:, None]
        return torch.where(masks, shown, torch.stack([picture for picture, _, _ in parts]))


class RenderedView:
    """Rendered frames, as `SceneView` has them, without the renderers: hundreds of frames fit into memory.

    The linear map from texture to picture is kept, and its values are rounded where a build rounds: of 10,000 pixels,
    one may differ by one level.

    Args:
        scenarios: The variants by name. They are closed, and open themselves again when needed.
        patch: Name of a patch of mode `rendered`.
        frames: Pairs of variant and frame number.
        size: Height and width of the texture.
    """

    def __init__(
        self, scenarios: dict[str, Scenario], patch: str, frames: Sequence[Place], size: tuple[int, int]
    ) -> None:
        self.frames = list(frames)
        self._views = []
        for variant, frame in self.frames:
            view = copy.copy(scenarios[variant].patch_view(frame, patch, size=size))
            del vars(view)["_frame"]  # the renderer of the scene, 100 MB, which `rounded` and `backward` do not use
            self._views.append(view)
            scenarios[variant].close()

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """As `SceneView.pictures`."""
        size = len(self.frames) if batch is None else batch
        shown = [_Rendered.apply(texture, self._views[(step * size + k) % len(self.frames)]) for k in range(size)]  # type: ignore[no-untyped-call, unused-ignore]
        return torch.cat(shown)


class _Rendered(torch.autograd.Function):
    """A picture [1, 3, H, W] of a texture in a frame."""

    @staticmethod
    def forward(ctx: Any, texture: torch.Tensor, view: TextureView) -> torch.Tensor:
        """Return the picture."""
        ctx.view, ctx.values = view, texture.detach()[0].permute(1, 2, 0).numpy().astype(np.float64)
        picture = view.rounded(np.rint(ctx.values * 255).astype(np.uint8))
        return torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float32) / np.float32(255))

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None]:
        """Return the gradient of the texture."""
        gradient = gradients[0][0].permute(1, 2, 0).numpy().astype(np.float64)
        return torch.from_numpy(
            ctx.view.backward(ctx.values, gradient).transpose(2, 0, 1)[None].astype(np.float32)
        ), None


class FalseGradientView:
    """Rendered pictures with the gradient of a warp, as MART has it: without light, weather and the camera's curve.

    Args:
        rendered: What is seen.
        warped: Whose gradient is taken; with the same frames.
    """

    def __init__(self, rendered: View, warped: DigitalView) -> None:
        self.frames, self._rendered, self._warped = rendered.frames, rendered, warped

    def pictures(self, texture: torch.Tensor, batch: int | None = None, step: int = 0) -> torch.Tensor:
        """As `SceneView.pictures`."""
        warped = self._warped.pictures(texture, batch, step)
        with torch.no_grad():
            apart = self._rendered.pictures(texture, batch, step) - warped
        return warped + apart


def patch_record(scenario: Scenario, patch: str, frame: int) -> PatchRecord:
    """Return the truth of a patch in a frame."""
    return next(record for record in scenario.patches(frame)["patches"] if record["name"] == patch)


def patch_box(record: PatchRecord) -> torch.Tensor:
    """Return the box [4] about a patch's corners, x0, y0, x1, y1 in pixels."""
    corners = torch.tensor(record["corners"])
    return torch.cat([corners.amin(dim=0), corners.amax(dim=0)])


def sampling_grid(homography: Sequence[Sequence[float]], width: int, height: int) -> torch.Tensor:
    """Return where in a texture each pixel of a picture lies, [height, width, 2], as `grid_sample` takes it.

    Args:
        homography: From (u, v, 1) of the texture, 0 to 1 each, to pixels, as the truth of a patch has it.
        width: Of the picture, pixels.
        height: Of the picture, pixels.
    """
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    points = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(np.array(homography)).T
    with np.errstate(divide="ignore", invalid="ignore"):
        places = np.nan_to_num(points[..., :2] / points[..., 2:] * 2 - 1, nan=0.0, posinf=2.0, neginf=-2.0)
    return torch.tensor(places.clip(-2, 2), dtype=torch.float32)


def _part(scenario: Scenario, patch: str, frame: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return a frame's picture [3, H, W], the mask [H, W] of the patch, and the grid of its homography."""
    picture = np.asarray(scenario.render(frame), np.float32) / 255
    height, width = picture.shape[:2]
    record = patch_record(scenario, patch, frame)
    if record["counts"] is None or record["homography"] is None:
        raise ValueError(f"{scenario.variant} shows no rectangle {patch} in frame {frame}")
    mask = unpacked(record["counts"], width, height) > 0
    grid = sampling_grid(record["homography"], width, height)
    return torch.tensor(picture.transpose(2, 0, 1)), torch.tensor(mask), grid
