"""Errors of the command line have a remedy."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from recipe_cli import main
from recipe_compiler.ir.errors import InputError
from recipe_runtime.dataset import reader


def test_a_build_refuses_a_number_of_frames_with_a_remedy() -> None:
    problems, code = main._explained(click.NoSuchOption("--frames"))
    assert code == 2
    assert problems[0].message == "no such option '--frames'"
    assert problems[0].help == "the recipe sets the number of frames: change `frames` in its `clock`"


def test_a_folder_without_a_dataset_gets_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        reader.read(tmp_path)
    assert caught.value.problems[0].help == "name a folder that `recipe build` made, such as datasets/NAME"
