"""Expansion of axes and draws to variants, and warnings about conflicts between them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.checks.outline import outline
from recipe_compiler.source.merge import Merger

from tests.compiler.kitchen import compiled, small

SPEED = {"actors.hero1.speed": {"uniform": [1, 2]}}

FOG = {"clear": {}, "foggy": {"weather": {"fog_density": 100}}}


def drawing(deltas: dict[str, Any], *paths: str) -> dict[str, Any]:
    values = {path: {"uniform": [0, 10]} for path in paths}
    return small() | {"deltas": deltas, "sweep": {"draw": {"count": 1, "values": values}}}


@pytest.mark.parametrize("path", ["weather.fog_density", "actors.hero1.start.x"])
def test_a_draw_that_overrides_an_axis_causes_a_warning(path: str) -> None:
    deltas = {"fog": FOG, "place": {"here": {}, "there": {"actors": {"hero1": {"start": {"x": -5, "y": 8}}}}}}
    result = compiled(drawing(deltas, path))
    (warning,) = result.warnings
    axis = "fog" if "fog" in path else "place"
    assert warning.message == f"axis {axis} and sweep.draw both set {path}"
    assert warning.help == "the draw wins"
    assert warning.place is not None and warning.place.line > 70  # in the sweep, not in the delta
    if axis == "fog":
        assert len({v.appearance.weather.fog_density for v in result.plan.variants}) == 1


def test_a_draw_without_a_conflict_causes_no_warning() -> None:
    assert compiled(drawing({"fog": FOG}, "weather.wetness")).warnings == ()


def test_a_draw_over_a_preset_causes_a_warning() -> None:
    (warning,) = compiled(drawing({"w": {"a": {}, "b": {"weather": "WetNoon"}}}, "weather.wetness")).warnings
    assert warning.message == "axis w and sweep.draw both set weather.wetness"


def test_a_draw_that_replaces_an_earlier_draw_causes_a_warning() -> None:
    """All draws of the fog would be lost, silently; in the other order both have an effect."""
    fog, preset = {"weather.fog_density": {"uniform": [10, 20]}}, {"weather": {"choice": ["WetNoon"]}}
    (warning,) = compiled(small() | {"sweep": {"draw": {"count": 2, "values": fog | preset}}}).warnings
    assert warning.message == "sweep.draw replaces weather after it has drawn weather.fog_density, which is lost"
    assert warning.help == "draw weather first"
    result = compiled(small() | {"sweep": {"draw": {"count": 2, "values": preset | fog}}})
    assert not result.warnings and len({v.appearance.weather.fog_density for v in result.plan.variants}) == 2


@pytest.mark.parametrize(
    "sweep",
    [{}, {"repeats": 3}, {"exclude": [{"w": "a", "m": "y"}], "repeats": 2, "draw": {"count": 2, "values": SPEED}}],
)
def test_completion_names_variants_without_merging_them(
    tmp_path: Path, sweep: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The names of 500 variants took 27 s and 2.9 GB, as each was merged."""
    deltas = {"w": {"a": {}, "b": {"weather": "WetNoon"}}, "m": {"x": {}, "y": {"actors": {"hero1": {"speed": 2}}}}}
    recipe = small() | {"deltas": deltas, "sweep": sweep}
    path = tmp_path / "recipe.yaml"
    path.write_text(json.dumps(recipe))
    plans = compiled(recipe).plan.variants
    monkeypatch.setattr(Merger, "merge", lambda *_: pytest.fail("a variant was merged"))
    assert outline(path).variants == tuple(plan.variant for plan in plans)
