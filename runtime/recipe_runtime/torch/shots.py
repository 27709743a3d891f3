"""The frames that a view shows: of which variant and sensor, and which patches show which texture there."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import SupportsIndex

from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.attacks.textures import differentiable_patch
from recipe_runtime.loading import opened
from recipe_runtime.scenario import Scenario, Scenes

Place = tuple[str, int]  # variant, frame
Recipe = str | PathLike[str] | DatasetPlan | Scenario
Patches = str | Mapping[str, str | Iterable[str]]  # a patch, or the patches of each texture


@dataclass(frozen=True)
class Shot:
    """A frame of a sensor.

    Attributes:
        scenario: The variant, opened.
        frame: Number of the frame.
        sensor: Name of the sensor.
        patches: Name of the texture that each patch shows, by pairs of patch and texture.
    """

    scenario: Scenario
    frame: int
    sensor: str
    patches: tuple[tuple[str, str], ...]

    @property
    def variant(self) -> str:
        """Name of the variant."""
        return self.scenario.variant

    @property
    def place(self) -> Place:
        """Variant and frame."""
        return self.variant, self.frame


def shots_of(
    recipe: Recipe,
    patches: Patches,
    frames: Sequence[Place | int] | None,
    sensors: str | Iterable[str] | None,
    device: str,
) -> list[Shot]:
    """Return shots of a recipe; the arguments are those of `SceneView`.

    Raises:
        InputError: The recipe is invalid, a named variant, patch or sensor does not exist, or there is no shot.
    """
    scenarios, shown = _scenarios(recipe, device), _patches(patches)
    first = next(iter(scenarios))
    names = _sensors(scenarios[first], sensors)
    if frames is None:
        found = [
            (name, k, sensor)
            for name, scenario in scenarios.items()
            for k in range(len(scenario))
            for sensor in names
            if k in scenario.frames(sensor)
        ]
    else:
        places = [(first, operator.index(p)) if isinstance(p, SupportsIndex) else (p[0], p[1]) for p in frames]
        found = [(name, k, sensor) for name, k in places for sensor in names]
    if not found:
        raise InputError("a SceneView has one frame or more, and `frames` has none")
    for variant in dict.fromkeys(variant for variant, _, _ in found):
        if variant not in scenarios:
            raise InputError(
                f"there is no variant {variant!r}; the variants are {', '.join(scenarios)}", code=Code.UNKNOWN_NAME
            )
        for sensor in names:
            scenarios[variant].modalities(sensor)  # InputError if there is no such sensor
            for patch, _ in shown:
                differentiable_patch(scenarios[variant].plan.appearance, sensor, patch)
    return [Shot(scenarios[variant], frame, sensor, shown) for variant, frame, sensor in found]


def _scenarios(recipe: Recipe, device: str) -> dict[str, Scenario]:
    """Return the variants by name; they share engines."""
    if isinstance(recipe, Scenario):
        return {recipe.variant: recipe}
    plan, engines = (recipe, None) if isinstance(recipe, DatasetPlan) else opened(recipe)
    scenes = Scenes(device, engines)
    return {variant.variant: Scenario(variant, scenes) for variant in plan.variants}


def _sensors(scenario: Scenario, names: str | Iterable[str] | None) -> tuple[str, ...]:
    if names is None:
        return scenario.sensors[:1]
    return (names,) if isinstance(names, str) else tuple(names)


def _patches(given: Patches) -> tuple[tuple[str, str], ...]:
    """Return pairs of patch and texture; a single patch has the name of its texture."""
    if isinstance(given, str):
        return ((given, given),)
    if not isinstance(given, Mapping):
        raise InputError(
            f"the patches are a {type(given).__name__}; give the name of one, or a dictionary from names of textures to"
            " patches"
        )
    pairs = [
        (patch, texture)
        for texture, patches in given.items()
        for patch in ([patches] if isinstance(patches, str) else patches)
    ]
    if not pairs:
        raise InputError("a SceneView has one patch or more, and the mapping from textures to patches names none")
    twice = [patch for k, (patch, _) in enumerate(pairs) if patch in dict(pairs[:k])]
    if twice:
        raise InputError(f"patch {twice[0]}: it shows one texture, and the mapping names it twice")
    return tuple(pairs)
