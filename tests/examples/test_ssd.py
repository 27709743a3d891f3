"""Anchors, boxes and scores of SSD, from a network with known outputs. `make test-torch`."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


class FixedNetwork(torch.nn.Module):  # type: ignore[name-defined, misc, unused-ignore]
    """Logits that depend on the first pixel's red value, and boxes that are the anchors."""

    def __init__(self, places: dict[tuple[int, int], float]) -> None:
        super().__init__()
        self.logits = torch.full((1917, 24), -9.0)
        for (anchor, label), logit in places.items():
            self.logits[anchor, label] = logit

    def forward(self, pictures: Any) -> Any:
        assert pictures.shape[1:] == (300, 300, 3)
        return torch.zeros((len(pictures), 1917, 4)), self.logits + pictures[:, 0, 0, :1, None]


def detector(places: dict[tuple[int, int], float]) -> Any:
    from examples.attacks.ssd import Ssd

    return Ssd(FixedNetwork(places))


def test_anchors_are_those_of_the_six_layers() -> None:
    from examples.attacks.ssd import anchors

    found = anchors()
    assert found.shape == (1917, 4)
    layers = [0, 19 * 19 * 3, 1083 + 600, 1683 + 150, 1833 + 54, 1887 + 24]
    sides, scales = [19, 10, 5, 3, 2, 1], [0.1, 0.35, 0.5, 0.65, 0.8, 0.95]
    for first, side, scale in zip(layers, sides, scales, strict=True):
        torch.testing.assert_close(found[first], torch.tensor([0.5 / side, 0.5 / side, scale, scale]))
    torch.testing.assert_close(found[-1], torch.tensor([0.5, 0.5, 0.95**0.5, 0.95**0.5]))
    wide = found[1084]  # ratio 2
    torch.testing.assert_close(wide[3] / wide[2], torch.tensor(2.0))


def test_a_box_is_scaled_and_shifted_relative_to_its_anchor() -> None:
    from examples.attacks.ssd import decode

    around = torch.tensor([[0.5, 0.4, 0.2, 0.1]])
    encoded = torch.tensor(
        [[[1.0, -2.0, 5 * 0.6931472, 0.0]]]
    )  # shifted down by 0.1 of the height and left; twice as high
    torch.testing.assert_close(decode(encoded, around)[0, 0], torch.tensor([99.0, 96.0, 129.0, 216.0]))


def test_overlap_of_boxes() -> None:
    from examples.attacks.detector import intersection_over_union

    box = torch.tensor([0.0, 0.0, 2.0, 2.0])
    others = torch.tensor([[0.0, 0.0, 2.0, 2.0], [1.0, 0.0, 3.0, 2.0], [2.0, 0.0, 4.0, 2.0], [5.0, 5.0, 6.0, 6.0]])
    torch.testing.assert_close(intersection_over_union(box, others), torch.tensor([1, 1 / 3, 0, 0]))


def test_detections_are_the_best_of_overlapping_boxes() -> None:
    """Anchors 1683 and 1688 of the layer of 5 x 5 have one centre; 1893 is far away."""
    model = detector({(1683, 4): 2.0, (1688, 4): 1.0, (1893, 4): 0.5, (1683, 23): 0.0}).eval()
    (found,) = model([torch.full((3, 300, 300), 0.5)])
    assert found["labels"].tolist() == [4, 4, 23]
    torch.testing.assert_close(found["scores"], torch.tensor([2.0, 0.5, 0.0]).sigmoid())
    boxes, _ = model.raw(torch.zeros(1, 3, 300, 300))
    torch.testing.assert_close(found["boxes"], boxes[0, [1683, 1893, 1683]])


def test_the_loss_is_that_of_the_best_box_on_the_target() -> None:
    """A high score elsewhere does not count; the gradient reaches the picture."""
    model = detector({(1683, 4): 2.0, (1893, 4): 8.0}).train()
    boxes, _ = model.raw(torch.zeros(1, 3, 300, 300))
    picture = torch.full((3, 300, 300), 0.5, requires_grad=True)
    target = {"boxes": boxes[0, 1683:1684], "labels": torch.tensor([4])}
    loss = model([picture], [target])["classification"]
    assert float(loss.detach()) == pytest.approx(0.126928, abs=1e-5)  # log(1 + exp(-2))
    loss.backward()
    assert float(picture.grad[0, 0, 0]) < 0
    nothing = model([picture], [{"boxes": torch.zeros(0, 4), "labels": torch.zeros(0, dtype=torch.int64)}])
    assert float(nothing["classification"].detach()) == 0


def test_a_picture_of_another_size_gives_boxes_in_its_own_pixels() -> None:
    model = detector({(1683, 4): 2.0})
    boxes, _ = model.raw(torch.zeros(1, 3, 300, 300))
    wide, _ = model.raw(torch.zeros(1, 3, 150, 600))
    torch.testing.assert_close(wide, boxes * torch.tensor([2.0, 0.5, 2.0, 0.5]))
