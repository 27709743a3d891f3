"""The project's own source files, parsed: for tests that hold rules over all of them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {
    "recipe_compiler": ROOT / "compiler" / "recipe_compiler",
    "recipe_runtime": ROOT / "runtime" / "recipe_runtime",
    "recipe_cli": ROOT / "cli" / "recipe_cli",
}


def modules(package: str) -> Iterator[tuple[str, ast.Module]]:
    """Every module of a package: its path within the package's folder's parent, and its syntax tree."""
    folder = PACKAGES[package]
    for path in sorted(folder.rglob("*.py")):
        yield path.relative_to(folder.parent).as_posix(), ast.parse(path.read_text())


def imports(tree: ast.Module) -> Iterator[str]:
    """The full names of modules that a module imports, wherever in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
