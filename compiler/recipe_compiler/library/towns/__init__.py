"""Procedural town layouts.

`build` turns a town's name, a seed and parameters into a `Town`: the plan from which the runtime generates meshes and
colliders, the colours of its elements, the spawn points of actors, and the generator of their routes.
"""

from collections.abc import Callable, Mapping

from recipe_compiler.library.towns import downtown, highway, plaza, suburb
from recipe_compiler.library.towns.town import Parameter, SpawnPoint, Town

__all__ = ["NAMES", "PARAMETERS", "Parameter", "SpawnPoint", "Town", "build", "elements"]

_MODULES = {"downtown": downtown, "highway": highway, "plaza": plaza, "suburb": suburb}
_BUILDERS: dict[str, Callable[..., Town]] = {name: module.build for name, module in _MODULES.items()}
_SIZES: dict[str, Callable[..., int]] = {name: module.elements for name, module in _MODULES.items()}

NAMES: tuple[str, ...] = tuple(sorted(_MODULES))
"""Names of all towns, sorted."""

PARAMETERS: dict[str, dict[str, Parameter]] = {name: module.PARAMETERS for name, module in _MODULES.items()}
"""Town name -> parameter name -> its range, default and description."""


def elements(name: str, params: Mapping[str, object]) -> int:
    """Estimate the number of elements of a town without building it.

    Args:
        name: one of `NAMES`.
        params: parameters that differ from their defaults, already checked.
    """
    return _SIZES[name](**{key: params.get(key, parameter.default) for key, parameter in PARAMETERS[name].items()})


def build(name: str, seed: int, params: Mapping[str, object]) -> Town:
    """Generate a town.

    Args:
        name: one of `NAMES`.
        seed: the seed of all random draws.
        params: overrides the defaults in `PARAMETERS`.

    Returns:
        The town. Equal arguments return equal towns on every host.

    Raises:
        ValueError: the name or a parameter is unknown, or a value is out of range.
    """
    if name not in _BUILDERS:
        raise ValueError(f"unknown town {name!r}; the towns are: {', '.join(NAMES)}")
    declared = PARAMETERS[name]
    for key, value in params.items():
        if key not in declared:
            raise ValueError(f"town {name} has no parameter {key!r}; it has: {', '.join(declared)}")
        declared[key].check(key, value)
    values = {key: params.get(key, parameter.default) for key, parameter in declared.items()}
    return _BUILDERS[name](seed, **values)
