"""The names in a recipe, without compiling it, for shell completion."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from recipe_compiler import expand
from recipe_compiler.ir.errors import InputError, Problem
from recipe_compiler.schema.recipe import Recipe
from recipe_compiler.source import merge

MAX_VARIANTS = 500


@dataclass(frozen=True)
class Outline:
    """Names in file order; those of variants up to MAX_VARIANTS."""

    variants: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()


def outline(path: Path) -> Outline:
    """The names in a recipe file; those that can be found, if it has mistakes."""
    root = merge.read(path).root
    sensors = root.get("base", "sensors") if root else None
    if root is None or sensors is None:
        return Outline()
    try:
        recipe = Recipe.model_validate({k: v.plain for k, v in root.map.items() if k in Recipe.model_fields})
        problems: list[Problem] = []
        axes = expand.chosen_axes(root, recipe.sweep, problems)
    except (InputError, ValidationError):
        return Outline((), tuple(sensors.map))
    if problems or expand.too_many(axes, recipe.sweep, root):
        return Outline((), tuple(sensors.map))
    return Outline(tuple(itertools.islice(expand.names(axes, recipe.sweep), MAX_VARIANTS)), tuple(sensors.map))
