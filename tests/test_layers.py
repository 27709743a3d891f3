"""Packages form layers: a module imports from its own package and from lower layers, never upward or sideways."""

from __future__ import annotations

import ast
import subprocess
import sys

import pytest

from tests.sources import PACKAGES, imports, modules, walk

# From the lowest layer to the highest. A name that is not a package is a module in the root.
LAYERS: dict[str, tuple[tuple[str, ...], ...]] = {
    "recipe_compiler": (
        ("ir",),
        ("source", "library"),
        ("schema", "estimate"),
        ("expand",),
        ("checks",),
        ("lowering",),
        ("carla", "compile"),
        ("__init__",),
    ),
    "recipe_runtime": (
        ("core", "body"),
        ("cache", "meshes"),
        ("render", "simulation"),
        ("modalities",),
        ("annotate",),
        ("dataset", "insertion"),
        ("frames",),
        ("attacks",),
        ("scenes",),
        ("scenario",),
        ("loading",),
        ("torch", "webdataset", "__init__"),
        ("report", "transfer"),
        ("fiftyone",),
        ("build",),
        ("verify",),
        ("lifecycle",),
    ),
}
MAX_ROOT_MODULES = 6
MAX_PACKAGE_MODULES = 15
LARGE_PACKAGES = {"recipe_runtime/core", "recipe_runtime/meshes"}
MAX_MODULE_LINES = 400
MAX_FUNCTION_LINES = 60
MAX_ANY = 100  # uses of `Any` as a type, in all three packages


def layer_of(top: str, part: str) -> int:
    """Return the layer of a package or root module, from 0 at the bottom."""
    found = [number for number, layer in enumerate(LAYERS[top]) if part in layer]
    assert found, f"{top}: {part} has no layer; add it to LAYERS in {__file__}"
    return found[0]


def part_of(path: str) -> str:
    """Return the package or the root module of a file such as `recipe_runtime/core/trace.py`."""
    return path.split("/")[1].removesuffix(".py")


def upward(top: str, path: str, tree: ast.Module) -> list[str]:
    """Return the imports of a module from a higher layer or from another package of its layer."""
    here = part_of(path)
    wrong = []
    for name in imports(tree):
        head, _, rest = name.partition(".")
        there = rest.split(".")[0]
        if head == top and there not in ("", here) and layer_of(top, there) >= layer_of(top, here):
            wrong.append(name)
    return wrong


@pytest.mark.slow
@pytest.mark.parametrize("top", LAYERS)
def test_no_import_leads_upward(top: str) -> None:
    seen = set()
    for path, tree in modules(top):
        seen.add(part_of(path))
        assert not upward(top, path, tree), f"{path} imports {upward(top, path, tree)}"
    assert seen - {"__init__"} == {part for layer in LAYERS[top] for part in layer} - {"__init__"}


def test_an_upward_import_is_detected() -> None:
    tree = ast.parse("from recipe_runtime.build import pipeline")
    assert "recipe_runtime.build.pipeline" in upward("recipe_runtime", "recipe_runtime/core/trace.py", tree)
    assert upward("recipe_runtime", "recipe_runtime/verify/lock.py", tree) == []


@pytest.mark.parametrize("top", LAYERS)
def test_packages_stay_small(top: str) -> None:
    count: dict[str, int] = {}
    for path, _ in modules(top):
        folder, _, name = path.rpartition("/")
        count[folder] = count.get(folder, 0) + (name != "__init__.py")
    assert count[top] <= MAX_ROOT_MODULES
    too_large = {folder for folder, number in count.items() if number > MAX_PACKAGE_MODULES}
    assert too_large <= LARGE_PACKAGES, {folder: count[folder] for folder in too_large}


@pytest.mark.slow
@pytest.mark.parametrize("top", PACKAGES)
def test_modules_and_functions_stay_short(top: str) -> None:
    long, seen = [], 0
    for path, tree in modules(top):
        seen += 1
        lines = (PACKAGES[top].parent / path).read_text(encoding="utf-8").count("\n")
        long += [path] * (lines > MAX_MODULE_LINES)
        functions = [node for node in walk(tree) if isinstance(node, ast.FunctionDef)]
        long += [
            f"{path}: {node.name}" for node in functions if (node.end_lineno or 0) - node.lineno >= MAX_FUNCTION_LINES
        ]
    assert seen > 10
    assert not long


def test_few_types_are_any() -> None:
    """The word grows back with each feature: `object`, a union or a type variable nearly always serves."""
    words = [node for top in PACKAGES for _, tree in modules(top) for node in walk(tree) if isinstance(node, ast.Name)]
    assert len(words) > 10_000
    assert sum(node.id == "Any" for node in words) <= MAX_ANY


@pytest.mark.slow
def test_reading_a_dataset_loads_no_builder_verifier_or_transfer() -> None:
    code = "import sys, recipe_runtime.dataset.reader; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    packages = {name.split(".")[1] for name in loaded if name.startswith("recipe_runtime.")}
    assert not packages & {"build", "verify", "transfer"}
    assert "dataset" in packages
