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
from recipe_compiler.source.yaml_reader import Value

MAX_VARIANTS = 500


@dataclass(frozen=True)
class Outline:
    """Names in file order; those of variants up to MAX_VARIANTS."""

    variants: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    modalities: tuple[str, ...] = ()


def outline(path: Path) -> Outline:
    """The names in a recipe file; those that can be found, if it has mistakes."""
    root = merge.read(path).root
    sensors = root.get("base", "sensors") if root else None
    if root is None or sensors is None:
        return Outline()
    captured = [
        item.data for sensor in sensors.map.values() if (list_ := sensor.get("capture")) for item in _items(list_)
    ]
    modalities = tuple(dict.fromkeys(str(name) for name in captured))
    names = tuple(sensors.map)
    try:
        recipe = Recipe.model_validate({k: v.plain for k, v in root.map.items() if k in Recipe.model_fields})
        problems: list[Problem] = []
        axes = expand.chosen_axes(root, recipe.sweep, problems)
        if problems or expand.too_many(axes, recipe.sweep, root):
            return Outline((), names, modalities)
        variants = itertools.islice(expand.names(axes, recipe.sweep), MAX_VARIANTS)
        return Outline(tuple(variants), names, modalities)
    except (InputError, ValidationError):
        return Outline((), names, modalities)


def _items(value: Value | None) -> tuple[Value, ...]:
    return value.data if value is not None and isinstance(value.data, tuple) else ()
