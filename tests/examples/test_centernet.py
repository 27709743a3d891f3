"""Boxes, scores and detections of CenterNet, from a network with known outputs. `make test-torch`."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


class FixedNetwork(torch.nn.Module):  # type: ignore[name-defined, misc, unused-ignore]
    """Objects at two places of the grid, the first with a lower neighbour; logits rise with the first pixel's red."""

    def forward(self, pictures: Any) -> Any:
        assert pictures.shape[1:] == (512, 512, 3) and float(pictures.detach().max()) <= 255
        logits = torch.full((len(pictures), 128, 128, 80), -9.0)
        logits[:, 10, 20, 0], logits[:, 10, 21, 0], logits[:, 90, 60, 3] = 2.0, 1.0, 0.0
        distances = torch.tensor([8.0, 16.0, 24.0, 32.0]).expand(len(pictures), 128, 128, 4)
        return logits + pictures[:, :1, :1, :1] / 255, distances


@pytest.fixture
def detector() -> Any:
    from examples.attacks.centernet import CenterNet

    return CenterNet(FixedNetwork()).eval()


def test_a_box_has_given_distances_from_its_place(detector: Any) -> None:
    """Place (x, y) = (20, 10) is pixel (80, 40) of 512; a picture of half the size has half of all."""
    boxes, logits = detector.raw(torch.zeros(1, 3, 512, 512))
    assert boxes[0, 10 * 128 + 20].tolist() == [72, 24, 104, 72] and float(logits[0, 10 * 128 + 20, 0]) == 2
    halved, _ = detector.raw(torch.zeros(1, 3, 256, 256))
    torch.testing.assert_close(halved, boxes / 2)


def test_detections_are_the_peaks(detector: Any) -> None:
    """The neighbour of a peak is none, whatever its box."""
    (found,) = detector([torch.zeros(3, 256, 128)])
    assert found["labels"].tolist() == [0, 3]
    torch.testing.assert_close(found["scores"], torch.tensor([2.0, 0.0]).sigmoid())
    assert found["boxes"][0].tolist() == [18, 12, 26, 36]


def test_the_best_box_on_the_target_counts(detector: Any) -> None:
    picture = torch.zeros(1, 3, 512, 512, requires_grad=True)
    target = torch.tensor([[72.0, 24.0, 104.0, 72.0]])
    logit, box = detector.object_logits(picture, target, torch.tensor([0]))
    assert float(logit.detach()) == 2 and box.tolist() == target.tolist()
    logit.sum().backward()
    assert float(picture.grad[0, 0, 0, 0]) == pytest.approx(1)
    elsewhere, _ = detector.object_logits(picture, target + 100, torch.tensor([0]))
    assert float(elsewhere.detach()) == -9
