"""No entropy on the way to bytes: no clock, no random source, no libm, no BLAS, no unordered collection.

The rules are over syntax, so they see every line, run or not. What stands apart is named here with its reason.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests.sources import PACKAGES, imports, modules

BANNED_IMPORTS = {"random", "secrets", "uuid", "datetime", "time", "socket", "getpass"}
ALLOWED_IMPORTS = {
    ("recipe_runtime/entropy.py", "secrets"): "the verifier's nonce, the one door to entropy",
    ("recipe_runtime/worker.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/build.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/render/timing.py", "time"): "a stopwatch, for the benchmark",
    ("recipe_compiler/sun.py", "datetime"): "dates and hours that a recipe names; never the clock",
    ("recipe_compiler/references.py", "datetime"): "whether a recipe's date is one; never the clock",
}
LIBM = {"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log2", "log10", "pow", "cbrt", "sinh",
        "cosh", "tanh", "hypot", "radians", "degrees", "dist", "expm1", "log1p", "exp2", "arctan2", "arctan",
        "arcsin", "arccos", "deg2rad", "rad2deg", "power", "float_power"}  # fmt: skip
BLAS = {"dot", "matmul", "inner", "outer", "tensordot", "einsum", "vdot", "linalg", "geomspace", "logspace", "cross"}
# Pictures for people only; no digest covers them.
FOR_EYES = ("recipe_runtime/report/",)
EXACT_PI = {"pi"}


def _everything() -> Iterator[tuple[str, ast.Module]]:
    for package in PACKAGES:
        yield from modules(package)


def test_entropy_has_one_door() -> None:
    used = set()
    for path, tree in _everything():
        for name in imports(tree):
            head = name.split(".")[0]
            if head in BANNED_IMPORTS:
                assert (path, head) in ALLOWED_IMPORTS, f"{path} imports {head}"
                used.add((path, head))
    assert used == set(ALLOWED_IMPORTS), f"allowed, and not used: {set(ALLOWED_IMPORTS) - used}"


def _attributes(tree: ast.Module) -> Iterator[tuple[str, str, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield node.value.id, node.attr, node.lineno


@pytest.mark.parametrize("module", ["math", "np", "numpy", "wp"])
def test_no_libm_and_no_blas(module: str) -> None:
    for path, tree in _everything():
        if path.startswith(FOR_EYES):
            continue
        for name, attribute, line in _attributes(tree):
            if name == module:
                assert attribute not in LIBM | BLAS, f"{path}:{line}: {name}.{attribute} differs between CPUs"
                assert (name, attribute) != ("np", "random"), f"{path}:{line}: np.random"


def test_no_matrix_products_and_no_float_powers() -> None:
    for path, tree in _everything():
        for node in ast.walk(tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
                pytest.fail(f"{path}:{node.lineno}: `@` goes through BLAS")
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                whole = isinstance(node.left, ast.Constant) and node.left.value in (2, 2.0, 10, 10.0, 256)
                assert whole or path.startswith(FOR_EYES), f"{path}:{node.lineno}: `**` goes through libm's pow"


def test_listings_are_sorted() -> None:
    """`glob`, `iterdir` and the like come in the file system's order; each stands inside sorted() or any()."""
    for path, tree in _everything():
        parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            if node.func.attr not in {"glob", "rglob", "iterdir", "listdir", "scandir"}:
                continue
            above: ast.AST | None = node
            while above is not None and not _orders(above):
                above = parents.get(above)
            assert above is not None, f"{path}:{node.lineno}: {node.func.attr} without sorted()"


def _orders(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"sorted", "any", "sum"}


def test_sets_are_not_iterated() -> None:
    """A `for` over a set display, comprehension or call has no order."""
    for path, tree in _everything():
        for node in ast.walk(tree):
            over = node.iter if isinstance(node, ast.For | ast.comprehension) else None
            if isinstance(over, ast.Set | ast.SetComp) or (
                isinstance(over, ast.Call) and isinstance(over.func, ast.Name) and over.func.id in {"set", "frozenset"}
            ):
                pytest.fail(f"{path}:{over.lineno}: iterates over a set")
