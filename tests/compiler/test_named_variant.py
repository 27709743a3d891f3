"""A plan's variant by name: the error for an unknown name suggests a similar one."""

from __future__ import annotations

import pytest
from recipe_compiler.ir.errors import InputError

from tests.compiler.kitchen import compiled, small


@pytest.mark.parametrize(
    ("name", "meant"),
    [("wet", "w=wet,t=noon"), ("w=wet", "w=wet,t=noon"), ("dusk,wet", "w=wet,t=dusk"), ("t=dusk", "w=dry,t=dusk")],
)
def test_a_value_of_an_axis_suggests_a_variant_with_it(name: str, meant: str) -> None:
    axes = {"w": {"dry": {}, "wet": {"weather": {"wetness": 60}}}, "t": {"noon": {}, "dusk": {"time": "19:40"}}}
    with pytest.raises(InputError, match=f"did you mean '{meant}'"):
        compiled(small() | {"deltas": axes}).plan.named(name)


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


@pytest.mark.parametrize("name", [0, {"w": "wet"}])
def test_a_variant_is_a_name(name: object) -> None:
    with pytest.raises(TypeError, match="a variant is a name, such as 'base', not "):
        compiled(small()).plan.named(name)  # type: ignore[arg-type]
