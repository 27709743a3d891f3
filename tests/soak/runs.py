"""The runs: all towns, two densities, three seeds, 150 s each."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import ScenePlan
from recipe_compiler.library import towns
from recipe_runtime.simulation.process import simulate

from tests.soak.measures import Measures, measure

SECONDS, FPS = 150, 10
TOWNS: dict[str, dict[str, Any]] = {name: {"name": name} for name in towns.NAMES}
LARGER: dict[str, dict[str, Any]] = {"plaza": {"name": "plaza", "size": [120, 100]}}
"""Towns in which sixty vehicles find a place."""
COUNTS, SEEDS = (30, 60), (1, 2, 3)


def scene(town: str, vehicles: int, people: int, seed: int, seconds: int = SECONDS) -> ScenePlan:
    """Return the plan of a run."""
    spec = LARGER.get(town, TOWNS[town]) if vehicles > 30 else TOWNS[town]
    recipe = {
        "recipe": "soak",
        "seed": seed,
        "base": {
            "clock": {"fps": FPS, "frames": seconds * FPS},
            "town": spec,
            "traffic": {"vehicles": vehicles, "pedestrians": people},
            "sensors": {"any": {"mount": {"z": 2.0}, "camera": {"width": 64, "height": 48}, "capture": ["depth"]}},
        },
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "soak.yaml"
        path.write_text(json.dumps(recipe, indent=1))
        return compile_recipe(path).plan.variants[0].scene


def run(town: str, vehicles: int, people: int, seed: int, seconds: int = SECONDS) -> Measures:
    """Simulate a run and measure it."""
    plan = scene(town, vehicles, people, seed, seconds)
    trace = simulate(plan)
    return measure(plan, trace, trace.contacts or ())
