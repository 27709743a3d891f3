"""Procedural town layouts, as numbers.

`build` turns a town's name, a seed and its parameters into a `Town`: the plan that the runtime makes meshes and
collision shapes from, the colours of everything in it, where actors may appear, and the ways they may go.
"""

from collections.abc import Callable, Mapping

from recipe_compiler.library.towns import downtown, highway, plaza, suburb
from recipe_compiler.library.towns.town import Parameter, SpawnPoint, Town

__all__ = ["NAMES", "PARAMETERS", "Parameter", "SpawnPoint", "Town", "build", "elements"]

_MODULES = {"downtown": downtown, "highway": highway, "plaza": plaza, "suburb": suburb}
_BUILDERS: dict[str, Callable[..., Town]] = {name: module.build for name, module in _MODULES.items()}
_SIZES: dict[str, Callable[..., int]] = {name: module.elements for name, module in _MODULES.items()}

NAMES: tuple[str, ...] = tuple(sorted(_MODULES))
"""The towns that there are."""

PARAMETERS: dict[str, dict[str, Parameter]] = {name: module.PARAMETERS for name, module in _MODULES.items()}
"""Town name -> parameter name -> what it may be."""


def elements(name: str, params: Mapping[str, object]) -> int:
    """About how many elements the town of that name has, known without building it."""
    return _SIZES[name](**{key: params.get(key, parameter.default) for key, parameter in PARAMETERS[name].items()})


def build(name: str, seed: int, params: Mapping[str, object]) -> Town:
    """The town of that name. `params` overrides the defaults of `PARAMETERS`; ValueError for what it refuses."""
    if name not in _BUILDERS:
        raise ValueError(f"no town {name!r}; there are: {', '.join(NAMES)}")
    declared = PARAMETERS[name]
    for key, value in params.items():
        if key not in declared:
            raise ValueError(f"town {name} has no parameter {key!r}; it has: {', '.join(declared)}")
        declared[key].check(key, value)
    values = {key: params.get(key, parameter.default) for key, parameter in declared.items()}
    return _BUILDERS[name](seed, **values)
