"""Source checks of the renderer's modules: the rules that make kernels give equal bytes on every machine."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from recipe_runtime import modalities, render

from tests.sources import imports, modules, parsed, walk

FOLDER = Path(render.__file__).parent
MODALITIES = Path(modalities.__file__).parent
VIEWING = MODALITIES / "colormaps.py"  # pictures that no digest covers
MODULES = [*sorted(FOLDER.rglob("*.py")), *sorted(set(MODALITIES.rglob("*.py")) - {VIEWING})]
FEWEST = 47  # at least this many modules: the checks must not pass because modules moved out of their sight
# The allowed names of Warp: arithmetic, conversions, constructors, integer atomics, and launching on a device.
# Neither transcendental functions nor helpers in which the library chooses the order of operations.
ALLOWED = {
    "abs", "min", "max", "sqrt", "tid", "clone", "launch", "constant", "struct", "func", "kernel", "init",
    "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64",
    "vec2d", "vec2f", "vec2i", "vec3f", "vec4f", "vec3i", "vec3d", "array", "array2d", "zeros", "empty", "full",
    "set_module_options", "is_cuda_available", "get_cuda_device_count", "dtype_to_numpy", "copy", "empty_like",
    "load_module", "Stream", "ScopedStream", "Event", "capture_begin", "capture_end", "capture_launch", "get_stream",
    "dtype_from_numpy", "from_dlpack", "int", "uint", "synchronize_stream", "record_event", "synchronize_event",
    "where", "atomic_add", "atomic_min", "atomic_max", "atomic_or",
}  # fmt: skip
FLOATING = {"float32", "float64", "float"}


def calls(path: Path) -> list[ast.Call]:
    return [node for node in walk(parsed(path)) if isinstance(node, ast.Call)]


def stable(call: ast.Call) -> bool:
    """Return whether a sort is stable: the order of equal values in another sort depends on the CPU."""
    return any(k.arg == "kind" and ast.unparse(k.value) == "'stable'" for k in call.keywords)


def test_the_checks_see_every_module_of_the_renderer() -> None:
    """Compares three independent counts: the package's modules, those that use Warp, and a lower bound."""
    seen = {path.relative_to(FOLDER.parents[1]).as_posix() for path in MODULES}
    package = dict(modules("recipe_runtime"))
    assert seen >= {path for path in package if path.startswith("recipe_runtime/render/")}
    device = "recipe_runtime.render.device"
    warp = {path for path, tree in package.items() if any(name in ("warp", f"{device}.wp") for name in imports(tree))}
    assert warp and warp <= seen
    assert len(seen) >= FEWEST


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(FOLDER.parent).as_posix())
def test_kernels_use_exact_arithmetic_only(path: Path) -> None:
    for call in calls(path):
        name = call.func
        if isinstance(name, ast.Attribute) and isinstance(name.value, ast.Name) and name.value.id == "wp":
            assert name.attr in ALLOWED, f"{path.name}:{call.lineno}: wp.{name.attr}"
        if isinstance(name, ast.Attribute) and isinstance(name.value, ast.Name):
            assert name.value.id != "math", f"{path.name}:{call.lineno}: math.{name.attr}"
            banned = {"sin", "cos", "exp", "log", "power", "dot", "einsum", "matmul", "random"}
            banned |= set() if stable(call) else {"argsort"}
            assert name.value.id != "np" or name.attr not in banned, f"{path.name}:{call.lineno}: np.{name.attr}"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(FOLDER.parent).as_posix())
def test_no_power_operator_and_no_matrix_product(path: Path) -> None:
    for node in walk(parsed(path)):
        assert not isinstance(node, ast.Pow | ast.MatMult), path.name


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(FOLDER.parent).as_posix())
def test_atomics_take_integers_only(path: Path) -> None:
    """The target of each atomic is an array declared with an integer type in the same function."""
    for function in walk(parsed(path)):
        if not isinstance(function, ast.FunctionDef):
            continue
        kinds = {a.arg: ast.unparse(a.annotation) for a in function.args.args if a.annotation}
        for call in ast.walk(function):
            if isinstance(call, ast.Call) and ast.unparse(call.func).startswith("wp.atomic_"):
                kind = kinds[ast.unparse(call.args[0])]
                assert "int" in kind and not any(f in kind for f in FLOATING), f"{path.name}: {function.name}: {kind}"


def test_every_kernel_module_sets_the_options() -> None:
    for path in MODULES:
        source = path.read_text()
        if "@wp.func" in source or "@wp.kernel" in source:
            assert "wp.set_module_options(OPTIONS)" in source, path.name
    from recipe_runtime.render.device.setup import OPTIONS, wp

    assert OPTIONS["fuse_fp"] is False and OPTIONS["fast_math"] is False
    flags = (wp.config.cpu_compiler_flags or "").split()
    assert flags and all(flag.startswith("-mllvm=-inline-") for flag in flags), "no flag may name a CPU or change sums"


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(FOLDER.parent).as_posix())
def test_only_kernels_are_hidden_from_mypy(path: Path) -> None:
    """Modules that mypy ignores define only kernels, their functions and structs."""
    source = path.read_text()
    if "mypy: ignore-errors" in source:
        for node in parsed(path).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                kinds = {ast.unparse(d).partition("(")[0] for d in node.decorator_list}
                assert kinds & {"wp.func", "wp.kernel", "wp.struct"}, f"{path.name}: {node.name} runs on the host"


def test_noise_seeds_are_in_the_register() -> None:
    """A seed determines bytes. When seeds were literals in kernels, two patterns shared four of them by accident."""
    calls_of_noise = 0
    for path in MODULES:
        for call in calls(path):
            if ast.unparse(call.func) in {"noise2", "noise3", "hash2", "hash3"}:
                calls_of_noise += 1
                seed = ast.unparse(call.args[-1])
                assert re.fullmatch(r"wp\.uint32\(\d+\)", seed) is None, f"{path.name}:{call.lineno}: {seed}"
    assert calls_of_noise > 40


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(FOLDER.parent).as_posix())
def test_no_call_unpacks_a_tuple_that_its_function_packed(path: Path) -> None:
    """With the arguments in the call itself, a reader can match them with the parameters."""
    for function in (node for node in walk(parsed(path)) if isinstance(node, ast.FunctionDef)):
        nodes = list(ast.walk(function))
        pairs = [pair for node in nodes if isinstance(node, ast.Assign) for pair in assigned(node)]
        packed = {name for name, value in pairs if isinstance(value, ast.Tuple)} - {"shape"}  # one value: of an array
        called = [node for node in nodes if isinstance(node, ast.Call)]
        spread = {ast.unparse(a.value) for call in called for a in call.args if isinstance(a, ast.Starred)}
        assert not packed & spread, f"{path.name}: {function.name} unpacks {sorted(packed & spread)}"


def assigned(node: ast.Assign) -> list[tuple[str, ast.expr]]:
    """Return each name that an assignment binds, with its value."""
    target, value = node.targets[0], node.value
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return [(ast.unparse(name), part) for name, part in zip(target.elts, value.elts, strict=False)]
    return [(ast.unparse(target), value)]
