"""Remedies in the words of the command line: the library names no options, its problems carry a code."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

_WORDS = {  # code -> the remedy, with the library's own where `{help}` stands
    "size-limit": "{help}, or give --allow-large",
    "unknown-device": "{help} (--device)",
    "output-in-the-way": "{help} (--output)",
}


_ENDINGS = {  # how the library's remedy ends -> the option that does it
    "or replace it": "--replace",
}


def option_help(problem: Problem) -> str | None:
    """The remedy that names the option which helps with a problem of this code; None if none does."""
    if not problem.help or "--" in problem.help:
        return None
    for ending, option in _ENDINGS.items():
        if problem.help.endswith(ending):
            return f"{problem.help} ({option})"
    words = _WORDS.get(problem.code)
    return None if words is None else words.replace("{help}", problem.help)
