"""Kernel arguments are bound by name, and each kernel is launched in one place."""

from __future__ import annotations

import ast
from collections import Counter
from typing import no_type_check

import pytest
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp

from tests.sources import modules, walk

wp.set_module_options(OPTIONS)
BASE = "recipe_runtime/render/"


@no_type_check  # written in Warp's language
@wp.kernel
def _subtract(a: wp.int32, b: wp.int32, out: wp.array[wp.int32]):
    out[wp.tid()] = a - b


def test_arguments_are_bound_by_name() -> None:
    out = wp.zeros(2, dtype=wp.int32, device="cpu")
    launch(_subtract, 2, "cpu", out=out, b=1, a=5)
    assert out.numpy().tolist() == [4, 4]


@pytest.mark.parametrize("given", [{"a": 1}, {"a": 1, "b": 2, "c": 3}, {"a": 1, "c": 2}])
def test_missing_and_unknown_arguments_are_refused(given: dict[str, int]) -> None:
    out = wp.zeros(1, dtype=wp.int32, device="cpu")
    with pytest.raises(TypeError, match=r"missing arguments .* unknown arguments"):
        launch(_subtract, 1, "cpu", out=out, **given)


def test_every_kernel_is_launched_in_one_place() -> None:
    """Streams and single frames share their passes, so that a kernel's arguments are listed once."""
    kernels, launched = set(), Counter[str]()
    for path, tree in modules("recipe_runtime"):
        if not path.startswith(BASE):
            continue
        for node in walk(tree):
            if isinstance(node, ast.FunctionDef) and any(
                ast.unparse(d).partition("(")[0] == "wp.kernel" for d in node.decorator_list
            ):
                assert node.name not in kernels, f"two kernels are called {node.name}"
                kernels.add(node.name)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "launch":
                launched[ast.unparse(node.args[0]).split(".")[-1]] += 1
    assert len(kernels) >= 40
    assert launched == {**dict.fromkeys(kernels, 1)}
