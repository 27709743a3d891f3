"""Names of modalities, vehicle families and semantic tags are listed once, so that a new one is added in one place."""

from __future__ import annotations

import ast

import pytest
from recipe_compiler.ir.modalities import MODALITIES
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
