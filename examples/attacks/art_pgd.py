"""Projected gradient descent of the Adversarial Robustness Toolbox (ART) on the texture of a patch.

    view = SceneView("recipes/attacks/poster.yaml", "poster", [("weather=rainy,insertion=rendered", 3)])
    texture = attack(view, detector, targets, numpy.full((1, 3, 288, 384), 0.5, numpy.float32), steps=100)

Estimator and attack are ART's, unchanged: the texture is the model's input, and the renderer is its first layer.
Requires `torch`, `torchvision` and `adversarial-robustness-toolbox`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from art.attacks.evasion import ProjectedGradientDescent
from art.estimators.object_detection import PyTorchObjectDetector
from numpy.typing import NDArray
from recipe_runtime.torch import SceneView

LOSSES = ("classification", "bbox_regression")  # of torchvision's SSD and RetinaNet

Target = dict[str, torch.Tensor]
Texture = NDArray[np.float32]


class ThroughScene(torch.nn.Module):
    """A detector whose input is a texture: it is shown all pictures of a view.

    ART has one target for an input, which is a texture here. The targets of its pictures are given in advance.
    """

    def __init__(self, view: SceneView, detector: torch.nn.Module, targets: Sequence[Target]) -> None:
        super().__init__()
        self.view, self.detector, self.targets = view, detector, targets

    def forward(self, texture: torch.Tensor, _: object = None) -> object:
        """Return the losses of the detector in training mode, its detections in each picture in evaluation mode."""
        return self.detector(list(self.view.pictures(texture)), self.targets)


def attack(
    view: SceneView,
    detector: torch.nn.Module,
    targets: Sequence[Target],
    texture: Texture,
    *,
    steps: int,
    step: float = 4 / 255,
    reach: float = 1.0,
    approach: bool = False,
) -> Texture:
    """Return a texture that makes a detector miss the targets in all frames of a view, or see them.

    Args:
        view: The frames.
        detector: With the interface of torchvision's detectors, and losses of `LOSSES`.
        targets: `boxes` and `labels` of each frame; the labels are the detector's.
        texture: To start from, [1, 3, h, w], 0 to 1.
        steps: Number of steps.
        step: By which each value changes in a step.
        reach: By which it may change in all.
        approach: Whether the detector is to see the targets.
    """
    model = ThroughScene(view, detector, targets)
    estimator = PyTorchObjectDetector(model, clip_values=(0, 1), attack_losses=LOSSES, device_type="cpu")
    settings = {"eps": reach, "eps_step": step, "max_iter": steps, "targeted": approach, "verbose": False}
    found: Texture = ProjectedGradientDescent(estimator, **settings).generate(texture, y=[targets[0]])
    return found
