"""Loads recipes: the only module of the runtime that calls the compiler."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from recipe_compiler.compile import TooLargeError as TooLargeError
from recipe_compiler.compile import compile_recipe
from recipe_compiler.compile import named_files as named_files
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.dataset.plan_checks import check_plan
from recipe_runtime.frames.engines import Engines, real_engines
from recipe_runtime.scenario import Scenario, Scenes


def compiled(recipe: str | PathLike[str], allow_large: bool = False) -> DatasetPlan:
    """Return the plan of a recipe; InputError with all mistakes in it."""
    return opened(recipe, allow_large)[0]


def compiled_with_files(recipe: Path, allow_large: bool = False) -> tuple[DatasetPlan, dict[str, str]]:
    """Return the plan of a recipe, and the SHA-256 of every file read, by its path relative to the recipe's folder."""
    found = compile_recipe(recipe, allow_large=allow_large)
    return found.plan, found.files


def opened(recipe: str | PathLike[str], allow_large: bool = False) -> tuple[DatasetPlan, Engines]:
    """Return the plan of a recipe, and engines with the paths of its assets.

    Raises:
        InputError: The recipe is invalid, exceeds the limits, or is a URL.
    """
    if "://" in str(recipe):
        from recipe_runtime.core import urls

        url = urls.shown(str(recipe))
        raise InputError(
            f"{url}: a recipe is opened from a file of this host; copy it here, with the files that it names"
        )
    found = compile_recipe(Path(recipe), allow_large=allow_large)
    check_plan(found.plan)
    return found.plan, real_engines(Assets(found.places))


def scenario(
    plan: DatasetPlan,
    variant: str | None,
    device: str,
    disk_cache: str | PathLike[str] | None = None,
    engines: Engines | None = None,
) -> Scenario:
    """Return the variant of a name, the first by default, as a scenario."""
    kept = Path(disk_cache) if disk_cache is not None else None
    return Scenario(plan.named(variant), Scenes(device, engines), kept)
