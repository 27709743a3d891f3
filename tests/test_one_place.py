"""What users add is declared in one place: only the listed modules know its name."""

from __future__ import annotations

import ast
from functools import cache

import pytest
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.library import towns
from recipe_runtime.transfer import formats

from tests.sources import PACKAGES, modules, walk

# The declaration, CARLA's presets, and where light uses it.
WEATHER = ("recipe_compiler/ir/weather.py", "recipe_compiler/library/weather.py", "recipe_runtime/render/")
# The town itself, and which of CARLA's towns it is similar to.
TOWN = ("recipe_compiler/library/towns/", "recipe_compiler/carla/catalogue/towns.py")
FORMATS = "recipe_runtime/transfer/formats"
ALSO = {
    "sun_azimuth_angle": ("recipe_compiler/lowering/lower.py", "recipe_compiler/carla/weather.py"),  # or from the time
    "sun_altitude_angle": ("recipe_compiler/lowering/lower.py", "recipe_compiler/carla/weather.py"),
    "cloudiness": ("recipe_runtime/frames/portrait.py", "recipe_compiler/carla/weather.py"),  # some by default
    "downtown": ("recipe_compiler/schema/messages.py",),  # the example in error messages
    "mots": ("recipe_runtime/core/layout.py",),  # a folder of datasets
    "armory": ("recipe_compiler/ir/patches/__init__.py",),  # a method of color transfer
}
CASES = [
    *((name, WEATHER) for name in PARAMETERS),
    *((name, TOWN) for name in towns.NAMES),
    *((name, (f"{FORMATS}/__init__.py", f"{FORMATS}/{name}.py")) for name in formats.FORMATS),
]


@cache
def knowers() -> dict[str, set[str]]:
    """Return the modules in which a word is a name, an attribute, an argument or a complete string, by word."""
    found: dict[str, set[str]] = {}
    for path, tree in (module for package in PACKAGES for module in modules(package)):
        for node in walk(tree):
            match node:
                case ast.Constant(value=str(word)) | ast.Name(id=word) | ast.Attribute(attr=word):
                    found.setdefault(word, set()).add(path)
                case ast.keyword(arg=str(word)) | ast.arg(arg=word) | ast.alias(name=word):
                    found.setdefault(word, set()).add(path)
    return found


@pytest.mark.parametrize(("name", "places"), CASES, ids=[name for name, _ in CASES])
def test_few_modules_know_the_name(name: str, places: tuple[str, ...]) -> None:
    allowed = (*places, *ALSO.get(name, ()))
    assert name in knowers()
    assert not [path for path in knowers()[name] if not path.startswith(allowed)]
