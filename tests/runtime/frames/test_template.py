"""The recipe of `recipe init` shows people and cars, as its description says, in the first and in the last frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import recipe_runtime
from recipe_compiler.library.blueprints import match
from recipe_compiler.schema import template


@pytest.mark.slow
def test_the_template_shows_people_and_cars_from_the_first_frame_to_the_last(tmp_path: Path) -> None:
    """Users see this picture first; an empty street would suggest an error."""
    path = tmp_path / "first.yaml"
    text = template("first")
    assert "width: 800, height: 600" in text
    path.write_text(text.replace("width: 800, height: 600", "width: 320, height: 240"))
    scenario = recipe_runtime.open(path)
    for frame in (0, len(scenario) // 2, len(scenario) - 1):
        seen, sizes = np.unique(scenario.render(frame, modality="instance"), return_counts=True)
        clear = [int(instance) // 1000 for instance, size in zip(seen, sizes, strict=True) if size >= 60]
        assert clear.count(12) >= 2, f"frame {frame}: people large enough to be recognised"
        assert clear.count(14) >= 1, f"frame {frame}: cars large enough to be recognised"
    hero = next(a for a in scenario.plan.scene.actors if a.name == "hero")
    (blueprint,) = match(hero.blueprint)
    assert blueprint.attributes["generation"] == "adult"
