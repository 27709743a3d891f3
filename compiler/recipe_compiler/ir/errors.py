"""Exceptions and problems.

    RecipeError          base class of all errors that this project raises
    ├── InputError       the recipe, lockfile, dataset or command line is wrong: exit code 2
    └── RunError         the host failed (disk full, worker lost, read-only folder): exit code 1

An error carries problems, so that all of a recipe's mistakes are shown in one run. A problem has a code from a closed
list, a message, a place, and a remedy (`help`). It names no command-line option: the command line adds its own words
by the code.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

MAX_SHOWN = 50  # problems of one error that are printed; the rest are counted


class Code(str, Enum):
    """What kind of problem it is; docs/errors.md explains each."""

    # Reading files
    YAML_SYNTAX = "yaml-syntax"
    AMBIGUOUS_YAML = "ambiguous-yaml"
    UNSUPPORTED_YAML = "unsupported-yaml"
    NOT_TEXT = "not-text"
    EMPTY_FILE = "empty-file"
    INPUT_LIMIT = "input-limit"
    FILE_NOT_FOUND = "file-not-found"
    UNREADABLE_FILE = "unreadable-file"
    PATH_REFUSED = "path-refused"
    EXTENDS_CYCLE = "extends-cycle"
    # The recipe language
    UNKNOWN_KEY = "unknown-key"
    MISSING_KEY = "missing-key"
    DUPLICATE_KEY = "duplicate-key"
    UNKNOWN_NAME = "unknown-name"
    INVALID_NAME = "invalid-name"
    INVALID_VALUE = "invalid-value"
    OUT_OF_RANGE = "out-of-range"
    CONFLICT = "conflict"
    INVALID_ASSET = "invalid-asset"
    NO_ROOM = "no-room"
    SIZE_LIMIT = "size-limit"
    # Lockfiles, datasets, packs and the command line
    INVALID_LOCKFILE = "invalid-lockfile"
    OUTDATED_LOCKFILE = "outdated-lockfile"
    INVALID_DATASET = "invalid-dataset"
    INVALID_PACK = "invalid-pack"
    UNKNOWN_DEVICE = "unknown-device"
    OUTPUT_IN_THE_WAY = "output-in-the-way"
    REMOTE = "remote"
    MISSING_LIBRARY = "missing-library"
    USAGE = "usage"
    INVALID_INPUT = "invalid-input"
    # The host
    HOST = "host"
    OUT_OF_MEMORY = "out-of-memory"
    INTERNAL = "internal"
    INTERRUPTED = "interrupted"
    # Warnings; `placement` is an error as well
    AXES_OVERLAP = "axes-overlap"
    PLACEMENT = "placement"
    OVERRIDDEN = "overridden"
    IMPLAUSIBLE = "implausible"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, order=True)
class Place:
    """A position in a text file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


@dataclass(frozen=True)
class Problem:
    """One mistake.

    Args:
        message: what is wrong, and the value. Without `help`, a remedy may follow after the last `; `: it is split off.
        place: where.
        help: the remedy.
        code: what kind of problem it is.
        note: where else it applies: the variant and the town of a problem that only some variants have.
        source: the line of text at the place.
    """

    message: str
    place: Place | None = None
    help: str | None = None
    code: Code = Code.INVALID_INPUT
    note: str | None = None
    source: str | None = None

    def __post_init__(self) -> None:
        if self.help is None:
            message, remedy = split_remedy(self.message)
            object.__setattr__(self, "message", message)
            object.__setattr__(self, "help", remedy)

    def __str__(self) -> str:
        """One line: `file:line:column: message (note); help`."""
        text = f"{self.place}: {self.message}" if self.place else self.message
        text = f"{text} ({self.note})" if self.note else text
        return f"{text}; {self.help}" if self.help else text


_STRING = re.compile(r'"(?:[^"\\]|\\.)*"|`[^`]*`|(?<!\w)\'[^\']*\'(?!\w)|\([^()]*\)')


def split_remedy(text: str) -> tuple[str, str | None]:
    """A message and its remedy, for text of the form `what is wrong; remedy`.

    The split is at the last `; ` outside quotes and brackets; without one, there is no remedy.
    """
    masked = _STRING.sub(lambda match: "_" * len(match[0]), text)
    at = masked.rfind("; ")
    return (text, None) if at < 0 else (text[:at], text[at + 2 :])


class RecipeError(Exception):
    """Base class of this project's errors. Its text has one line per problem."""

    default = Code.INVALID_INPUT

    def __init__(
        self, problems: str | Problem | Iterable[Problem], *, help: str | None = None, code: Code | None = None
    ) -> None:
        """`help` and `code` apply to a problem given as text."""
        if isinstance(problems, str):
            problems = Problem(problems, help=help, code=code or self.default)
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(one_line_each(self.problems)))


class InputError(RecipeError):
    """The input is wrong; nothing was written."""

    def with_source(self, lines: Mapping[str, Sequence[str]]) -> None:
        """Give each problem the line of text at its place; `lines`: file -> its lines."""
        self.problems = with_source(self.problems, lines)


class RunError(RecipeError):
    """The host failed; the message has a remedy."""

    default = Code.HOST


def one_line_each(problems: Sequence[Problem]) -> list[str]:
    """One line per problem, at most MAX_SHOWN, and a line with the number of the others."""
    rest = len(problems) - MAX_SHOWN
    return [*map(str, problems[:MAX_SHOWN]), *([f"and {rest:,} more"] if rest > 0 else [])]


def with_source(problems: Iterable[Problem], lines: Mapping[str, Sequence[str]]) -> tuple[Problem, ...]:
    """Problems, each with the line of text at its place where that is known."""

    def sourced(problem: Problem) -> Problem:
        text = lines.get(problem.place.file, ()) if problem.place else ()
        if problem.place is None or not 0 < problem.place.line <= len(text):
            return problem
        return replace(problem, source=text[problem.place.line - 1])

    return tuple(sourced(problem) for problem in problems)


# Invisible characters that `str.isprintable` accepts: fillers and variation selectors.
_INVISIBLE = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)


def printable(text: str) -> str:
    """Untrusted text, escaped so that a terminal prints it on one line and obeys nothing in it.

    Control characters, escape codes, line breaks, bidirectional overrides and invisible characters become escapes.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_escaped(c) if not c.isprintable() or _INVISIBLE.match(c) else c for c in text)


def _escaped(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
