"""A plan's variant by name: the error for an unknown name suggests a similar one."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.errors import InputError

from tests.compiler.kitchen import compiled, small


@pytest.mark.parametrize(
    ("name", "help"),
    [
        ("w=wett", "did you mean 'w=wet'? `recipe plan` lists all"),
        ("foo", "the first is 'w=dry', and `recipe plan` lists all"),
    ],
)
def test_only_a_similar_name_is_suggested(name: str, help: str) -> None:
    recipe = small() | {"deltas": {"w": {"dry": {}, "wet": {"weather": {"wetness": 60}}}}}
    with pytest.raises(InputError) as caught:
        compiled(recipe).plan.named(name)
    assert caught.value.problems[0].help == help
