"""The only module of the command line that writes to the terminal.

Every text is escaped here: recipes, datasets, lockfiles and file names are untrusted, and a terminal obeys control
characters. A text is one line: a line break in it is escaped, and the continuation of a line that a terminal would wrap
is indented. So only text that a command prints as a line of its own, such as a verdict, is at the start of a line.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TextIO

import click

if TYPE_CHECKING:
    from recipe_compiler.ir.errors import Problem

COLOURS = {"error": "red", "warning": "yellow", "PASS": "green", "FAIL": "red", "INCONCLUSIVE": "yellow"}
_INDENT = "    "
_VERDICT = re.compile(r"PASS\b|FAIL\b|INCONCLUSIVE\b|(error|warning)\[")


@dataclass(frozen=True)
class Styled:
    """A part of a line in a colour, bold."""

    text: str
    colour: str = ""


@dataclass
class State:
    """The output state of one run: whether it prints JSON, and the warnings so far."""

    as_json: bool = False
    warnings: list[Problem] = field(default_factory=list)
    printed: bool = False
    partial: dict[str, list[dict[str, object]]] = field(default_factory=dict)  # kept in the document of a failed run


def state() -> State:
    """The state of the run in progress."""
    context = click.get_current_context(silent=True)
    return State() if context is None else context.ensure_object(State)


def safe(text: str) -> str:
    """Untrusted text for the terminal: escaped, on one line, without the secrets of URLs."""
    from recipe_compiler.ir.errors import printable

    if ":/" in text:  # a path library may have merged the slashes of a URL
        from recipe_runtime.core.urls import without_secrets

        text = without_secrets(text)
    return printable(text)


def say(*parts: str | Styled, err: bool = False) -> None:
    """Print one line, on standard error if `err`; its parts are escaped."""
    stream = sys.stderr if err else sys.stdout
    safe_parts = [(safe(part), "") if isinstance(part, str) else (safe(part.text), part.colour) for part in parts]
    colour = in_colour(stream)
    if stream.isatty():
        safe_parts = _wrapped(safe_parts, shutil.get_terminal_size().columns)
    if safe_parts and not safe_parts[0][1] and _VERDICT.match(safe_parts[0][0]):
        text = safe_parts[0][0]  # untrusted text that imitates a verdict
        safe_parts[0] = (f"\\x{ord(text[0]):02x}{text[1:]}", "")
    line = "".join(click.style(text, fg=fg or None, bold=True) if fg and colour else text for text, fg in safe_parts)
    click.echo(line, err=err, color=True)


def note(text: str) -> None:
    """Print a remark on standard error."""
    say(f"note: {text}", err=True)


@contextmanager
def held_notes() -> Iterator[Callable[[str], None]]:
    """Yield a function that takes remarks, and print them after the block, when its progress is over or it failed."""
    texts: list[str] = []
    try:
        yield texts.append
    finally:
        for text in texts:
            note(text)


def say_table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of equal length in columns, of which the last is as wide as its text."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    for row in rows:
        say("  ".join([*(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=False)), row[-1]]))


def in_colour(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether to print in colour: by NO_COLOR, FORCE_COLOR, CLICOLOR_FORCE, CLICOLOR=0, else on a terminal."""
    if environment.get("NO_COLOR"):
        return False
    if any(environment.get(name, "0") not in ("", "0") for name in ("FORCE_COLOR", "CLICOLOR_FORCE")):
        return True
    if environment.get("CLICOLOR") == "0" or environment.get("TERM") == "dumb":
        return False
    return stream.isatty()


def print_document(text: str) -> None:
    """Print a JSON text of many lines; what a terminal would obey is escaped as JSON escapes it."""
    click.echo(_json_safe(text.rstrip("\n")))


def print_json(value: Mapping[str, object] | Sequence[object]) -> None:
    """Print the one JSON document of a run. A map also holds `errors` and `warnings`."""
    run = state()
    if isinstance(value, Mapping):
        problems = {"errors": [], "warnings": [row(problem) for problem in run.warnings]}
        value = {**value, **{key: value.get(key, rows) for key, rows in problems.items()}}
    run.printed = True
    print_document(json.dumps(value, indent=2, ensure_ascii=False))


def warn(*problems: Problem) -> None:
    """Print warnings on standard error, at most MAX_SHOWN of them, or keep them for the JSON document."""
    from recipe_compiler.ir.errors import MAX_SHOWN

    from recipe_cli.diagnostics import print_problems, print_rest

    run = state()
    run.warnings += problems
    if not run.as_json:
        for problem in problems[:MAX_SHOWN]:
            print_problems("warning", [problem])
        print_rest("warning", problems)


def fail(problems: Sequence[Problem], run: State | None = None) -> None:
    """Print errors on standard error, or as the JSON document."""
    from recipe_cli.diagnostics import print_problems

    run = run or state()
    if run.as_json and not run.printed:
        run.printed = True
        document = {"errors": [row(p) for p in problems], "warnings": [row(p) for p in run.warnings], **run.partial}
        print_document(json.dumps(document, indent=2, ensure_ascii=False))
    else:
        print_problems("error", problems)


def row(problem: Problem) -> dict[str, object]:
    """A problem as JSON."""
    from recipe_cli.diagnostics import remedy

    place, help = problem.place, remedy(problem)
    return {
        "code": str(problem.code),
        "message": safe(problem.message),
        "help": safe(help) if help else None,
        "note": safe(problem.note) if problem.note else None,
        "file": place.file if place else None,
        "line": place.line if place else None,
        "column": place.column if place else None,
    }


def show_cursor() -> None:
    """Show the cursor again, which a progress bar hides."""
    click.echo("\x1b[?25h", file=sys.stderr, nl=False)


def width(text: str) -> int:
    """The columns that escaped text takes on a terminal."""
    if text.isascii():
        return len(text)
    return sum(0 if unicodedata.combining(c) else 1 + (unicodedata.east_asian_width(c) in "WF") for c in text)


def _wrapped(parts: list[tuple[str, str]], columns: int) -> list[tuple[str, str]]:
    """Return the parts with line breaks and indents between words where the line is wider than the terminal."""
    column, wrapped = 0, []
    for text, colour in parts:
        words = []
        for word in re.findall(r" +|[^ ]+", text):
            if column + width(word) > columns and column > len(_INDENT):
                words.append(f"\n{_INDENT}")
                column = len(_INDENT)
                word = word.lstrip(" ")
            words.append(word)
            column += width(word)
        wrapped.append(("".join(words), colour))
    return wrapped


def _json_safe(text: str) -> str:
    return "\n".join(
        "".join(c if c == part else _json_escaped(c) for c, part in zip(line, map(safe, line), strict=True))
        if not (line.isascii() and line.isprintable())
        else line
        for line in text.split("\n")
    )


def _json_escaped(character: str) -> str:
    """A character as JSON escapes it; DEL too, which JSON need not escape."""
    return "\\u007f" if character == "\x7f" else json.dumps(character)[1:-1]
