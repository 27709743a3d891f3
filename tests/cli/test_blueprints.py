"""`recipe blueprints`: a table, JSON and pictures of the library, the same bytes each time."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from PIL import Image
from recipe_cli.commands.blueprints import command
from recipe_compiler.blueprints import LIBRARY
from recipe_compiler.errors import InputError, RunError


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, list(arguments), catch_exceptions=False)


def test_the_table_has_a_row_for_each() -> None:
    lines = run().stdout.splitlines()
    assert lines[0].split() == ["blueprint", "kind", "size,", "m", "tag", "m/s", "colours"]
    assert [line.split()[0] for line in lines[1:]] == [blueprint.id for blueprint in LIBRARY]
    (bus,) = run("vehicle.bus.city").stdout.splitlines()[1:]
    assert bus.startswith("vehicle.bus.city  bus   8.30 x 2.35 x 2.95  16 Bus  7    glass, headlight, paint")


def test_json_tells_what_a_program_needs() -> None:
    rows = json.loads(run("*.bicycle.*", "--json").stdout)
    assert {row["class"] for row in rows} == {"Bicycle"}
    assert rows[0]["attributes"] == {"base_type": "bicycle", "number_of_wheels": "2"}
    assert rows[0]["size"].keys() == {"length", "width", "height"}
    assert rows[0]["look"].keys() >= {"paint", "shirt", "hat"}
    child = next(row for row in json.loads(run("--json").stdout) if row["id"] == "walker.pedestrian.0013")
    assert (child["attributes"], child["size"]) == ({"generation": "child"}, {"height": 1.05})


def test_only_what_is_worn_has_a_colour() -> None:
    looks = {row["id"]: row["look"] for row in json.loads(run("walker.*", "--json").stdout)}
    assert "bag" in looks["walker.pedestrian.0003"] and "bag" not in looks["walker.pedestrian.0001"]
    assert "hat" in looks["walker.pedestrian.0007"] and "hat" not in looks["walker.pedestrian.0001"]


@pytest.mark.parametrize(
    ("pattern", "remedy"),
    [
        ("vehicle.seden.*", '"vehicle.seden.*" matches no blueprint; did you mean "vehicle.sedan.*"?'),
        ("", '"" matches no blueprint; valid are vehicle.bicycle.*'),
        ("?" * 5000, "matches no blueprint; valid are"),
    ],
)
def test_a_pattern_that_matches_nothing_is_answered(pattern: str, remedy: str) -> None:
    with pytest.raises(InputError) as error:
        run(pattern)
    assert remedy in str(error.value)


def test_pictures_are_the_same_bytes_twice(tmp_path: Path) -> None:
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder in folders:
        done = run("vehicle.[bm]*.b", "--pictures", str(folder))
        assert done.stderr == f"{folder}: 2 pictures, and blueprints.jpg\n"
    names = sorted(path.name for path in folders[0].iterdir())
    assert names == ["blueprints.jpg", "vehicle.bicycle.b.png", "vehicle.motorcycle.b.png"]
    for name in names:
        body = (folders[0] / name).read_bytes()
        assert body == (folders[1] / name).read_bytes()
        with Image.open(io.BytesIO(body)) as picture:
            assert len(picture.getcolors(1 << 20)) > 500  # something is to be seen


def test_pictures_need_a_place(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no folder"):
        run("vehicle.bus.*", "--pictures", str(tmp_path / "missing" / "folder"))
    (tmp_path / "taken").write_text("")
    with pytest.raises((InputError, RunError, SystemExit)):
        result = CliRunner().invoke(command, ["vehicle.bus.*", "--pictures", str(tmp_path / "taken")])
        raise result.exception or AssertionError("it wrote over a file")
