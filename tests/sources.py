"""The project's source files, parsed, for tests that check rules in all of them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {
    "recipe_compiler": ROOT / "compiler" / "recipe_compiler",
    "recipe_runtime": ROOT / "runtime" / "recipe_runtime",
    "recipe_cli": ROOT / "cli" / "recipe_cli",
}


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def walk(tree: ast.Module) -> tuple[ast.AST, ...]:
    """Return all nodes of a syntax tree in the order of `ast.walk`, ten times as fast."""
    return tuple(ast.walk(tree))


@cache
def modules(package: str) -> tuple[tuple[str, ast.Module], ...]:
    """Return every module of a package: its path relative to the parent of the package, and its syntax tree."""
    folder = PACKAGES[package]
    paths = sorted(folder.rglob("*.py"))
    return tuple((path.relative_to(folder.parent).as_posix(), parsed(path)) for path in paths)


@cache
def imports(tree: ast.Module) -> tuple[str, ...]:
    """Return the full names of the modules that a module imports anywhere."""
    return tuple(_imports(tree))


def _imports(tree: ast.Module) -> Iterator[str]:
    for node in walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
