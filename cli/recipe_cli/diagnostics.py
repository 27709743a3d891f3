"""Formats errors and warnings: code, message, place, source line with a caret, remedy.

error[unknown-key]: unknown key "fsp" in clock
 --> rain_bench.yaml:3:11
  |
3 |   clock: {fsp: 10, frames: 60}
  |           ^^^
help: did you mean "fps"?
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from recipe_compiler.ir.plurals import count

from recipe_cli.console import COLOURS, Styled, safe, say, width

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

_BEFORE = 50  # characters of a long source line that are shown before the place
_AFTER = 60  # and after it
_TOKEN = re.compile(r""""(?:[^"\\]|\\.)*"|'[^']*'|[^\s,:{}\[\]#]+|.""")

_OPTIONS = {  # code -> part of the library's remedy, which names no options, and what is added after it
    "size-limit": {r"\Z": ", or give --allow-large"},
    "unknown-device": {r"\Z": " (--device)"},
    "unknown-name": {r"another program spawns\Z": " (--hero)"},
    "output-in-the-way": {r"choose (another|a) (folder|place|file)": " (--output)", r"replace it\b": " (--replace)"},
    "invalid-dataset": {r"repair the dataset\b": " (`recipe build RECIPE --repair`)"},
    "invalid-lockfile": {
        r"with traces\b": " (`recipe lock --update --with-traces`)",
        r"write it again\b": " (`recipe lock --update`)",
    },
}


def print_problems(severity: str, problems: Sequence[Problem]) -> None:
    """Print problems on standard error, at most MAX_SHOWN of them, and how many more there are."""
    from recipe_compiler.ir.errors import MAX_SHOWN

    shown = problems[:MAX_SHOWN]
    for number, problem in enumerate(shown):
        following = shown[number + 1] if number + 1 < len(shown) else None
        advised = following is None or not _share_remedy(problem, following)
        for line in _lines(severity, problem, remedy(problem) if advised else None):
            say(*line, err=True)
        if advised and following is not None:
            say(err=True)
    print_rest(severity, problems)


def print_rest(severity: str, problems: Sequence[Problem]) -> None:
    """Print how many problems there are beyond MAX_SHOWN, if any."""
    from recipe_compiler.ir.errors import MAX_SHOWN

    rest = len(problems) - MAX_SHOWN
    if rest > 0:
        say(Styled(severity, COLOURS[severity]), f": and {count(rest, severity)} more; --json lists all", err=True)


def remedy(problem: Problem) -> str | None:
    """Return a problem's remedy, with the command-line options that help."""
    text = problem.help
    if text and "--" not in text:
        for part, option in _OPTIONS.get(problem.code, {}).items():
            text = re.sub(part, rf"\g<0>{option}", text)
    return text


def _share_remedy(problem: Problem, following: Problem) -> bool:
    """Return whether one remedy, after the second problem, is enough: both have it, and no place of their own."""
    return problem.place is None and following.place is None and remedy(problem) == remedy(following)


def _lines(severity: str, problem: Problem, advice: str | None) -> list[tuple[str | Styled, ...]]:
    lines: list[tuple[str | Styled, ...]] = [
        (Styled(f"{severity}[{problem.code}]", COLOURS[severity]), ": ", problem.message)
    ]
    if problem.place is not None:
        number = str(problem.place.line) if problem.source is not None else ""
        margin = " " * max(1, len(number))
        lines.append((Styled(f"{margin}-->", "blue"), f" {problem.place}"))
        if problem.source is not None:
            text, caret = _excerpt(problem.source, problem.place.column)
            lines.append((Styled(f"{margin} |", "blue"),))
            lines.append((Styled(f"{number} |", "blue"), f" {text}"))
            lines.append((Styled(f"{margin} |", "blue"), " ", Styled(caret, COLOURS[severity])))
    if problem.note:
        lines.append((Styled("note", "blue"), ": ", problem.note))
    if advice:
        lines.append((Styled("help", "cyan"), ": ", advice))
    return lines


def _excerpt(source: str, column: int) -> tuple[str, str]:
    """A line of text, shortened around a column, and the carets under the token at that column."""
    at = min(max(column - 1, 0), len(source))
    start = at - _BEFORE if at > _BEFORE else 0
    end = at + _AFTER if len(source) - at > _AFTER else len(source)
    head = ("..." if start else "") + safe(source[start:at])
    tail = safe(source[at:end]) + ("..." if end < len(source) else "")
    token = _TOKEN.match(source, at, end)
    marked = max(1, width(safe(token[0]))) if token else 1
    return f"{head}{tail}".rstrip(), " " * width(head) + "^" * marked
