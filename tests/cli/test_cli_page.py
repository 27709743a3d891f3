"""docs/cli.md describes exactly the commands and options that exist."""

from __future__ import annotations

import re
import shlex

import click
import pytest
from recipe_cli.main import COMMANDS, recipe

from tests.sources import ROOT

PAGE = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
SECTIONS = {
    match[1]: match[2] for match in re.finditer(r"^## recipe (\w+)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL)
}
HEAD = PAGE.partition("\n## ")[0]


def options(name: str) -> set[str]:
    command = recipe.get_command(click.Context(recipe), name)
    assert command is not None
    found = (option for parameter in command.params if isinstance(parameter, click.Option) for option in parameter.opts)
    return set(found)


def test_every_command_has_its_section_in_the_order_of_the_help() -> None:
    assert list(SECTIONS) == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_options_of_the_page_are_those_of_the_command(name: str) -> None:
    bullets = re.findall(r"^- (.*(?:\n  .*)*)", SECTIONS[name], re.MULTILINE)
    reported = {word for bullet in bullets for word in re.findall(r"`(--?[a-z-]+)`", bullet)}
    assert reported == options(name)
    shared = [bullet for bullet in bullets if "as above" in bullet]
    for word in {word for bullet in shared for word in re.findall(r"`(--?[a-z-]+)`", bullet)}:
        assert f"- `{word}`" in HEAD, f"{word} is not described above"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_are_existing_commands(name: str) -> None:
    lines = re.findall(r"^    \$ (.*)$", SECTIONS[name], re.MULTILINE)
    assert lines
    for line in lines:
        program, command, *rest = shlex.split(line)
        assert (program, command) == ("recipe", name)
        assert {word for word in rest if word.startswith("-")} <= options(name), line


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_has_a_help_text(name: str) -> None:
    command = recipe.get_command(click.Context(recipe), name)
    assert command is not None
    silent = [p.name for p in command.params if isinstance(p, click.Option) and not p.help]
    assert not silent


def test_lines_are_wrapped() -> None:
    assert max(map(len, PAGE.splitlines())) <= 120


@pytest.mark.parametrize("name", ["import", "shot", "build", "pack", "export", "schema"])
def test_the_output_of_every_command_has_one_name(name: str) -> None:
    assert {"-o", "--output", "--out"} <= options(name)


def test_only_locked_is_also_frozen() -> None:
    assert {"--only-locked", "--frozen"} <= options("build")
