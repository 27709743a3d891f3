"""`recipe import`: its files and report, and what it refuses; imported recipes build and pass verification."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest
from PIL import Image
from recipe_cli.commands import import_

from tests.cli.runner import run_here
from tests.compiler.carla.importing import CONFIGS, PAPER, SEVEN, TOGETHER

EVERY = CONFIGS / "every_key.yaml"


@pytest.mark.slow
def test_it_writes_a_recipe_and_a_report_and_prints_the_report(tmp_path: Path) -> None:
    done = run_here("import", "carla", *PAPER, "-o", "new/folder", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    folder = tmp_path / "new" / "folder"
    assert sorted(path.name for path in folder.iterdir()) == ["config.import.txt", "config.yaml"]
    assert done.stdout.startswith((folder / "config.import.txt").read_text())
    assert "new/folder/config.yaml written: 46 kept, 22 mapped, 13 ignored" in done.stdout
    assert run_here("check", folder / "config.yaml", cwd=tmp_path).returncode == 0


def test_json_has_every_key(tmp_path: Path) -> None:
    done = run_here("import", "carla", *PAPER, "--json", cwd=tmp_path)
    (one,) = json.loads(done.stdout)["imports"]
    assert (one["recipe"], one["file"]) == ("config", "recipes/config.yaml")
    assert sum(one["counts"].values()) == len(one["keys"])
    rows = {(row["file"].rsplit("/", 1)[-1], row["line"], row["key"]): row for row in one["keys"]}
    row = rows["config.yaml", 37, "spawn_actors[0].transform.rotation.yaw"]
    assert (row["outcome"], row["to"], row["value"], row["written"]) == (
        "mapped",
        "base.actors.hero1.start.yaw",
        "-90.0",
        "90",
    )
    assert rows["rainy.yaml", 8, "weather.sun_azimuth_angle"]["outcome"] == "mapped"


@pytest.mark.parametrize("name", ["a\U0001f600b.yaml", "a\udcffb.yaml", "a\x1bb.yaml", "a\nb.yaml", "a\u202eb.yaml"])
def test_a_configuration_may_have_any_name(tmp_path: Path, name: str) -> None:
    """Regression: the recipe of one with an emoji in its name was refused, as its description was not text."""
    (tmp_path / name).write_bytes(EVERY.read_bytes())
    done = run_here("import", "carla", name, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "recipes").iterdir()) == ["a_b.import.txt", "a_b.yaml"]
    assert not {"\x1b", "\u202e"} & set((tmp_path / "recipes" / "a_b.yaml").read_text(encoding="utf-8") + done.stdout)


def test_it_overwrites_nothing_without_replace(tmp_path: Path) -> None:
    (tmp_path / "every_key.import.txt").write_text("mine")
    here = ("import", "carla", EVERY, "-o", ".")
    done = run_here(*here, cwd=tmp_path)
    assert done.returncode == 2
    assert "every_key.import.txt exists already" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["every_key.import.txt"]
    assert run_here(*here, "--replace", cwd=tmp_path).returncode == 0
    assert "mine" not in (tmp_path / "every_key.import.txt").read_text()
    assert run_here(*here, cwd=tmp_path).returncode == 0  # with the same content


def test_the_configuration_itself_is_never_overwritten(tmp_path: Path) -> None:
    text = EVERY.read_text()
    (tmp_path / "every_key.yaml").write_text(text)
    done = run_here("import", "carla", "every_key.yaml", "-o", ".", "--replace", cwd=tmp_path)
    assert (done.returncode, "is the configuration itself" in done.stderr) == (2, True)
    assert (tmp_path / "every_key.yaml").read_text() == text


def test_with_one_broken_configuration_no_file_is_written(tmp_path: Path) -> None:
    (tmp_path / "broken.yaml").write_text("max_frames: none\nspawn_actors: []\n")
    done = run_here("import", "carla", EVERY, "broken.yaml", "-o", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert "broken.yaml:1:1" in done.stderr and "help: " in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("target", ["missing.yaml", "folder", "pipe"])
def test_paths_that_are_not_regular_files_are_refused(target: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    done = run_here("import", "carla", target, cwd=tmp_path)
    assert done.returncode == 2
    assert f"{target}: " in done.stderr


def test_the_town_can_be_chosen(tmp_path: Path) -> None:
    assert run_here("import", "carla", EVERY, "--town", "plaza", cwd=tmp_path).returncode == 0
    assert "town: plaza" in (tmp_path / "recipes" / "every_key.yaml").read_text()
    done = run_here("import", "carla", EVERY, "--town", "Town01", cwd=tmp_path)
    assert (done.returncode, "downtown" in done.stderr) == (2, True)


@pytest.mark.parametrize("path", SEVEN, ids=lambda path: path.stem)
def test_configurations_as_the_collector_was_published_with_are_imported_and_rendered(
    path: Path, tmp_path: Path
) -> None:
    """Regression: without max_frames, or with sensors on a vehicle of another program, they were refused."""
    text = path.read_text().replace('"640"', '"64"').replace('"480"', '"48"')
    (tmp_path / path.name).write_text(text)
    done = run_here("import", "carla", path.name, "--frames", "2", "--town", "plaza", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert (len(SEVEN), run_here("check", f"recipes/{path.name}", cwd=tmp_path).returncode) == (7, 0)
    shot = run_here("shot", f"recipes/{path.name}", "--frame", "1", "-o", "shot.png", cwd=tmp_path)
    assert shot.returncode == 0, shot.stderr
    with Image.open(tmp_path / "shot.png") as picture:
        assert picture.size == (64, 48) and len(picture.convert("RGB").getcolors(64 * 48)) > 100


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--frames", "0", "--frames': 0 is below 1"),
        ("--hero", "vehicle.none", "no vehicle or walker 'vehicle.none'"),
        ("--traffic", "3", "--traffic '3' is not two whole numbers"),
        ("--traffic", "1,-1", "is not two whole numbers"),
        ("--traffic", "999,1", "999 vehicles are out of range"),
    ],
)
def test_broken_choices_are_refused(option: str, value: str, message: str, tmp_path: Path) -> None:
    done = run_here("import", "carla", EVERY, option, value, cwd=tmp_path)
    assert (done.returncode, message in done.stderr, "help: " in done.stderr) == (2, True, True), done.stderr
    assert not list(tmp_path.iterdir())


def test_a_role_of_no_entry_is_refused_with_the_option_that_helps(tmp_path: Path) -> None:
    text = (CONFIGS / "collector" / "sensors_hero.yaml").read_text().replace('"hero"', '"ego"')
    (tmp_path / "ego.yaml").write_text(text)
    done = run_here("import", "carla", "ego.yaml", cwd=tmp_path)
    assert (done.returncode, "(--hero)" in done.stderr) == (2, True)
    assert (
        run_here("import", "carla", "ego.yaml", "--hero", "vehicle.*", "--traffic", "4,2", cwd=tmp_path).returncode == 0
    )
    written = (tmp_path / "recipes" / "ego.yaml").read_text()
    assert "ego: {blueprint: vehicle.*}" in written and "traffic: {vehicles: 4, pedestrians: 2}" in written


def small(path: Path, folder: Path) -> Path:
    """Copy a configuration with small pictures and two frames."""
    text = path.read_text()
    for old, new in (("max_frames: 300", "max_frames: 2"), ('"800"', '"64"'), ('"600"', '"48"')):
        text = text.replace(old, new)
    (folder / path.name).write_text(text)
    return folder / path.name


@pytest.mark.slow
def test_the_listings_of_the_paper_build_and_pass_verification(tmp_path: Path) -> None:
    listings = tmp_path / "listings"
    listings.mkdir()
    files = [small(path, listings) for path in PAPER]
    assert run_here("import", "carla", *files, cwd=tmp_path).returncode == 0
    built = run_here("build", "recipes/config.yaml", "-o", "dataset", cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    verified = run_here("verify", "dataset", "--all", "--json", cwd=tmp_path)
    (report,) = json.loads(verified.stdout)
    assert (report["verdict"], report["checked"]) == ("PASS", 6)
    document = json.loads((tmp_path / "dataset" / "annotations" / "kwcoco.json").read_text())
    assert len(document["images"]) == 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ["following", "oscar"])
def test_other_imports_build_and_pass_verification(name: str, tmp_path: Path) -> None:
    """With an arm, a slow sensor, sensors on people, a green screen, traffic and a warm-up."""
    assert run_here("import", "carla", *TOGETHER[name], cwd=tmp_path).returncode == 0
    (path,) = (tmp_path / "recipes").glob("*.yaml")
    text = re.sub(r"(?<=camera: {)width: \d+, height: \d+", "width: 48, height: 32", path.read_text())
    path.write_text(text.replace("frames: 40", "frames: 3"))
    built = run_here("build", path, "-o", "dataset", cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    assert run_here("verify", "dataset", "--all", cwd=tmp_path).stdout.startswith("PASS")


def test_places_of_warnings_are_those_of_the_configuration(tmp_path: Path) -> None:
    text = EVERY.read_text().replace("speed: 1.4", "speed: 40.0")
    (tmp_path / "quick.yaml").write_text(text)
    done = run_here("import", "carla", "quick.yaml", "-o", "out", cwd=tmp_path)
    assert "no pedestrian runs at 40 m/s" in done.stderr
    assert "--> quick.yaml:40:" in done.stderr
    assert import_.command.name == "import"
