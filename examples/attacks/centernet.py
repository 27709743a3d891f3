"""CenterNet with MobileNetV3 (Zhou et al., "Objects as Points", 2019): a detector without anchors.

Each place of a grid has a score of each label, for an object whose centre is there, and the box of that object.
"""

from __future__ import annotations

import torch
from torch.nn import functional

from examples.attacks.detector import Detector, resized, scaled

SIDE = 512  # pixels: height and width of the network's input
OUTPUTS = ("tower_0/CenternetHead/centernet_cls_output/BiasAdd", "tower_0/wh")
PERSON = 0  # the first of COCO's 80 labels

_STRIDE = 4  # pixels between places


class CenterNet(Detector):
    """The detector.

    Args:
        network: From pictures [n, 512, 512, 3], 0 to 255, to logits [n, 128, 128, 80], and the distances
            [n, 128, 128, 4] from each place to its box's left, top, right and bottom, pixels.
    """

    person = PERSON

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network

    def raw(self, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """As `Detector.raw`, for all places of the grid, row by row."""
        logits, distances = self.network(resized(pictures, SIDE).permute(0, 2, 3, 1) * 255)
        steps = torch.arange(SIDE // _STRIDE) * float(_STRIDE)
        y, x = torch.meshgrid(steps, steps, indexing="ij")
        middle = torch.stack([x, y], dim=-1)
        boxes = torch.cat([middle - distances[..., :2], middle + distances[..., 2:]], dim=-1)
        return scaled(boxes.flatten(1, 2), pictures, SIDE), logits.flatten(1, 2)

    def scores(self, logits: torch.Tensor) -> torch.Tensor:
        """As `Detector.scores`: the places whose score is the greatest of the 3 x 3 around are candidates."""
        side = SIDE // _STRIDE
        grid = logits.sigmoid().unflatten(1, (side, side)).permute(0, 3, 1, 2)
        peaks = grid * (functional.max_pool2d(grid, 3, stride=1, padding=1) == grid)
        return peaks.permute(0, 2, 3, 1).flatten(1, 2)
