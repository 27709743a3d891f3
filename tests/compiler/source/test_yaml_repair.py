"""The error for a recipe with one wrongly indented line names that line."""

from __future__ import annotations

import re
import time

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from recipe_compiler.source.yaml_reader import parse
from recipe_compiler.source.yaml_repair import misindented_line

LINES = """recipe: street
seed: 1
base:
  clock: {fps: 10, frames: 2}
  town: {name: downtown}
  actors:
    hero:
      blueprint: walker.pedestrian.0001
      start: {x: -4, y: 0}
      route:
        - {x: -4, y: 4}
        - {x: -4, y: 8}
        - x: -4
          y: 12
    friend:
      blueprint: walker.pedestrian.0002
      start: {x: -5, y: 0}
  sensors:
    street:
      mount: {x: -4.8, y: -8.5}
      capture:
        - rgb
        - depth
deltas:
  weather:
    dry: {}
    wet: {weather: HardRainNoon}
""".splitlines()


@pytest.mark.slow
@given(number=st.integers(1, len(LINES)), change=st.sampled_from([-2, -1, 1, 2, "tab", "spaces and tab"]))
@example(number=7, change=-1)  # the key of a map with lines below it, and a sibling eight lines away
@example(number=11, change=-2)  # the first item of a list
@example(number=16, change=1)  # the first of two entries
def test_the_line_that_was_changed_is_named(number: int, change: int | str) -> None:
    own = LINES[number - 1]
    before = len(own) - len(own.lstrip())
    if isinstance(change, int):
        start = " " * max(before + change, 0)
    else:
        start = "\t" * (before // 2) if change == "tab" else " " * max(before - 2, 0) + "\t" * (before > 0)
    changed = [*LINES[: number - 1], start + own.lstrip(), *LINES[number:]]
    _, problems = parse(("\n".join(changed) + "\n").encode(), "f.yaml")
    if not problems or "duplicate key" in problems[0].message:
        return  # the change is another document in valid YAML
    problem = problems[0]
    assert problem.place is not None and problem.place.line == number
    right = re.search(r"start line (\d+) with \d+ space", problem.help or "")
    assert right is None or int(right[1]) == number


def test_the_error_refers_to_lines_of_a_list() -> None:
    _, (problem,) = parse(b"a:\n   - {b: 1}\n  - {b: 1}\n  - {b: 1}\n", "f.yaml")
    assert problem.message == "wrong indentation: lines 2 and 3 belong to one list, and start with 3 and 2 spaces"
    assert problem.help == "give them the same indentation: start line 2 with 2 spaces"


def test_the_number_of_attempts_is_bounded() -> None:
    tried: list[int] = []

    def parses(text: str) -> bool:
        tried.append(len(text))
        return False

    lines = [f"{' ' * (n % 7)}key{n}: {'x' * 200}" for n in range(300)]
    assert misindented_line(lines, 300, parses) is None
    assert 0 < sum(tried) < 400_000


@pytest.mark.slow
@pytest.mark.parametrize(
    "lines",
    [["a:", "   b: 1", "  " + "c" * 900_000], [f"k{n}: 1" for n in range(60_000)] + ["  b: 1"]],
    ids=["a long line", "many lines"],
)
def test_a_large_text_takes_little_time(lines: list[str]) -> None:
    """Squares of its length would take minutes."""
    before = time.process_time()
    _, problems = parse("\n".join(lines).encode(), "f.yaml")
    assert problems and time.process_time() - before < 20.0
