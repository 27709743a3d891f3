"""Procedural town layouts, one module per town.

`build` turns a town's name, a seed and parameters into a `Town`: the plan from which the runtime generates meshes and
colliders, the colours of its elements, the spawn points of actors, and the generator of their routes.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

from recipe_compiler.library.towns import downtown, highway, plaza, suburb
from recipe_compiler.library.towns.town import SpawnPoint, Town, TownParameter

__all__ = ["NAMES", "TOWNS", "SpawnPoint", "Town", "TownModule", "TownParameter", "build", "elements"]


class TownModule(Protocol):
    """What the module of a town declares."""

    SUMMARY: str
    """What the town consists of, for the documentation."""
    PARAMETERS: dict[str, TownParameter]

    @property
    def elements(self) -> Callable[..., int]:
        """Estimates the number of elements from values of all parameters."""

    @property
    def build(self) -> Callable[..., Town]:
        """Generates the town from a seed and values of all parameters."""


TOWNS: dict[str, TownModule] = {m.__name__.rpartition(".")[2]: m for m in (downtown, highway, plaza, suburb)}
"""The module of each town by the town's name."""

NAMES: tuple[str, ...] = tuple(sorted(TOWNS))
"""Names of all towns, sorted."""


def elements(name: str, params: Mapping[str, object]) -> int:
    """Estimate the number of elements of a town without building it.

    Args:
        name: one of `NAMES`.
        params: parameters that differ from their defaults, already checked.
    """
    return TOWNS[name].elements(**{key: params.get(key, p.default) for key, p in TOWNS[name].PARAMETERS.items()})


def build(name: str, seed: int, params: Mapping[str, object]) -> Town:
    """Generate a town.

    Args:
        name: one of `NAMES`.
        seed: the seed of all random draws.
        params: overrides the defaults of the town's parameters.

    Returns:
        The town. Equal arguments return equal towns on every host.

    Raises:
        ValueError: the name or a parameter is unknown, or a value is out of range.
    """
    if name not in TOWNS:
        raise ValueError(f"unknown town {name!r}; the towns are: {', '.join(NAMES)}")
    declared = TOWNS[name].PARAMETERS
    for key, value in params.items():
        if key not in declared:
            raise ValueError(f"town {name} has no parameter {key!r}; it has: {', '.join(declared)}")
        declared[key].check(key, value)
    town = TOWNS[name].build(seed, **{key: params.get(key, parameter.default) for key, parameter in declared.items()})
    assert town.plan.name == name, f"the module of town {name} names it {town.plan.name}"
    return town
