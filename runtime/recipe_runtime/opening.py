"""From a recipe's file to what can be asked for frames: the runtime's one door to the compiler."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from recipe_compiler.compile import compile_recipe
from recipe_compiler.plan import DatasetPlan

from recipe_runtime.admission import check_plan
from recipe_runtime.scenario import Scenario, Scenes


def compiled(recipe: str | PathLike[str], allow_large: bool = False) -> DatasetPlan:
    """The plan of a recipe's file; InputError with all that is wrong with it."""
    plan = compile_recipe(Path(recipe), allow_large=allow_large).plan
    check_plan(plan)
    return plan


def scenario(
    plan: DatasetPlan, variant: str | None, device: str, disk_cache: str | PathLike[str] | None = None
) -> Scenario:
    """The variant of that name, the first by default."""
    kept = Path(disk_cache) if disk_cache is not None else None
    return Scenario(plan.named(variant), Scenes(device), kept)
