"""Maps of categories: those of users, and what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from recipe_cli.commands.export import command
from recipe_compiler.ir.errors import InputError
from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.transfer.export import INDEX, export
from recipe_runtime.transfer.formats.category_map import CARLA, COCO, chosen

from tests.runtime.fakes import quiet


def test_each_class_has_a_category_of_the_named_maps() -> None:
    for known in (CARLA, COCO):
        assert known.ids.keys() == CATEGORIES.keys() and {*known.ids.values()} <= known.names.keys()
    assert {COCO.names[COCO.ids[tag]] for tag in (12, 13)} == {"person"}
    assert (COCO.names[8], COCO.ids[15]) == ("truck", 8)  # as in COCO's own files


@pytest.mark.parametrize(
    ("text", "ids", "names"),
    [
        ("Pedestrian: person\nRider: person\nCar: car\n", {12: 1, 13: 1, 14: 2}, {1: "person", 2: "car"}),
        ("Car: {id: 7, name: road user}\nTruck: {id: 7, name: road user}\n", {14: 7, 15: 7}, {7: "road user"}),
    ],
)
def test_a_users_map(tmp_path: Path, text: str, ids: dict[int, int], names: dict[int, str]) -> None:
    (tmp_path / "map.yaml").write_text(text)
    found = chosen(str(tmp_path / "map.yaml"))
    assert (found.ids, found.names) == (ids, names)
    assert found.id(14001) == ids[14] and found.id(18001) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Cra: car", "'Cra' is no class; did you mean Car?"),
        ("Car: car\nTruck: {id: 2, name: truck}", "some lines state an id, and others do not"),
        ("Car: {id: 1, name: car}\nTruck: {id: 1, name: truck}", "id 1 is both car and truck"),
        ("Car: {id: 0, name: car}", "Expected `int` >= 1"),
        ("Car: 3", "Expected `str | object`, got `int`"),
        ("Car: {id: 1}", "missing required field `name`"),
        ("Car: ''", "not text of 1 to 100 characters"),
        ('Car: "a\\nb"', "not text of 1 to 100 characters"),
        ("{}", "it has no line"),
        ("- Car", "Expected `object`, got `array`"),
        ("Car: [", "while parsing"),
        ("# " + "x" * 70_000, "more than 65,536 bytes"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    done = CliRunner().invoke(
        command, ["x", str(tmp_path / "o"), "--format", "yolo", "--categories", f"{tmp_path}/map.yaml"]
    )
    assert isinstance(done.exception, InputError)
    assert f"{tmp_path}/map.yaml: " in str(done.exception) and message in str(done.exception)


def test_an_unknown_map_is_named(tmp_path: Path) -> None:
    for name in ("cocoa", str(tmp_path)):
        with pytest.raises(InputError, match=r"cannot be read|regular file"):
            chosen(name)


@pytest.mark.slow
def test_an_export_is_of_the_content_of_its_map(tiny: Dataset, tmp_path: Path) -> None:
    """An export with a changed map is another one; one with an equal map in another file is the same."""
    one, other, equal = (tmp_path / name for name in ("one.yaml", "other.yaml", "equal.yaml"))
    one.write_text("Pedestrian: person\n")
    other.write_text("Truck: lorry\n")
    equal.write_text("Pedestrian: {id: 1, name: person}\n")
    made = [
        export(tiny, tmp_path / path.stem, "yolo", quiet, options={"categories": str(path)}) for path in (one, other)
    ]
    assert made[0].rows != made[1].rows
    assert json.loads((tmp_path / "one" / INDEX).read_text())["categories"] == "Pedestrian: 1 person"
    with pytest.raises(InputError, match="is not this export"):
        export(tiny, tmp_path / "one", "yolo", quiet, options={"categories": str(other)})
    again = export(tiny, tmp_path / "one", "yolo", quiet, options={"categories": str(equal)})
    assert {row["file"]: row for row in again.rows} == {row["file"]: row for row in made[0].rows}


@pytest.mark.slow
def test_kitti_and_mots_take_the_map(tiny: Dataset, tmp_path: Path) -> None:
    """Actors that it leaves out stay in the files as regions that are not counted."""
    (tmp_path / "map.yaml").write_text("Truck: {id: 2, name: big truck}\n")
    for name in ("kitti", "mots"):
        export(tiny, tmp_path / name, name, quiet, options={"categories": str(tmp_path / "map.yaml")})
    lines = [line.split() for line in (tmp_path / "kitti/training/label_02/0000.txt").read_text().splitlines()]
    assert {(line[1], line[2]) for line in lines} == {("-1", "DontCare"), ("15001", "big_truck")}
    masks = next((tmp_path / "mots/MOTS-train").glob("*/gt/gt.txt")).read_text().splitlines()
    assert {tuple(line.split()[1:3]) for line in masks} == {("2001", "2"), ("10000", "10")}
