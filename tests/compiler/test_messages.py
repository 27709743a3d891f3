"""Errors are plain, reported once, and have their variant, a remedy, and a suggestion if a name is similar."""

from __future__ import annotations

import difflib
import json
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import MAX_SHOWN, Code, InputError, Problem
from recipe_compiler.library.blueprints import names
from recipe_compiler.schema import messages
from recipe_compiler.schema.messages import near, nearest
from recipe_compiler.source.yaml_reader import parse

from tests.compiler.kitchen import small


def wrong(folder: Path, recipe: object) -> tuple[Problem, ...]:
    path = folder / "recipe.yaml"
    path.write_text(recipe if isinstance(recipe, str) else json.dumps(recipe))
    with pytest.raises(InputError) as caught:
        compile_recipe(path)
    return caught.value.problems


@pytest.mark.parametrize(
    ("text", "place", "message", "help"),
    [
        (
            "base:\n    clock: 1\n  town: 2\n",
            (3, 3),
            "lines 2 and 3 belong to one map, and start with 4 and 2 spaces",
            "start both with the same number of spaces",
        ),
        ("recipe: a\n  seed: 1\n", (2, 3), "lines 1 and 2 belong to one map", "same number of spaces"),
        ("a:\n   - b\n  - c\n", (3, 3), "lines 2 and 3 belong to one list, and start with 3 and 2", "same number"),
        ("a:\n- {b: 1}\n  - {b: 2}\n", (3, 3), "further right than the entry above it", "same number of spaces"),
        # brackets that are not closed within a line whose indentation is also that of a map further up
        ("a: {b: #ff0000}\nc: 1\n", (1, 8), "starts a comment, which hides the rest of line 1", '"#ff0000"'),
        ("a:\n  - {b: 1}\n  c: 2\n", (3, 3), "a key of a map is among the items of a list", "every entry"),
        ("a:\n\tb: 1\n", (2, 1), "a tab cannot indent YAML", "use spaces"),
        ("a: {b: 1\n", (2, 1), "the `{` of line 1 is not closed", "add the `}`"),
        ("a: 'x\nb: 1\n", (1, 4), "the quote opened on line 1 is never closed", "add the closing quote"),
        ('a: "x\nb: "y"\n', (2, 5), "text follows a closing quote", "a quote that is not closed"),
        ("a:\n  hero\n    b: 1\n", (2, 3), "a `:` is missing after `hero`", "write `hero:`"),
        ("a:\n  b: 1\n  speed:1.4\n", (3, 3), "a space is missing after `speed:`", "write `speed: `"),
        ("a: 1\nseed 3\nb: 1\n", (2, 1), "a `:` and a space are missing after `seed`", "write `seed: `"),
        ("a: 1\n'seed' 3\nb: 1\n", (3, 1), "line 2 has no `: ` after its key", "with a space after the colon"),
        ("a: b: c\n", (1, 5), "a second `: ` in this line", "quote a text"),
        ("a: 1\n- b\n", (2, 1), "an item of a list, with `-`, is among the keys of a map", "below the key"),
        ("a: 1\n}\n", (2, 1), "closes a bracket that is not open", "remove it"),
    ],
)
def test_errors_of_yaml_are_explained(text: str, place: tuple[int, int], message: str, help: str) -> None:
    _, (problem,) = parse(text.encode(), "f.yaml")
    assert problem.place is not None and (problem.place.line, problem.place.column) == place
    assert message in problem.message and problem.help is not None and help in problem.help
    assert problem.code is Code.YAML_SYNTAX


def test_correct_indentation_gets_no_hint() -> None:
    for text in ("a:\n  b: 1\n  c: 2\n", "a:\n- b\n- c\n", "a: |\n  x\n   y\nb: 1\n", "a:\n  - b: 1\n    c: 2\n"):
        assert parse(text.encode(), "f.yaml")[1] == []


def test_a_map_that_is_too_long_has_its_number_of_entries_in_the_message(tmp_path: Path) -> None:
    assets = {f"crate{n}": {"mesh": "crate.glb"} for n in range(101)}
    (problem,) = wrong(tmp_path, {**small(), "assets": assets})
    assert problem.message == "assets: 101 items exceed the limit of 100"


def test_an_error_of_one_variant_names_it_and_its_town(tmp_path: Path) -> None:
    deltas = {"w": {"dry": {}, "wet": {"weather": {"wetness": 900}}}}
    (problem,) = wrong(tmp_path, small() | {"deltas": deltas})
    assert problem.note == "in variant w=wet, town downtown"
    assert "(in variant w=wet, town downtown)" in str(problem)


def test_an_error_of_every_variant_names_none(tmp_path: Path) -> None:
    deltas = {"w": {"dry": {}, "wet": {"weather": {"wetness": 9}}}}
    (problem,) = wrong(tmp_path, small(traffic={"vehicles": -1}) | {"deltas": deltas})
    assert problem.note is None


def test_an_error_of_several_variants_is_reported_once_with_their_number(tmp_path: Path) -> None:
    deltas = {"w": {"dry": {}, "wet": {"weather": {"wetness": 900}}}, "h": {"a": {}, "b": {"time": "12:00"}, "c": {}}}
    (problem,) = wrong(tmp_path, small() | {"deltas": deltas})
    assert problem.note == "in variant w=wet,h=a, town downtown, and in 2 other variants"


@pytest.mark.slow
def test_a_town_without_room_is_reported_with_its_variant(tmp_path: Path) -> None:
    deltas = {"t": {"wide": {}, "narrow": {"town": {"name": "plaza", "blocks": None}, "traffic": {"vehicles": 249}}}}
    (problem,) = wrong(tmp_path, small() | {"deltas": deltas})
    assert problem.code is Code.NO_ROOM and problem.note == "in variant t=narrow, town plaza"


def test_an_error_shows_the_line_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "street.yaml").write_text("base:\n  clock: {fps: 10, frames: 0}\n")
    (problem, *_) = wrong(tmp_path, "recipe: x\nextends: street.yaml\n")
    assert (problem.source, problem.place and problem.place.line) == ("  clock: {fps: 10, frames: 0}", 2)


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("walker.pedestrain.0001", "walker.pedestrian.0001"),
        ("walker.pedestrian.9999", None),  # another number is not a typing error
        ("vehicle.bicycle.rode", None),
    ],
)
def test_a_blueprint_is_suggested_only_if_its_name_is_similar(word: str, expected: str | None) -> None:
    found = near(word, names())
    assert found == expected or (expected is None and found is not None and found.split(".")[1] == word.split(".")[1])


def test_the_text_of_many_errors_ends_with_their_number() -> None:
    lines = str(InputError(Problem(f"wrong {n}") for n in range(MAX_SHOWN + 7))).splitlines()
    assert len(lines) == MAX_SHOWN + 1 and lines[-1] == "and 7 more"


def test_names_of_the_same_family_are_listed_first() -> None:
    """Regression: for `wall.7`, the remedy listed the roads of a town and no wall."""
    names = [*(f"road.x.{n}" for n in range(20)), "wall.0", "wall.1"]
    remedy = nearest("wall.7", names)
    assert remedy.startswith("valid are wall.0, wall.1, road.x.0, ") and remedy.endswith("and 10 more")
    assert nearest("poster", names).startswith("valid are road.x.0, ")


@pytest.mark.slow
def test_many_wrong_names_are_not_all_compared_with_many_valid_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: comparing all names of a recipe of 400 KB took minutes; at most 50 errors are shown."""
    compared = []
    original = difflib.get_close_matches

    def counted(word: str, names: list[str], **more: Any) -> list[str]:
        compared.append(len(names))
        return original(word, names, **more)

    monkeypatch.setattr(difflib, "get_close_matches", counted)
    valid = [f"actor{n:04}{'abcdefgh' * 6}" for n in range(900)]
    suggestions = messages.Suggestions(valid)
    remedies = [suggestions.nearest(f"{name}x") for name in valid]
    assert len(compared) == MAX_SHOWN and max(compared) <= 30
    assert remedies[:MAX_SHOWN] == [f'did you mean "{name}"?' for name in valid[:MAX_SHOWN]]
    assert remedies[-1].startswith(f"valid are {valid[0]}, ") and remedies[-1].endswith("and 888 more")


@pytest.mark.parametrize(
    ("change", "help"),
    [
        ({"clock": {"fps": 29.97, "frames": 2}}, "write it in digits, without quotes or a fraction"),
        ({"clock": {"fps": None, "frames": 2}}, "write a whole number after the `:`"),
        ({"clock": {"fps": 1000, "frames": 2}}, "write 240, the nearest that does"),
        ({"clock": {"fps": "30 fps", "frames": 2}}, "write the number alone"),
        ({"sensors": {"s": {"mount": {"z": "1,8"}, "capture": ["rgb"]}}}, "write a decimal point, not a comma"),
        (
            {"sensors": {"s": {"mount": {"z": 2}, "capture": "rgb, depth"}}},
            "write it in square brackets, such as [rgb, depth]",
        ),
        ({"actors": {"a": {"blueprint": "walker.pedestrian.4"}}}, 'did you mean "walker.pedestrian.0004"?'),
        ({"actors": {"a": {"blueprint": "sedan"}}}, 'did you mean "vehicle.sedan.*"?'),
        ({"props": {"p": {"asset": "crate", "at": {"x": 1, "y": 2}}}}, "name a mesh file in `assets`"),
        (
            {"sensors": {"s": {"mount": {"z": 2}, "capture": ["rgb - depth"]}}},
            "start every `- ` of the list in the same column",
        ),
        ({"actors": {"a": {"blueprint:walker.*": None}}}, "put a space after the colon"),
        ({"sensors": {"s": {"transform": {"z": 2}}}}, 'use "mount", which is CARLA\'s transform'),
        ({"town": {"name": "suburb", "storeys": 3}}, "remove it: it is a parameter of downtown and plaza"),
        ({"clock": "fps:10"}, "put a space after the colon"),
    ],
)
def test_wrong_values_and_keys_have_remedies(tmp_path: Path, change: dict[str, object], help: str) -> None:
    assert help in [problem.help for problem in wrong(tmp_path, small(**change))]


def test_a_configuration_of_carla_is_to_be_imported(tmp_path: Path) -> None:
    first, *_ = wrong(tmp_path, "carla: {seed: 1}\nspawn_actors: []\n")
    assert first.help == "`recipe import carla` writes the recipe of a configuration of CARLA's data collector"
