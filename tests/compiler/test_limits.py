"""Cost before work."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.expand import count
from recipe_compiler.limits import TooLargeError
from recipe_compiler.schema.models import Sweep

from tests.compiler.kitchen import compiled, small


def test_shared_work_is_counted_once() -> None:
    deltas = {
        "weather": {"sunny": {}, "rainy": {"weather": "MidRainyNoon"}, "foggy": {"weather": {"fog_density": 90}}},
        "jitter": {"still": {"sensors": {"street": {"motion": None}}}, "shaky": {}},
        "exposure": {"dark": {"sensors": {"street": {"camera": {"exposure": -1}}}}, "light": {}},
    }
    cost = compiled(small() | {"deltas": deltas}).cost
    assert str(cost) == "12 variants: 1 simulation, 2 observations, 12 appearances"
    assert (cost.frames, cost.images) == (48, 96)


def test_labels_are_paid_for_once() -> None:
    one = compiled(small()).cost
    two = compiled(small() | {"deltas": {"w": {"a": {}, "b": {"weather": "WetNoon"}}}}).cost
    assert one.bytes < two.bytes < 2 * one.bytes
    assert one.minutes <= two.minutes


def test_a_large_recipe_needs_an_explicit_yes(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    still = {"street": {"mount": {}, "camera": {"width": 16, "height": 16}, "capture": ["rgb"]}}
    path.write_text(json.dumps(small(clock={"fps": 10, "frames": 60_000}, sensors=still) | {"sweep": {"repeats": 2}}))
    with pytest.raises(TooLargeError) as caught:
        compile_recipe(path)
    assert caught.value.cost.frames == 120_000
    assert compile_recipe(path, allow_large=True).cost.frames == 120_000


def test_half_the_free_disk_is_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(small()))
    needed = compile_recipe(path).cost.bytes
    compile_recipe(path, free_disk=2 * needed)
    with pytest.raises(TooLargeError, match="half the free disk"):
        compile_recipe(path, free_disk=2 * needed - 2)


def test_a_product_is_counted_without_being_built() -> None:
    axes = {f"axis{n}": dict.fromkeys(map(str, range(1000)), None) for n in range(40)}
    assert count(axes, Sweep(repeats=7)) == 7 * 1000**40  # type: ignore[arg-type]
