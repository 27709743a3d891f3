"""The optimisation, with a small fake view and detector. `make test-torch`."""

from __future__ import annotations

from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


class FlatView:
    """A view whose pictures are the texture at two exposures."""

    frames = (("bright", 0), ("dark", 0))

    def pictures(self, texture: Any, batch: int | None = None, step: int = 0) -> Any:
        assert batch == 1
        return texture * (1.0, 0.5)[step % 2]


class MeanDetector:
    """A detector whose score is high where pictures are bright."""

    def object_logits(self, pictures: Any, boxes: Any, labels: Any) -> Any:
        assert len(pictures) == len(boxes) == len(labels)
        return 8 * pictures.mean(dim=(1, 2, 3)) - 4, boxes


@pytest.fixture
def goal() -> Any:
    from examples.attacks.attack import Goal

    return Goal(MeanDetector(), torch.zeros(2, 4), 4)  # type: ignore[arg-type, unused-ignore]


def test_an_attack_raises_the_score_within_its_limits(goal: Any) -> None:
    from examples.attacks.attack import Bounds, optimise, scores

    near = torch.full((1, 3, 4, 4), 0.5)
    (early, found), losses = optimise(FlatView(), goal, near, Bounds(near, 0.3), steps=[5, 20], batch=2, seed=1)  # type: ignore[arg-type, unused-ignore]
    assert len(losses) == 20 and losses[-1] < losses[0]
    torch.testing.assert_close(found, near + 0.3)
    assert near.mean() < early.mean() < found.mean()
    ((bright, dark),) = scores(FlatView(), [goal], found)  # type: ignore[arg-type, unused-ignore]
    assert bright == pytest.approx(0.9168, abs=1e-3) and dark < bright


def test_equal_seeds_give_equal_textures(goal: Any) -> None:
    from examples.attacks.attack import Bounds, optimise

    near = torch.rand((1, 3, 4, 4), generator=torch.Generator().manual_seed(0))
    one, again, other = (
        optimise(FlatView(), goal, near, Bounds(near, 1), steps=[3], batch=1, seed=seed)[0][0]  # type: ignore[arg-type, unused-ignore]
        for seed in (1, 1, 2)
    )
    assert torch.equal(one, again) and not torch.equal(one, other)


def test_the_gradient_is_that_of_one_frame(goal: Any) -> None:
    from examples.attacks.attack import gradient

    texture = torch.full((1, 3, 4, 4), 0.5)
    bright, dark = (gradient(FlatView(), goal, texture, frame) for frame in (0, 1))  # type: ignore[arg-type, unused-ignore]
    assert (bright < 0).all() and not torch.allclose(bright, dark)


def test_the_texture_is_changed_before_each_picture(goal: Any) -> None:
    """A change that inverts textures makes the attack darken them; it draws from one generator, by the seed."""
    from examples.attacks.attack import Bounds, optimise

    drawn = []

    def inverted(texture: Any, generator: Any) -> Any:
        drawn.append(float(torch.rand(1, generator=generator)))
        return 1 - texture

    near = torch.full((1, 3, 4, 4), 0.5)
    for _ in range(2):
        (found,), _ = optimise(
            FlatView(),  # type: ignore[arg-type, unused-ignore]
            goal,
            near,
            Bounds(near, 0.3),
            steps=[9],
            batch=2,
            seed=4,
            change=inverted,
        )
        torch.testing.assert_close(found, near - 0.3)
    assert len(set(drawn)) == 18 and drawn[:18] == drawn[18:]
