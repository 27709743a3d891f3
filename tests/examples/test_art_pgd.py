"""Projected gradient descent of ART through the renderer, with a small detector. `make test-torch`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime

from tests.examples.stand_ins import provide_torchvision
from tests.runtime.attacks.test_textures import RENDERED, recipe_with

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")
pytest.importorskip("art", reason="ART is not installed (adversarial-robustness-toolbox)")

FRAMES = [(RENDERED, 0), ("weather=clear,insertion=rendered", 2)]


@pytest.fixture
def torchvision(monkeypatch: pytest.MonkeyPatch) -> None:
    provide_torchvision(monkeypatch)


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recipe_with(tmp_path_factory.mktemp("art"), "first")


@pytest.mark.usefixtures("torchvision")
@pytest.mark.parametrize(("approach", "sign"), [(False, 1.0), (True, -1.0)], ids=["miss", "see"])
def test_arts_descent_changes_the_loss_in_the_rendered_frames(recipe: Path, approach: bool, sign: float) -> None:
    """The loss in frames of `Scenario.render` changes by more than with a random texture; two runs give equal bytes."""
    from recipe_runtime.torch import SceneView

    from examples.attacks.art_pgd import attack
    from examples.attacks.cell_detector import CellDetector

    view, detector = SceneView(recipe, "poster", FRAMES), CellDetector()
    scenes = {variant: recipe_runtime.open(recipe, variant) for variant, _ in FRAMES}
    start = np.full((1, 3, 7, 9), 0.5, np.float32)
    targets = [{"boxes": t["boxes"], "labels": torch.ones_like(t["labels"])} for t in view(torch.from_numpy(start))[1]]
    assert len(targets) == 2 and all(len(target["boxes"]) for target in targets)

    def loss(texture: Any) -> float:
        image = {"poster": texture[0].transpose(1, 2, 0)}
        pictures = [scenes[variant].render(frame, textures=image) for variant, frame in FRAMES]
        tensors = [torch.from_numpy(picture.transpose(2, 0, 1).copy()) / 255 for picture in pictures]
        return float(detector.train()(tensors, targets)["classification"].detach())

    found = attack(view, detector, targets, start, steps=12, step=0.06, approach=approach)
    assert found.shape == start.shape and found.min() >= 0.0 and found.max() <= 1.0
    noise = np.random.default_rng(0).uniform(size=start.shape).astype(np.float32)
    assert sign * (loss(found) - loss(start)) > 2 * abs(loss(noise) - loss(start))
    again = attack(view, detector, targets, start, steps=12, step=0.06, approach=approach)
    np.testing.assert_array_equal(found, again)
