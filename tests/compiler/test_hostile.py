"""An untrusted recipe takes bounded time and memory, and fails only with an InputError."""

from __future__ import annotations

import json
import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError
from recipe_compiler.source.yaml_reader import MAX_BYTES, parse

from tests.compiler.kitchen import SMALL, compiled

GOOD = json.dumps(SMALL, indent=1)

PATHOLOGICAL: dict[str, Callable[[], bytes]] = {
    "brackets": lambda: b"[" * MAX_BYTES,
    "dashes": lambda: b"- " * (MAX_BYTES // 2),
    "long_key": lambda: b"a" * (MAX_BYTES - 2) + b": ",
    "digits": lambda: b"recipe: " + b"1" * (MAX_BYTES - 10),
    "sexagesimal": lambda: b"recipe: " + b"1:" * (MAX_BYTES // 2 - 10) + b"x",
    "odd_indentation": lambda: b"".join(b"k%d: 1\n" % n for n in range(60_000)) + b"  b: 1",
    "many_axes": lambda: (
        GOOD[:-1].encode()
        + b', "deltas": {'
        + b",".join(b'"a%d": {"x": {}, "y": {}}' % n for n in range(20_000 // 8))
        + b"}}"
    ),
    "stars": lambda: GOOD.replace("walker.pedestrian.*", "*?" * 32).encode(),
    "exclusions": lambda: (
        GOOD[:-1].encode()
        + b', "deltas": {"a": {'
        + b",".join(b'"v%d": {}' % n for n in range(5000))
        + b'}}, "sweep": {"exclude": ['
        + b",".join(b'{"a": "v%d"}' % n for n in range(1001))
        + b"]}}"
    ),
    "too_large": lambda: b"#" * (MAX_BYTES + 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PATHOLOGICAL)
def test_pathological_files_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_bytes(PATHOLOGICAL[name]())
    with pytest.raises(InputError) as caught:
        compile_recipe(path)
    assert len(str(caught.value).splitlines()[0]) < 1000 + len(str(path))


def test_an_alias_bomb_takes_no_memory(tmp_path: Path) -> None:
    lines = [b"a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [b"a%d: &a%d [%s]" % (n, n, b", ".join([b"*a%d" % (n - 1)] * 10)) for n in range(1, 30)]
    tracemalloc.start()
    parse(b"\n".join(lines), "bomb.yaml")
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


@pytest.mark.parametrize("around", [b"{x: %s}", b"[%s]"])
def test_aliases_nest_no_deeper_than_brackets(around: bytes) -> None:
    """Regression: values 1,000 maps deep, of which no line had more than 27, ended in a RecursionError."""

    def nested(depth: int, inner: bytes) -> bytes:
        return nested(depth - 1, around % inner) if depth else inner

    lines = [b"a0: &a0 " + nested(20, b"1"), b"a1: &a1 " + nested(11, b"*a0")]  # 31 with the map of the file
    assert parse(b"\n".join(lines), "deep.yaml")[1] == []
    _, problems = parse(b"\n".join([*lines, b"a2: " + nested(1, b"*a1")]), "deep.yaml")
    (problem,) = problems
    assert problem.place is not None and problem.place.line == 3
    assert problem.message == "33 maps or lists inside each other, the limit is 32"
    assert problem.help == "a recipe needs no more than eight: nest aliases less"


def test_a_pipe_or_a_device_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "recipe.yaml")
    with pytest.raises(InputError, match="not a regular file"):
        compile_recipe(tmp_path / "recipe.yaml")
    with pytest.raises(InputError, match="not a regular file"):
        compile_recipe(Path("/dev/zero"))


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_any_bytes_are_refused_with_an_input_error(content: bytes) -> None:
    value, problems = parse(content, "x.yaml")
    assert value is not None or problems


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_any_broken_recipe_is_refused_with_an_input_error(data: st.DataObject) -> None:
    """Any value anywhere in a recipe causes at most an InputError, each of whose problems has a place."""
    junk = st.recursive(
        st.none() | st.booleans() | st.integers() | st.text(max_size=9) | st.sampled_from(["*", "a" * 300, "12:00"]),
        lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
        max_leaves=4,
    )
    recipe = json.loads(GOOD)
    recipe |= {
        "deltas": {"w": {"a": {}, "b": {"weather": "WetNoon"}}},
        "sweep": {"axes": ["w"], "repeats": 1},
        "output": {},
    }
    here, parent, key = recipe, recipe, "recipe"
    while isinstance(here, dict) and here and (parent is recipe or data.draw(st.booleans())):
        parent, key = here, data.draw(st.sampled_from(sorted(here)))
        here = parent[key]
    parent[key] = data.draw(junk)
    try:
        compiled(recipe)
    except InputError as error:
        assert all(problem.place for problem in error.problems)
        assert str(error).replace("\n", "").isprintable()
