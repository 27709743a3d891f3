"""Recipes for tests: a small one as plain data, and a function that compiles such data."""

from __future__ import annotations

import copy
import json
import tempfile
from pathlib import Path
from typing import Any

from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.plan import ScenarioPlan

SMALL: dict[str, Any] = {
    "recipe": "small",
    "seed": 30,
    "base": {
        "clock": {"fps": 10, "frames": 4},
        "town": {"name": "downtown", "blocks": [1, 1]},
        "weather": "ClearNoon",
        "actors": {
            "hero1": {"blueprint": "walker.pedestrian.*", "start": {"x": -4, "y": 10}, "goal": {"x": -4, "y": -10}},
            "hero2": {"blueprint": "walker.pedestrian.*", "start": {"x": -6, "y": -10}},
        },
        "traffic": {"vehicles": 2, "pedestrians": 2},
        "sensors": {
            "street": {
                "mount": {"x": -8, "z": 1.6},
                "camera": {"width": 64, "height": 48},
                "capture": ["rgb", "instance"],
                "motion": {"jitter": {"x": 0.02, "yaw": 0.4}},
            }
        },
    },
}


def small(**base: Any) -> dict[str, Any]:
    """Return a copy of the small recipe, with sections of its base replaced."""
    recipe = copy.deepcopy(SMALL)
    recipe["base"] |= base
    return recipe


def compiled(recipe: dict[str, Any]) -> Compiled:
    """Compile a recipe given as plain data from a file; JSON is a subset of YAML."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recipe.yaml"
        path.write_text(json.dumps(recipe, indent=1))
        return compile_recipe(path)


def only(recipe: dict[str, Any]) -> ScenarioPlan:
    """Return the only variant of a recipe without axes."""
    (variant,) = compiled(recipe).plan.variants
    return variant
