"""One tree of exceptions, split by whose fault it is.

    RecipeError          everything this project raises on purpose
    ├── InputError       the recipe, lockfile, dataset or command line is wrong: exit code 2
    └── RunError         the host failed us (disk full, worker lost, read-only folder): exit code 1

An InputError carries problems, each with its place, so that all of a recipe's mistakes are shown in one run.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


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
    """One mistake: where it is, what is wrong, and the remedy, on one line."""

    message: str
    place: Place | None = None

    def __str__(self) -> str:
        return f"{self.place}: {self.message}" if self.place else self.message


class RecipeError(Exception):
    """Anything this project raises on purpose."""


class InputError(RecipeError):
    """What the user gave is wrong; nothing was written."""

    def __init__(self, problems: str | Problem | Iterable[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem(problems)
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class RunError(RecipeError):
    """The host could not do what was asked; the message says what to do about it."""


def printable(text: str) -> str:
    """Text that a terminal only prints: names and paths may come from a stranger."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
