"""Remedies in the words of the command line: the library names no options, its problems carry a code."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

_WORDS = {  # code -> the remedy, in which `{help}` is the library's own
    "size-limit": "{help}, or give --allow-large",
    "unknown-device": "{help} (--device)",
}
_ADDED = {  # code -> what is added after parts of the library's remedy
    "output-in-the-way": {
        r"choose (another|a) (folder|place|file)": "--output",
        r"replace it\b": "--replace",
    },
    "invalid-dataset": {r"repair the dataset\b": "`recipe build RECIPE --repair`"},
    "invalid-lockfile": {
        r"with traces\b": "`recipe lock --update --with-traces`",
        r"write it again\b": "`recipe lock --update`",
    },
}


def option_help(problem: Problem) -> str | None:
    """Return a problem's remedy with the command-line option added; None if no option helps."""
    if not problem.help or "--" in problem.help:
        return None
    text = problem.help
    for part, option in _ADDED.get(problem.code, {}).items():
        text = re.sub(part, rf"\g<0> ({option})", text)
    words = _WORDS.get(problem.code)
    if words is not None:
        return words.replace("{help}", text)
    return text if text != problem.help else None
