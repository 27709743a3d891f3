"""The study of one scene with one step, and a small detector. `make test-torch`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")


def bright(name: str) -> Any:
    """Return a detector with one box, whose score grows with the brightness of the picture."""
    from examples.attacks.detector import Detector

    class Bright(Detector):
        person = 0

        def raw(self, pictures: Any) -> Any:
            logits = 8 * pictures.mean(dim=(1, 2, 3)) - 4
            return torch.tensor([[[90.0, 90.0, 200.0, 200.0]]]).expand(len(pictures), -1, -1), logits[:, None, None]

    return Bright().eval()


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reduce the study to one scene, one moment and two weathers."""
    from examples.attacks import experiment, study

    assert study  # imported with the whole study's constants
    experiment.scene.cache_clear()
    monkeypatch.setattr(experiment, "detector", bright)
    monkeypatch.setattr(experiment, "SCENES", {"wall": "creation.yaml"})
    monkeypatch.setattr(experiment, "MOMENTS", 1)
    monkeypatch.setattr(experiment, "_RUNS", 2)
    monkeypatch.setattr(experiment, "WEATHERS", ("morning", "fog"))
    attacks = {name: replace(attack, weathers=("morning",)) for name, attack in experiment.ATTACKS.items()}
    monkeypatch.setattr(experiment, "ATTACKS", attacks)


def test_every_task_of_a_study_can_be_done(small: None, tmp_path: Path) -> None:
    """Each writes its file; attacked textures differ from their start, within their bounds."""
    import json

    import numpy as np
    from PIL import Image

    from examples.attacks.experiment import ATTACKS, REACH, logo, start
    from examples.attacks.study import finish, tasks

    wanted = [task for task in tasks(1) if task.scene == "wall" and task.detector in ("", "SSD")]
    assert len(wanted) == 2 + len(ATTACKS) + 1
    for task in wanted:
        finish(tmp_path, task, [1, 2])
        body = json.loads((tmp_path / f"{task.file}.json").read_text())
        if task.name == "gradients":
            assert all(-1 <= value <= 1 for value in body["cosines"].values()) and len(body["cosines"]) == 2
            continue
        last = body["found"][-1]
        assert len(last["scores"]["SSD in wall"]) == len(last["scores"]["CenterNet in wall"]) == 2
        if task.name in ATTACKS:
            assert len(body["losses"]) == 2 and [row["steps"] for row in body["found"]] == [1, 2]
            with Image.open(tmp_path / last["texture"]) as image:
                texture = np.asarray(image, np.float64).transpose(2, 0, 1)[None] / 255
            assert np.abs(texture - logo().numpy()).max() <= REACH + 0.5 / 255 + 1e-6
            assert np.abs(texture - start(0).numpy()).max() > 0.04
            assert ("inserted" in last["scores"]) == (ATTACKS[task.name].insertion == "digital")


def test_augmented_textures_have_the_drawn_light() -> None:
    from examples.attacks.augmentation import THYS, Augmentation

    generator = torch.Generator().manual_seed(1)
    texture = torch.full((1, 3, 8, 8), 0.5, requires_grad=True)
    light = Augmentation((0.5, 0.5), (0.1, 0.1), 0.0)(texture, generator)
    torch.testing.assert_close(light.detach(), torch.full((1, 3, 8, 8), 0.35))
    light.sum().backward()
    torch.testing.assert_close(texture.grad, torch.full((1, 3, 8, 8), 0.5))
    drawn = torch.stack([THYS(texture.detach(), generator) for _ in range(400)])
    means = drawn.mean(dim=(1, 2, 3, 4))
    assert 0.3 <= float(means.min()) < 0.35 and 0.65 < float(means.max()) <= 0.7  # 0.5 * 0.8 - 0.1 to 0.5 * 1.2 + 0.1
    assert 0.08 < float((drawn - means[:, None, None, None, None]).abs().max()) <= 0.12
