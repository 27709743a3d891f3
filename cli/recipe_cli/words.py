"""Remedies in the words of the command line: the library names no options, its problems carry a code."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.errors import Problem


def option_help(problem: Problem) -> str | None:
    """The remedy that names the options that help with a problem of this code; None if none do."""
    words = {
        "size-limit": "ask for fewer frames or variants, or give --allow-large",
    }.get(problem.code)
    return words
