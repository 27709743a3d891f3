"""Projected gradient descent of the Adversarial Robustness Toolbox (ART) on the texture of a patch.

    view = SceneView("recipes/attacks/poster.yaml", "poster", [("weather=rainy,insertion=rendered", 3)])
    detector = torchvision.models.detection.ssdlite320_mobilenet_v3_large(weights="DEFAULT")
    texture = attack(view, detector, numpy.full((1, 3, 288, 384), 0.5, numpy.float32), steps=100)

Estimator and attack are ART's, unchanged: the texture is the model's input, and the renderer is its first layer.
Requires `torch`, `torchvision` and `adversarial-robustness-toolbox`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from art.attacks.evasion import ProjectedGradientDescent
from art.estimators.object_detection import PyTorchObjectDetector
from numpy.typing import NDArray
from recipe_compiler.ir.semantic_tags import Tag
from recipe_runtime.torch import SceneView

COCO: dict[int, int] = {Tag.PEDESTRIAN: 1, Tag.BICYCLE: 2, Tag.CAR: 3, Tag.MOTORCYCLE: 4, Tag.BUS: 6, Tag.TRUCK: 8}

Target = dict[str, torch.Tensor]
Texture = NDArray[np.float32]


class ThroughScene(torch.nn.Module):
    """A detector whose input is a texture: it is shown the pictures of a view.

    ART has one target for one texture. A view has many frames, so their own targets are used.
    """

    def __init__(self, view: SceneView, detector: torch.nn.Module, classes: Mapping[int, int]) -> None:
        super().__init__()
        self.view, self.detector, self.classes = view, detector, classes

    def forward(self, texture: torch.Tensor, _: object = None) -> object:
        """Return the losses of the detector in training mode, its detections in each picture in evaluation mode."""
        pictures, targets = self.view(texture)
        return self.detector(list(pictures), [in_classes(target, self.classes) for target in targets])


def attack(
    view: SceneView,
    detector: torch.nn.Module,
    texture: Texture,
    *,
    steps: int,
    step: float = 4 / 255,
    losses: tuple[str, ...] = ("classification", "bbox_regression"),
    classes: Mapping[int, int] = COCO,
) -> Texture:
    """Return a texture with which a detector's losses are greater, over all frames of a view.

    Args:
        view: The frames.
        detector: With the interface of torchvision's detectors.
        texture: To start from, [1, 3, h, w], 0 to 1.
        steps: Number of steps.
        step: By which each value changes in a step.
        losses: Names of the losses to raise; the default is those of torchvision's SSD and RetinaNet.
        classes: The detector's class of each CARLA tag; objects of other tags are left out.
    """
    model = ThroughScene(view, detector, classes)
    estimator = PyTorchObjectDetector(model, clip_values=(0, 1), attack_losses=losses, device_type="cpu")
    attacker = ProjectedGradientDescent(estimator, eps=1.0, eps_step=step, max_iter=steps, verbose=False)
    found: Texture = attacker.generate(texture)
    return found


def in_classes(target: Target, classes: Mapping[int, int]) -> Target:
    """Return the boxes of a target whose CARLA tag has a class, with that class as their label."""
    tags = target["labels"].tolist()
    kept = [k for k, tag in enumerate(tags) if tag in classes]
    return {"boxes": target["boxes"][kept], "labels": torch.tensor([classes[tags[k]] for k in kept])}
