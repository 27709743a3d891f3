"""Names of modalities, vehicle families and semantic tags are listed once, so that a new one is added in one place."""

from __future__ import annotations

import ast

import pytest
from recipe_compiler.ir.modalities import LABEL_MODALITIES, MODALITIES
from recipe_compiler.ir.semantic_tags import BODIES, Tag

from tests.sources import modules, walk

TABLES = [
    ("recipe_compiler/ir/modalities.py", frozenset(MODALITIES)),
    ("recipe_compiler/ir/semantic_tags.py", frozenset(BODIES)),
    ("recipe_compiler/ir/semantic_tags.py", frozenset(tag.label for tag in Tag)),
]
SHORTEST = 3, 4  # how many names make a list a repeated table: for tables of at most four names, and for larger ones


def listed(tree: ast.Module, names: frozenset[str]) -> list[int]:
    """Return the lines of tuples, lists, sets and `Literal`s that hold several of the names."""
    least = SHORTEST[len(names) > 4]
    return [
        node.lineno
        for node in walk(tree)
        if isinstance(node, ast.Tuple | ast.List | ast.Set)
        and len(names & {item.value for item in node.elts if isinstance(item, ast.Constant)}) >= least
    ]


@pytest.mark.parametrize(("table", "names"), TABLES)
@pytest.mark.parametrize("package", ["recipe_compiler", "recipe_runtime", "recipe_cli"])
def test_names_are_listed_in_one_module(package: str, table: str, names: frozenset[str]) -> None:
    seen = 0
    for path, tree in modules(package):
        seen += 1
        if path != table:
            assert not listed(tree, names), f"{path} repeats names of {table}; import them"
    assert seen > 5


def test_a_repeated_list_is_found() -> None:
    tree = ast.parse('x = ("rgb", "depth", "semantic", "instance")')
    assert listed(tree, frozenset(MODALITIES)) == [1]
    assert listed(ast.parse('x = ("rgb", "depth")'), frozenset(MODALITIES)) == []


def literals(name: str) -> set[str]:
    """Return the modules with a string that is equal to a name."""
    every = (module for package in ("recipe_compiler", "recipe_runtime", "recipe_cli") for module in modules(package))
    return {path for path, tree in every if any(isinstance(n, ast.Constant) and n.value == name for n in walk(tree))}


# Strings that name something else: fields of records of labels and patches, a stream, a folder of Armory, columns of
# vertices.
OTHER_MEANINGS = {
    "depth": {
        "recipe_runtime/attacks/patch_metadata.py",
        "recipe_runtime/attacks/truth.py",
    },
    "instance": {
        "recipe_compiler/lowering/placement.py",
        "recipe_runtime/annotate/coco.py",
        "recipe_runtime/annotate/mots.py",
        "recipe_runtime/annotate/objects.py",
        "recipe_runtime/dataset/card.py",
        "recipe_runtime/dataset/text_files.py",
        "recipe_runtime/report/contact_sheets.py",
        "recipe_runtime/torch.py",
    },
    "normals": {"recipe_runtime/render/sampling/buffers.py", "recipe_runtime/render/scene/geometry.py"},
}


@pytest.mark.parametrize("name", LABEL_MODALITIES)
def test_a_modality_is_known_by_its_module_and_the_registry(name: str) -> None:
    """Only CARLA's importer names modalities, too, and export formats their files. A new modality needs no change."""
    others = "recipe_compiler/carla/forms/", "recipe_runtime/transfer/formats/"
    knowing = {path for path in literals(name) if not path.startswith(others)}
    expected = {"recipe_compiler/ir/modalities.py", f"recipe_runtime/modalities/{name}.py"}
    assert expected <= knowing <= expected | OTHER_MEANINGS.get(name, set())
