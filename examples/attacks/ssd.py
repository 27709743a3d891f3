"""SSD-MobileNetV2: anchors, boxes and scores."""

from __future__ import annotations

import torch
from torch.nn import functional

from examples.attacks.detector import Detector, resized, scaled

SIZE = 300  # pixels: height and width of a picture
LABELS = (
    "background", "Bicycle", "Boot", "Laptop", "Person", "Chair", "Cattle", "Desk", "Cat", "Computer mouse",
    "Computer monitor", "Box", "Mug", "Coffee cup", "Stationary bicycle", "Table", "Bottle", "High heels", "Vehicle",
    "Footwear", "Dog", "Book", "Camera", "Car",
)  # fmt: skip
PERSON = LABELS.index("Person")

_STRIDES = (16, 32, 64, 128, 256, 512)  # pixels between the anchors of a layer
_SCALES = (0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.0)  # side of a layer's anchors, and of an imagined next layer
_BOX_SCALES = (10.0, 10.0, 5.0, 5.0)


class Ssd(Detector):
    """The detector.

    Args:
        network: From pictures [n, 300, 300, 3], -1 to 1, to box encodings [n, 1917, 4] and logits [n, 1917, 24].
    """

    person = PERSON
    _anchors: torch.Tensor

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("_anchors", anchors())

    def raw(self, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """As `Detector.raw`, for all anchors."""
        encoded, logits = self.network(resized(pictures, SIZE).permute(0, 2, 3, 1) * 2 - 1)
        return scaled(decode(encoded, self._anchors), pictures, SIZE), logits

    def scores(self, logits: torch.Tensor) -> torch.Tensor:
        """As `Detector.scores`; the background is no candidate."""
        return functional.pad(logits[..., 1:].sigmoid(), (1, 0))


def anchors() -> torch.Tensor:
    """Return the anchors [1917, 4]: y and x of the middle, height, width; 0 to 1."""
    rows = []
    for layer, stride in enumerate(_STRIDES):
        scale, side = _SCALES[layer], -(-SIZE // stride)
        shapes = [(scale, 1.0), (scale, 2.0), (scale, 0.5), (scale, 3.0), (scale, 0.3333)]
        shapes.append(((scale * _SCALES[layer + 1]) ** 0.5, 1.0))
        if layer == 0:  # fewer, since it has most places
            shapes = [(0.1, 1.0), (scale, 2.0), (scale, 0.5)]
        rows += [
            ((y + 0.5) / side, (x + 0.5) / side, scale / ratio**0.5, scale * ratio**0.5)
            for y in range(side)
            for x in range(side)
            for scale, ratio in shapes
        ]
    return torch.tensor(rows)


def decode(encoded: torch.Tensor, around: torch.Tensor) -> torch.Tensor:
    """Return boxes [n, K, 4], x0, y0, x1, y1 in pixels, of box encodings [n, K, 4] about anchors [K, 4]."""
    scaled = encoded / torch.tensor(_BOX_SCALES)
    middle = scaled[..., :2] * around[:, 2:] + around[:, :2]
    half = scaled[..., 2:].exp() * around[:, 2:] / 2
    return torch.cat([(middle - half).flip(-1), (middle + half).flip(-1)], dim=-1) * SIZE
