"""One run reports mistakes in deltas and in other parts of the recipe."""

from __future__ import annotations

from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError

from tests.compiler.kitchen import compiled, small

DELTAS = {"weather": {"foggy": {"weather": {"fog_density": 100}}, "sunny": {"wether": {}}}}
ASSETS = {"sign": {"image": {"file": "a.png", "sha256": "0" * 64}}}


def mistakes(recipe: dict[str, Any]) -> list[str]:
    with pytest.raises(InputError) as caught:
        compiled(recipe)
    return [problem.message for problem in caught.value.problems]


@pytest.mark.parametrize(
    "wrong",
    [
        {"output": {"annotations": ["kw"]}},
        {"sweep": {"axes": ["wether"]}},
        {"sed": 1},
        {"assets": 3},
    ],
    ids=str,
)
def test_mistakes_in_other_parts_do_not_hide_those_in_deltas(wrong: dict[str, Any]) -> None:
    """Regression: mistakes in deltas were reported only after the others had been corrected."""
    assert len(mistakes(small() | wrong)) == 1
    found = mistakes(small() | {"deltas": DELTAS} | wrong)
    assert 'unknown key "wether" in base' in found and len(found) == 2


def test_values_that_depend_on_another_axis_are_no_mistakes() -> None:
    walker = {"blueprint": "walker.pedestrian.0001", "start": {"x": -5, "y": 8}, "goal": {"x": -5, "y": 0}}
    deltas = {
        "who": {"one": {"actors": {"second": walker}}, "two": {"actors": {"second": {**walker, "speed": 2.0}}}},
        "pace": {name: {"actors": {"second": {"speed": speed}}} for name, speed in (("slow", 1.0), ("fast", 2.0))},
    }
    assert mistakes(small() | {"deltas": deltas, "sed": 1}) == ['unknown key "sed"']


def test_excluded_combinations_are_not_checked() -> None:
    deltas = {"who": {"none": {"actors": None}}, "pace": {"fast": {"actors": {"hero1": {"speed": 2.0}}}}}
    sweep = {"exclude": [{"who": "none", "pace": "fast"}]}
    found = mistakes(small() | {"deltas": deltas, "sweep": sweep, "sed": 1})
    assert [message for message in found if "hero1" in message] == []
