"""`recipe surfaces`: names and places of surfaces, their pictures, and blank texture maps."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from recipe_cli.commands.surfaces import command
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import InputError

from tests.sources import ROOT

POSTER = ROOT / "recipes/attacks/poster.yaml"


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, list(arguments), catch_exceptions=False)


def test_a_town_lists_its_surfaces_with_sizes_and_places() -> None:
    lines = run("downtown", "wall.[01]").stdout.splitlines()
    assert lines[0].split() == ["on", "name", "surface", "size,", "m", "x,", "m", "z,", "m", "place"]
    assert [line.split()[:3] for line in lines[1:]] == [
        ["town", f"wall.{n}", s] for n in (0, 1) for s in ("front", "back")
    ]
    assert "9.000 x 2.23" in lines[1] and "at x 9.0, y 2.2, facing yaw 180 degrees" in lines[1]


def test_the_family_of_a_blueprint_is_suggested() -> None:
    with pytest.raises(InputError, match=r'sedan: there is no .*did you mean "vehicle.sedan.\*"'):
        run("sedan")


def test_a_place_is_never_minus_zero() -> None:
    assert " -0.0" not in run("suburb", "fence.-1.0.0.1.side").stdout


def test_every_listed_surface_can_be_named_in_a_recipe(tmp_path: Path) -> None:
    """Tested with patches of the listed size on the first surfaces of each kind in a recipe's scene."""
    rows = json.loads(run(str(POSTER), "--json").stdout)
    chosen = {(row["on"], row["name"].split(".")[0], row["surface"]): row for row in rows}
    patches = {}
    for number, row in enumerate(list(chosen.values())[:60]):
        on = {row["on"]: row["name"], "surface": row["surface"]}
        if not row["whole"]:
            on["size"] = {"width": row["size"][0], "height": row["size"][1]}
        patches[f"p{number}"] = {"on": on, "mode": "green"}
    import yaml

    recipe = yaml.safe_load(POSTER.read_text())
    recipe["base"]["patches"] = patches
    del recipe["deltas"]
    (tmp_path / "all.yaml").write_text(json.dumps(recipe))
    found = compile_recipe(tmp_path / "all.yaml").plan.variants[0].appearance.patches
    assert len(found) == len(patches) > 10
    assert {row["on"] for row in rows} == {"town", "actor"}


@pytest.mark.slow
def test_a_blueprints_texture_map_is_white_where_it_is_painted(tmp_path: Path) -> None:
    done = run("vehicle.bus.city", "-o", str(tmp_path / "maps"))
    assert done.stderr == f"{tmp_path}/maps: 1 texture map, 0 sheets\n"
    picture = np.asarray(Image.open(io.BytesIO((tmp_path / "maps/vehicle.bus.city.body.png").read_bytes())))
    (row,) = [row for row in json.loads(run("vehicle.bus.city", "--json").stdout) if row["whole"]]
    height, width = picture.shape[:2]
    assert width / height == pytest.approx(row["aspect"], rel=0.01) and max(width, height) == 2048
    white = (picture == 255).all(axis=-1)
    inside = np.zeros_like(white)
    for island in row["islands"]:
        left, top, right, bottom = island["region"]
        box = (slice(int(top * height), int(bottom * height) + 1), slice(int(left * width), int(right * width) + 1))
        inside[box] = True
        assert white[box].mean() > 0.1, island["name"]
    assert not (white & ~inside).any()


def test_a_picture_that_exists_is_not_overwritten(tmp_path: Path) -> None:
    """The option names a folder, so the remedy does too."""
    (tmp_path / "vehicle.bus.city.body.png").write_text("precious")
    remedy = r"choose another folder \(--output\), or replace its files \(--replace\)"
    with pytest.raises(InputError, match=rf"vehicle\.bus\.city\.body\.png exists already; {remedy}"):
        run("vehicle.bus.city", "-o", str(tmp_path))
    assert (tmp_path / "vehicle.bus.city.body.png").read_text() == "precious"


@pytest.mark.slow
def test_flat_surfaces_are_shown_on_a_sheet(tmp_path: Path) -> None:
    """The surface is green, at the centre of its picture."""
    run(str(POSTER), "wall.1", "-o", str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["surfaces-1.jpg"]
    sheet = np.asarray(Image.open(tmp_path / "surfaces-1.jpg")).astype(int)
    middle = sheet[60:90, 90:120].mean(axis=(0, 1))
    assert middle[1] > middle[0] + 40 and middle[1] > middle[2] + 40


def test_surfaces_of_a_flat_turned_mesh_are_listed_drawn_around_and_painted(tmp_path: Path) -> None:
    """A plane has two sides; a patch on them compiles at each yaw; walls near it are drawn with the mesh."""
    (tmp_path / "plane.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    for yaw in (-90, 0, 180):
        recipe = {
            "recipe": "flat",
            "assets": {"plane": {"mesh": "plane.obj"}},
            "base": {
                "clock": {"fps": 10, "frames": 1},
                "town": "downtown",
                "props": {"sign": {"asset": "plane", "at": {"x": 5, "y": 2, "yaw": yaw}}},
                "patches": {"paint": {"on": {"prop": "sign", "surface": "body"}, "texture": {"color": "#ff0000"}}},
                "sensors": {"cam": {"mount": {"x": 0, "y": 2, "z": 2}, "capture": ["rgb"]}},
            },
        }
        path = tmp_path / "flat.yaml"
        path.write_text(json.dumps(recipe))
        (patch,) = compile_recipe(path).plan.variants[0].appearance.patches
        assert len(patch.faces) == 2
    assert run(str(path), "sign").stdout.splitlines()[1].split()[:3] == ["prop", "sign", "body"]
    run(str(path), "wall.0", "-o", str(tmp_path / "sheets"))
    assert (tmp_path / "sheets" / "surfaces-1.jpg").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("dwntown",), 'did you mean "downtown"'),
        (("vehicle.sedn.a",), 'did you mean "vehicle.sedan.a"'),
        (("downtown", "sofa"), "omit the pattern"),
        (("gone.yaml",), "gone.yaml"),
    ],
)
def test_unknown_names_are_explained(arguments: tuple[str, ...], words: str) -> None:
    with pytest.raises(InputError) as caught:
        run(*arguments)
    assert words in str(caught.value)


def test_texture_maps_are_painted_with_a_repeated_image(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8), (10, 200, 30)).save(tmp_path / "tile.png")
    run("vehicle.sedan.a", "-o", str(tmp_path / "maps"), "--paint", str(tmp_path / "tile.png"), "--metres", "0.5")
    with Image.open(tmp_path / "maps/vehicle.sedan.a.body.png") as painted:
        assert (np.asarray(painted) == (10, 200, 30)).all()


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        (None, ("--paint", "{}/none.png"), "none.png: there is no such file"),
        (b"no image", ("--paint", "{}/file.png"), "file.png: "),
        (b"", ("--paint", "{}/file.jpg"), "does not end in .png"),
        (None, ("--model", "{}/model.obj"), "needs the image that was made for it"),
        (None, ("--metres", "nan"), "--metres nan is not a number"),
    ],
)
def test_wrong_paint_writes_nothing(
    tmp_path: Path, content: bytes | None, options: tuple[str, ...], message: str
) -> None:
    if content is not None:
        (tmp_path / Path(options[1]).name).write_bytes(content)
    given = [option.format(tmp_path) for option in options]
    with pytest.raises(InputError, match=message):
        run("vehicle.sedan.a", "-o", str(tmp_path / "maps"), *given)
    assert not (tmp_path / "maps").exists()
