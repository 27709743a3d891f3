"""Errors of the command line have a remedy."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from recipe_cli import main
from recipe_compiler.ir.errors import Code, InputError
from recipe_runtime.dataset import reader


def test_a_build_refuses_a_number_of_frames_with_a_remedy() -> None:
    problems, code = main._explained(click.NoSuchOption("--frames"))
    assert code == 2
    assert problems[0].message == "no such option '--frames'"
    assert problems[0].help == "the recipe sets the number of frames: change `frames` in its `clock`"


def test_another_unknown_option_refers_to_the_help() -> None:
    (problem,), _ = main._explained(click.NoSuchOption("--frumes"))
    assert problem.help == "see `recipe --help`"


def test_an_interrupted_command_prints_a_remedy() -> None:
    (problem,), code = main._explained(click.Abort())
    assert (problem.code, problem.help, code) == (Code.INTERRUPTED, "run the command again", 130)


def test_a_folder_without_a_dataset_gets_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        reader.read(tmp_path)
    assert caught.value.problems[0].help == "name a folder that `recipe build` made, such as datasets/NAME"


@pytest.mark.parametrize(
    ("name", "help"),
    [
        ("build", "Replace the dataset of another recipe, finished or not."),
        ("lock", "Replace the lockfile of another recipe, or a file that is not a lockfile."),
        ("export", "Replace another export, or a folder with other files."),
        ("shot", "Overwrite files that exist."),
        ("surfaces", "Overwrite files that exist."),
    ],
)
def test_the_help_of_replace_states_what_is_replaced(name: str, help: str) -> None:
    command = main.recipe.get_command(click.Context(main.recipe), name)
    assert command is not None
    (option,) = [parameter for parameter in command.params if parameter.name == "replace"]
    assert isinstance(option, click.Option) and option.help == help
