"""The work of choosing traffic does not grow with the number of variants of a town or with that of globs."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import towns
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.lowering import traffic
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Traffic

from tests.compiler.kitchen import small


def test_a_density_needs_each_town_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a few towns are kept in memory: with nine of them, each variant generated its town again."""
    built: list[int] = []

    def build(name: str, seed: int, parameters: str) -> SimpleNamespace:
        built.append(seed)
        return SimpleNamespace(lane_metres=1000.0 * seed, sidewalk_metres=0.0)

    monkeypatch.setattr(traffic, "built", build)
    traffic._metres.cache_clear()
    more = {"weather": {}, "traffic": {"density": {"vehicles": 2}}}
    bases = [Base(**small(town={"name": "plaza", "seed": seed}, **more)["base"]) for seed in range(20)]
    try:
        for _ in range(3):
            assert [traffic.counts(base)["vehicle"] for base in bases] == [2 * seed for seed in range(20)]
    finally:
        traffic._metres.cache_clear()
    assert built == list(range(20))


def test_globs_of_a_mix_compare_no_blueprints(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blueprints are compared by all of their fields, which took most of the time of lowering a mixed crowd."""

    def refuse(self: Blueprint, other: object) -> bool:
        raise AssertionError("compared")

    town, mix = towns.build("plaza", 0, {}), Traffic(vehicles=1, mix={"vehicle.*": 1, "vehicle.s*": 2})
    monkeypatch.setattr(Blueprint, "__eq__", refuse)
    assert traffic.blueprint("vehicle", mix, town, Stream(1, "a")).category == "vehicle"
