"""What `recipe init` writes shows what its description says: people and cars, in the first frame and in the last."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.library.blueprints import match
from recipe_compiler.schema import template


@pytest.mark.slow
def test_the_template_shows_people_and_cars_from_the_first_frame_to_the_last(tmp_path: Path) -> None:
    """A first picture of an empty street, or of cars behind the camera, is a newcomer's first doubt."""
    path = tmp_path / "first.yaml"
    text = template("first")
    assert "width: 800, height: 600" in text
    path.write_text(text.replace("width: 800, height: 600", "width: 320, height: 240"))
    scenario = recipe_runtime.open(path)
    for frame in (0, len(scenario) // 2, len(scenario) - 1):
        seen, sizes = np.unique(scenario.render(frame, modality="instance"), return_counts=True)
        clear = [int(instance) // 1000 for instance, size in zip(seen, sizes, strict=True) if size >= 60]
        assert clear.count(12) >= 2, f"frame {frame}: people that can be made out"
        assert clear.count(14) >= 1, f"frame {frame}: cars that can be made out"
    hero = next(a for a in scenario.plan.scene.actors if a.name == "hero")
    (blueprint,) = match(hero.blueprint)
    assert blueprint.attributes["generation"] == "adult"
