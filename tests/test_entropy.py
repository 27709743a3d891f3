"""No entropy in code that affects bytes: no clock, random source, libm, BLAS or unordered collection.

The rules are checked on the syntax, so they cover every line. Exceptions are listed here with their reasons.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

import pytest

from tests.sources import PACKAGES, imports, modules, walk

BANNED_IMPORTS = {"random", "secrets", "uuid", "datetime", "time", "socket", "getpass"}
ALLOWED_IMPORTS = {
    ("recipe_runtime/core/host.py", "secrets"): "the verifier's nonce, the only use of entropy",
    ("recipe_runtime/core/timings.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/build/pipeline.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/build/ray.py", "socket"): "whether a Ray cluster answers",
    ("recipe_compiler/lowering/sun.py", "datetime"): "dates and times of a recipe; never the clock",
    ("recipe_compiler/checks/references.py", "datetime"): "validation of a recipe's date; never the clock",
}
ALLOWED_ADDRESSES = {
    "recipe_compiler/checks/check.py": "id() as a key: a checked section, kept alive",
    "recipe_compiler/lowering/caps.py": "id() as a key: sections that were counted, kept alive",
    "recipe_compiler/source/merge.py": "id() as a key: merged values, kept alive",
    "recipe_compiler/lowering/lower.py": "id() as a key: a lowered scene or rig, kept alive",
    "recipe_runtime/annotate/actor_boxes.py": "id() as a key: a body's shape, kept alive",
    "recipe_runtime/meshes/smoothing.py": "id() as a key: a numbered surface, kept alive",
}
LIBM = {"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log2", "log10", "pow", "cbrt", "sinh",
        "cosh", "tanh", "hypot", "radians", "degrees", "dist", "expm1", "log1p", "exp2", "arctan2", "arctan",
        "arcsin", "arccos", "deg2rad", "rad2deg", "power", "float_power"}  # fmt: skip
BLAS = {"dot", "matmul", "inner", "outer", "tensordot", "einsum", "vdot", "linalg", "geomspace", "logspace", "cross"}
# Pictures for viewing only; no digest covers them.
FOR_VIEWING = ("recipe_runtime/report/", "recipe_runtime/modalities/colormaps.py")
EXACT_PI = {"pi"}


def _everything() -> Iterator[tuple[str, ast.Module]]:
    for package in PACKAGES:
        yield from modules(package)


def test_entropy_is_imported_by_listed_modules_only() -> None:
    used = set()
    for path, tree in _everything():
        for name in imports(tree):
            head = name.split(".")[0]
            if head in BANNED_IMPORTS:
                assert (path, head) in ALLOWED_IMPORTS, f"{path} imports {head}"
                used.add((path, head))
    assert used == set(ALLOWED_IMPORTS), f"allowed, and not used: {set(ALLOWED_IMPORTS) - used}"


def _attributes(tree: ast.Module) -> Iterator[tuple[str, str, int]]:
    for node in walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield node.value.id, node.attr, node.lineno


@pytest.mark.parametrize("module", ["math", "np", "numpy", "wp"])
def test_no_libm_and_no_blas(module: str) -> None:
    for path, tree in _everything():
        if path.startswith(FOR_VIEWING):
            continue
        for name, attribute, line in _attributes(tree):
            if name == module:
                assert attribute not in LIBM | BLAS, f"{path}:{line}: {name}.{attribute} differs between CPUs"
                assert (name, attribute) != ("np", "random"), f"{path}:{line}: np.random"


@pytest.mark.parametrize("package", PACKAGES)
def test_no_libm_by_name_and_no_product_by_method(package: str) -> None:
    """Such as `from math import sin` and `array.dot(...)`."""
    for path, tree in modules(package):
        if not path.startswith(FOR_VIEWING):
            assert list(_by_another_name(tree)) == [], path


def _by_another_name(tree: ast.Module) -> Iterator[str]:
    for node in walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in {"math", "cmath", "numpy"}:
            names = {alias.name for alias in node.names} | set((node.module or "").split("."))
            yield from (f"{node.lineno}: imports {name}" for name in sorted(names & (LIBM | BLAS | {"*", "random"})))
        elif isinstance(node, ast.Import):
            yield from (f"{node.lineno}: imports {a.name}" for a in node.names if a.name in {"cmath", "numpy.random"})
        elif isinstance(node, ast.Attribute) and node.attr in {
            "dot",
            "matmul",
            "vdot",
            "tensordot",
            "einsum",
            "linalg",
        }:
            yield f"{node.lineno}: .{node.attr}"


def test_addresses_do_not_affect_results() -> None:
    """id() and hash() differ between runs: they may be keys of caches, but must not affect a value."""
    used = set()
    for path, tree in _everything():
        names = (node for node in walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load))
        for node in names:
            if node.id in {"hash", "id"}:
                assert path in ALLOWED_ADDRESSES, f"{path}:{node.lineno}: {node.id}() differs between runs"
                used.add(path)
    assert used == set(ALLOWED_ADDRESSES)


def test_no_matrix_products_and_no_float_powers() -> None:
    for path, tree in _everything():
        for node in walk(tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
                pytest.fail(f"{path}:{node.lineno}: `@` goes through BLAS")
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
                whole = isinstance(node.left, ast.Constant) and node.left.value in (2, 2.0, 10, 10.0, 256)
                assert whole or path.startswith(FOR_VIEWING), f"{path}:{node.lineno}: `**` goes through libm's pow"


@pytest.mark.slow
def test_listings_are_sorted() -> None:
    """`glob`, `iterdir` and the like use the order of the file system; each call must be inside sorted() or any()."""
    for path, tree in _everything():
        parents = {child: node for node in walk(tree) for child in ast.iter_child_nodes(node)}
        for node in walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            if node.func.attr not in {"glob", "rglob", "iterdir", "listdir", "scandir"}:
                continue
            above: ast.AST | None = node
            while above is not None and not _orders(above):
                above = parents.get(above)
            assert above is not None, f"{path}:{node.lineno}: {node.func.attr} without sorted()"


def test_argsort_is_stable() -> None:
    """In NumPy's default sort, the order of equal keys depends on the CPU's instruction set."""
    for path, tree in _everything():
        for node in walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "argsort":
                kinds = [ast.unparse(keyword.value) for keyword in node.keywords if keyword.arg == "kind"]
                assert kinds == ["'stable'"], f"{path}:{node.lineno}: argsort without kind='stable'"


def _orders(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"sorted", "any", "sum"}


def test_sets_are_not_used_in_their_order() -> None:
    """The order of a set is undefined: none may be iterated, joined, enumerated or converted to a list."""
    for path, tree in _everything():
        assert list(_ordered_sets(tree)) == [], path


_ORDERING = {"list", "tuple", "enumerate", "iter", "map", "zip", "reversed", "filter", "next"}


def _ordered_sets(tree: ast.Module) -> Iterator[str]:
    for node in walk(tree):
        taken: list[ast.expr] = []
        if isinstance(node, ast.For | ast.comprehension):
            taken = [node.iter]
        elif isinstance(node, ast.Starred):
            taken = [node.value]
        elif isinstance(node, ast.Call):
            by_name = isinstance(node.func, ast.Name) and node.func.id in _ORDERING
            joins = isinstance(node.func, ast.Attribute) and node.func.attr in {"join", "extend", "fromkeys"}
            taken = [arg for arg in node.args if not isinstance(arg, ast.Starred)] if by_name or joins else []
        yield from (f"{expr.lineno}: puts a set in order" for expr in taken if _is_set(expr))


def _is_set(node: ast.expr) -> bool:
    """Return whether the syntax of an expression makes it a set; values of variables are not analysed."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr | ast.BitAnd | ast.Sub | ast.BitXor):
        return _is_set(node.left) or _is_set(node.right)
    calls = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"set", "frozenset"}
    return calls or isinstance(node, ast.Set | ast.SetComp)


@pytest.mark.parametrize(
    ("code", "rule"),
    [
        ("from math import sin", _by_another_name),
        ("from numpy import exp as e", _by_another_name),
        ("from numpy.random import default_rng", _by_another_name),
        ("from numpy import *", _by_another_name),
        ("from numpy.linalg import norm", _by_another_name),
        ("a.T.dot(b)", _by_another_name),
        ("list({1, 2})", _ordered_sets),
        ("', '.join({n for n in names})", _ordered_sets),
        ("tuple(set(a) - set(b))", _ordered_sets),
        ("enumerate(frozenset(a))", _ordered_sets),
        ("[x for x in set(a) | b]", _ordered_sets),
        ("for x in {*a}: pass", _ordered_sets),
        ("f(*{1, 2})", _ordered_sets),
        ("dict.fromkeys(set(a))", _ordered_sets),
    ],
)
def test_the_rules_detect(code: str, rule: Callable[[ast.Module], Iterator[str]]) -> None:
    assert list(rule(ast.parse(code)))


@pytest.mark.parametrize("code", ["sorted(set(a))", "{*a, *b}", "len({1, 2})", "from math import sqrt", "x in {1, 2}"])
def test_the_rules_accept(code: str) -> None:
    tree = ast.parse(code)
    assert [*_by_another_name(tree), *_ordered_sets(tree)] == []
