"""No entropy on the way to bytes: no clock, no random source, no libm, no BLAS, no unordered collection.

The rules are over syntax, so they see every line, run or not. What stands apart is named here with its reason.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator

import pytest

from tests.sources import PACKAGES, imports, modules, walk

BANNED_IMPORTS = {"random", "secrets", "uuid", "datetime", "time", "socket", "getpass"}
ALLOWED_IMPORTS = {
    ("recipe_runtime/core/nonce.py", "secrets"): "the verifier's nonce, the one door to entropy",
    ("recipe_runtime/core/timings.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/build/pipeline.py", "time"): "a stopwatch, for the terminal",
    ("recipe_runtime/build/ray.py", "socket"): "whether a Ray cluster answers",
    ("recipe_runtime/build/ray.py", "time"): "how long a door that says nothing is waited at",
    ("recipe_runtime/render/device/compiled.py", "time"): "how long another process's compiling is waited for",
    ("recipe_compiler/lowering/sun.py", "datetime"): "dates and hours that a recipe names; never the clock",
    ("recipe_compiler/checks/references.py", "datetime"): "whether a recipe's date is one; never the clock",
}
ALLOWED_ADDRESSES = {
    "recipe_compiler/carla/actors.py": "the key of an entry of the configuration that was named, and is held",
    "recipe_compiler/carla/scene.py": "the key of an entry of the configuration that was named, and is held",
    "recipe_compiler/carla/sensors.py": "the key of an entry of the configuration that was grouped, and is held",
    "recipe_compiler/checks/check.py": "the key of a section that was checked before, and is held",
    "recipe_compiler/checks/findings.py": "the key of a problem that was found before, and is held",
    "recipe_compiler/lowering/workload.py": "the key of sections whose cost was estimated before, and are held",
    "recipe_compiler/source/merge.py": "the key of values that were merged before, and are held",
    "recipe_compiler/lowering/lower.py": "the key of a scene or rig that was lowered before, and is held",
    "recipe_runtime/annotate/actor_boxes.py": "the key of a body's shape, and is held",
    "recipe_runtime/meshes/town.py": "the key of the town that was built last, and is held",
    "recipe_runtime/meshes/smoothing.py": "the key of a surface that was numbered before, and is held",
}
LIBM = {"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log2", "log10", "pow", "cbrt", "sinh",
        "cosh", "tanh", "hypot", "radians", "degrees", "dist", "expm1", "log1p", "exp2", "arctan2", "arctan",
        "arcsin", "arccos", "deg2rad", "rad2deg", "power", "float_power"}  # fmt: skip
BLAS = {"dot", "matmul", "inner", "outer", "tensordot", "einsum", "vdot", "linalg", "geomspace", "logspace", "cross"}
# Pictures for people only; no digest covers them.
FOR_EYES = ("recipe_runtime/report/", "recipe_runtime/frames/colormaps.py")
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
    for node in walk(tree):
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


@pytest.mark.parametrize("package", PACKAGES)
def test_no_libm_by_name_and_no_product_by_method(package: str) -> None:
    """`from math import sin`, `array.dot(...)`: the same under other spellings."""
    for path, tree in modules(package):
        if not path.startswith(FOR_EYES):
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


def test_nothing_is_told_apart_by_its_address() -> None:
    """id() and hash() differ between runs: they may be keys of what is remembered, and never reach a value."""
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
                assert whole or path.startswith(FOR_EYES), f"{path}:{node.lineno}: `**` goes through libm's pow"


@pytest.mark.slow
def test_listings_are_sorted() -> None:
    """`glob`, `iterdir` and the like come in the file system's order; each stands inside sorted() or any()."""
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
    """NumPy's default sorts equal keys by the CPU's instruction set, in an order of its own."""
    for path, tree in _everything():
        for node in walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "argsort":
                kinds = [ast.unparse(keyword.value) for keyword in node.keywords if keyword.arg == "kind"]
                assert kinds == ["'stable'"], f"{path}:{node.lineno}: argsort without kind='stable'"


def _orders(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"sorted", "any", "sum"}


def test_sets_are_not_put_in_order() -> None:
    """A set has no order: none is iterated, joined, counted off or made a list."""
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
    """Whether an expression is a set by its very form; what a variable holds is out of scope."""
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
def test_the_rules_see(code: str, rule: Callable[[ast.Module], Iterator[str]]) -> None:
    assert list(rule(ast.parse(code)))


@pytest.mark.parametrize("code", ["sorted(set(a))", "{*a, *b}", "len({1, 2})", "from math import sqrt", "x in {1, 2}"])
def test_the_rules_pass(code: str) -> None:
    tree = ast.parse(code)
    assert [*_by_another_name(tree), *_ordered_sets(tree)] == []
