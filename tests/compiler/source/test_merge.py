"""Merge patches and provenance."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from recipe_compiler.source.file_help import nearest_file
from recipe_compiler.source.merge import Merger, expand_shorthands, read
from recipe_compiler.source.yaml_reader import Value, parse


def value(data: Any, file: str = "a.yaml") -> Value:
    parsed, problems = parse(json.dumps({"it": data}).encode(), file)
    assert parsed is not None and not problems
    return parsed.map["it"]


# The examples of RFC 7386, appendix A, for maps. A patch that is not a map replaces the value, also at the root.
RFC_7386 = [
    ({"a": "b"}, {"a": "c"}, {"a": "c"}),
    ({"a": "b"}, {"a": None}, {}),
    ({"a": ["b"]}, {"a": "c"}, {"a": "c"}),
    ({"a": {"b": "c"}}, {"a": {"b": "d", "c": None}}, {"a": {"b": "d"}}),
    ({"a": [{"b": "c"}]}, {"a": [1]}, {"a": [1]}),
    ({"a": "b"}, ["c"], ["c"]),
    ({"a": "foo"}, None, None),
    ([1, 2], {"a": "b", "c": None}, {"a": "b"}),
    ({}, {"a": {"bb": {"ccc": None}}}, {"a": {"bb": {}}}),
]


@pytest.mark.parametrize(("target", "patch", "result"), RFC_7386)
def test_rfc_7386(target: Any, patch: Any, result: Any) -> None:
    assert Merger().merge(value(target), value(patch)).plain == result


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.text("ab", max_size=2),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.sampled_from("abc"), inner, max_size=3),
    max_leaves=8,
)


def reference(target: Any, patch: Any) -> Any:
    """Apply a merge patch by the algorithm of RFC 7386."""
    if not isinstance(patch, dict):
        return patch
    result = dict(target) if isinstance(target, dict) else {}
    for key, item in patch.items():
        if item is None:
            result.pop(key, None)
        else:
            result[key] = reference(result.get(key), item)
    return result


@pytest.mark.slow
@given(plain, plain)
def test_merging_follows_the_rfc(target: Any, patch: Any) -> None:
    assert Merger().merge(value(target), value(patch)).plain == reference(target, patch)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from("abc"), plain, max_size=3))
def test_an_empty_patch_gives_the_same_object(target: Any) -> None:
    before = value(target)
    assert Merger().merge(before, value({})) is before


def test_unchanged_values_are_the_same_objects() -> None:
    before = value({"a": {"b": 1}, "c": {"d": 2}})
    after = Merger().merge(before, value({"a": {"b": 3}}))
    assert after.map["c"] is before.map["c"]
    assert after.map["a"] is not before.map["a"]


def test_a_merged_value_has_the_place_of_its_patch() -> None:
    merged = Merger().merge(value({"a": {"b": 1, "c": 1}}), value({"a": {"b": 2, "d": 3}}, "delta.yaml"))
    files = {key: merged.place_of("a", key).file for key in "bcd"}
    assert files == {"b": "delta.yaml", "c": "a.yaml", "d": "delta.yaml"}


def test_an_error_of_a_removed_value_points_at_the_patch() -> None:
    merged = Merger().merge(value({"a": {"b": 1}}), value({"a": {"b": None}}, "delta.yaml"))
    assert merged.place_of("a", "b").file == "delta.yaml"


def test_a_delta_of_an_extending_file_may_remove(tmp_path: Path) -> None:
    """A null in a delta belongs to the delta, and does not remove keys of the extended file."""
    (tmp_path / "common.yaml").write_text("deltas: {one: {a: {x: 1}, b: {}}, two: {c: {}}}\nbase: {p: 1}\n")
    (tmp_path / "recipe.yaml").write_text(
        "extends: common.yaml\ndeltas: {one: {a: {y: null, z: {w: null}}, b: null, d: {x: null}}, two: null}\n"
    )
    root = read(tmp_path / "recipe.yaml").root
    assert root is not None
    assert root.map["deltas"].plain == {"one": {"a": {"x": 1, "y": None, "z": {"w": None}}, "d": {"x": None}}}


@pytest.mark.parametrize(
    ("below", "above", "merged"),
    [
        ("{weather: HardRainNoon}", "{weather: {fog_density: 60}}", {"preset": "HardRainNoon", "fog_density": 60}),
        ("{weather: {fog_density: 9}}", "{weather: HardRainNoon}", {"preset": "HardRainNoon"}),
        ("{weather: {fog_density: 9}}", "{weather: {wetness: 5}}", {"preset": "A", "fog_density": 9, "wetness": 5}),
        ("{weather: HardRainNoon}", "{}", {"preset": "HardRainNoon"}),
        ("{weather: null}", "{weather: {wetness: 5}}", {"wetness": 5}),
    ],
)
def test_a_delta_over_a_shorthand_keeps_it(tmp_path: Path, below: str, above: str, merged: dict[str, Any]) -> None:
    """Regression: the preset was lost. A shorthand replaces the whole weather of the base."""
    base = "base: {weather: {preset: A, wetness: 50}}"
    (tmp_path / "common.yaml").write_text(f"{base}\ndeltas: {{w: {{rain: {below}}}}}\n")
    (tmp_path / "middle.yaml").write_text("extends: common.yaml\ndeltas: {w: {rain: {}}}\n")
    (tmp_path / "recipe.yaml").write_text(f"extends: middle.yaml\ndeltas: {{w: {{rain: {above}}}}}\n")
    root = read(tmp_path / "recipe.yaml").root
    assert root is not None
    patched = expand_shorthands(Merger().merge(root.map["base"], root.map["deltas"].map["w"].map["rain"]))
    assert patched.map["weather"].plain == merged


few = st.none() | st.integers(0, 1)
maps = st.dictionaries(st.sampled_from("ab"), few | st.dictionaries(st.sampled_from("ab"), few), min_size=1)


@pytest.mark.slow
@given(base=maps, below=maps, above=maps)
@example(base={"a": {"b": 1}}, below={"a": None}, above={"a": {"a": 1}})
@example(base={"a": {"b": 1}}, below={"a": 1}, above={"a": {"a": 1}})
def test_joined_deltas_change_a_base_as_one_after_the_other(base: Any, below: Any, above: Any) -> None:
    """A delta over a delta of an extended file: also where one removes or replaces what the other changes."""
    layers = {"base": base, "deltas": {"w": {"a": below}}}, {"extends": "below.yaml", "deltas": {"w": {"a": above}}}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "below.yaml").write_text(json.dumps(layers[0]))
        (Path(folder) / "recipe.yaml").write_text(json.dumps(layers[1]))
        merged = read(Path(folder) / "recipe.yaml").root
    assert merged is not None
    delta = merged.map["deltas"].map["w"].map["a"]
    assert Merger().merge(merged.map["base"], delta).plain == reference(reference(base, below), above)


def test_a_name_without_its_ending_is_recognised(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("recipe: mine\n")
    assert nearest_file(tmp_path / "mine") == 'did you mean "mine.yaml"?'
    assert nearest_file(tmp_path / "other") is None


def test_a_recipe_is_not_suggested_as_its_own_base(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("recipe: bad\nextends: base.yaml\n")
    (problem,) = read(tmp_path / "bad.yaml").problems
    assert "base.yaml" in problem.message and problem.help == "paths are relative to this file"
