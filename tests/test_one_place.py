"""What users add is declared in one place: only the listed modules know its name."""

from __future__ import annotations

import ast
import sys
from functools import cache

import pytest
from recipe_compiler.ir.modalities import LABEL_MODALITIES
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.library import towns
from recipe_runtime.transfer import formats

from tests.sources import PACKAGES, imports, modules, walk

# The declaration, CARLA's presets, and where light uses it.
WEATHER = ("recipe_compiler/ir/weather.py", "recipe_compiler/library/weather.py", "recipe_runtime/render/")
# The town itself, and which of CARLA's towns it is similar to.
TOWN = ("recipe_compiler/library/towns/", "recipe_compiler/carla/catalogue/towns.py")
# The registry, CARLA's importer, the files of export formats, and the check that pictures agree with each other.
MODALITY = (
    "recipe_compiler/ir/modalities.py",
    "recipe_compiler/carla/forms/",
    "recipe_runtime/transfer/formats/",
    "recipe_runtime/lifecycle/validation.py",
)
FORMATS = "recipe_runtime/transfer/formats"
ALSO = {
    "sun_azimuth_angle": ("recipe_compiler/lowering/lower.py", "recipe_compiler/carla/weather.py"),  # or from the time
    "sun_altitude_angle": ("recipe_compiler/lowering/lower.py", "recipe_compiler/carla/weather.py"),
    "cloudiness": ("recipe_runtime/frames/portrait.py", "recipe_compiler/carla/weather.py"),  # some by default
    "downtown": ("recipe_compiler/schema/messages.py",),  # the example in error messages
    "mots": ("recipe_runtime/core/layout.py",),  # a folder of datasets
    "instance": ("recipe_compiler/lowering/placement.py",),  # a random stream
    "normals": ("recipe_runtime/render/sampling/buffers.py", "recipe_runtime/render/scene/geometry.py"),  # of vertices
    "mot": ("recipe_runtime/transfer/formats/armory.py",),  # carla_mot
    "armory": ("recipe_compiler/ir/patches/__init__.py",),  # a method of color transfer
}
CASES = [
    *((name, WEATHER) for name in PARAMETERS),
    *((name, TOWN) for name in towns.NAMES),
    *((name, (*MODALITY, f"recipe_runtime/modalities/{name}.py")) for name in LABEL_MODALITIES),
    *((name, (f"{FORMATS}/__init__.py", f"{FORMATS}/{name}.py")) for name in formats.FORMATS),
]


@cache
def users() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Return the modules in which a word is a complete string, and those in which it is a name or an argument, by word.

    A string counts apart if it is a key: fields of records often have the names of modalities. The names of modules of
    the standard library do not count.
    """
    texts, names = dict[str, set[str]](), dict[str, set[str]]()
    for path, tree in (module for package in PACKAGES for module in modules(package)):
        library = sys.stdlib_module_names & set(imports(tree))
        keys = {id(key) for node in walk(tree) if isinstance(node, ast.Dict) for key in node.keys}
        keys |= {id(node.slice) for node in walk(tree) if isinstance(node, ast.Subscript)}
        for node in walk(tree):
            match node:
                case ast.Constant(value=str(word)):
                    (names if id(node) in keys else texts).setdefault(word, set()).add(path)
                case ast.Name(id=word) | ast.Attribute(attr=word) | ast.alias(name=word) if word not in library:
                    names.setdefault(word, set()).add(path)
                case ast.keyword(arg=str(word)) | ast.arg(arg=word):
                    names.setdefault(word, set()).add(path)
    return texts, names


@pytest.mark.parametrize(("name", "places"), CASES, ids=[name for name, _ in CASES])
def test_few_modules_know_the_name(name: str, places: tuple[str, ...]) -> None:
    texts, names = users()
    knowing = texts.get(name, set()) | (set() if name in LABEL_MODALITIES else names.get(name, set()))
    assert knowing
    assert not [path for path in knowing if not path.startswith((*places, *ALSO.get(name, ())))]
