"""Shell completion: recipe files, and the names in the recipe on the command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete
from recipe_cli.main import recipe
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.library import towns

from tests.cli.test_commands import RECIPE


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "small.yaml").write_text(RECIPE)
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "other.recipe").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "bad\nname.yaml").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def completed(*words: str) -> list[str]:
    *before, last = words
    found = ShellComplete(recipe, {}, "recipe", "_RECIPE_COMPLETE").get_completions(list(before), last)
    return [item.value for item in found if item.type == "plain"]


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (("shot", "s"), ["small.yaml"]),
        (("check", ""), ["more/other.recipe", "small.yaml"]),
        (("build", "more/"), ["more/other.recipe"]),
        (("shot", "small.yaml", "--variant", ""), ["weather=dry", "weather=wet"]),
        (("plan", "small.yaml", "--variant", "weather=w"), ["weather=wet"]),
        (("shot", "small.yaml", "--sensor", ""), ["street"]),
        (("shot", "small.yaml", "--modality", ""), list(MODALITIES)),
        (("shot", "small.yaml", "--device", "cp"), ["cpu"]),
        (("verify", "small.yaml", "--device", "cud"), ["cuda"]),
        (("shot", "gone.yaml", "--variant", ""), []),
        (("shot", "--map", "s"), ["small.yaml", *(town for town in towns.NAMES if town.startswith("s"))]),
        (("surfaces", "sub"), ["suburb"]),
        (
            ("surfaces", "vehicle.sedan."),
            ["vehicle.sedan.a", "vehicle.sedan.b", "vehicle.sedan.coupe", "vehicle.sedan.police", "vehicle.sedan.taxi"],
        ),
    ],
)
def test_values_are_completed(folder: Path, words: tuple[str, ...], values: list[str]) -> None:
    assert sorted(completed(*words))[: len(values)] == sorted(values)
    assert len(completed(*words)) >= len(values)


def test_names_with_special_characters_of_shells_are_not_completed(folder: Path) -> None:
    names = ["$(id)", "`id`", "a;id", "a b", "a|b", "~x", "-o", "a*b", "a'b", "!x", "{a,b}"]
    for name in names:
        (folder / f"{name}.yaml").touch()
    (folder / "caf\u00e9=1.yaml").touch()
    assert completed("check", "") == ["caf\u00e9=1.yaml", "more/other.recipe", "small.yaml"]
    assert completed("check", "$(") == []  # the shell completes and quotes file names
    (folder / "small.yaml").write_text(RECIPE.replace("street:", "$(id):").replace("wet:", "'`id`':"))
    assert completed("shot", "small.yaml", "--sensor", "") == []
    assert completed("shot", "small.yaml", "--variant", "") in ([], ["weather=dry"])


def test_a_broken_recipe_completes_nothing_and_prints_nothing(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (folder / "small.yaml").write_text("recipe: [")
    assert completed("shot", "small.yaml", "--variant", "") == []
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_bash_completion_works_through_the_documented_variable(folder: Path) -> None:
    words = "recipe shot small.yaml --variant weather=w"
    environment = {"_RECIPE_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": "4"}
    done = subprocess.run(
        [sys.executable, "-m", "recipe_cli"], env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "plain,weather=wet\n", "")


def test_every_recipe_argument_and_device_is_completed() -> None:
    for name in recipe.list_commands(click.Context(recipe)):
        command = recipe.get_command(click.Context(recipe), name)
        assert command is not None
        for parameter in command.params:
            if parameter.name in ("recipe", "recipes", "variant", "sensor", "device", "modality"):
                assert parameter._custom_shell_complete is not None, f"{name} {parameter.name}"
