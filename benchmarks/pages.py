"""Tables that benchmarks write into pages of the documentation, between two comments, so that numbers cannot drift."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

Table = Sequence[Mapping[str, str]]  # rows: cells by the heading of their column

_END = "<!-- end of the table -->"


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    head = list(table[0])
    rows = [head, ["---"] * len(head), *([row[key] for key in head] for row in table)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def table_of(page: Path, command: str) -> str:
    """Return the table that a command wrote into a page.

    Args:
        page: The Markdown file.
        command: The command, as the comment before the table names it.

    Raises:
        ValueError: The page has no table of the command, or several.
    """
    return _found(page, command)[2].strip()


def write_table(page: Path, command: str, table: Table) -> None:
    """Replace the table of a command in a page.

    Raises:
        ValueError: The page has no table of the command, or several.
    """
    found = _found(page, command)
    text = found.string
    new = f"{text[: found.start(2)]}\n\n{markdown(table)}\n\n{text[found.end(2) :]}"
    if new != text:
        page.write_text(new, encoding="utf-8")


def _found(page: Path, command: str) -> re.Match[str]:
    """Return the pattern of a table: the comment before it, its content, and the comment after it."""
    start = re.escape(f"<!-- table of `{command}` -->")
    found = list(re.finditer(f"({start})(.*?){re.escape(_END)}", page.read_text(encoding="utf-8"), re.S))
    if len(found) != 1:
        raise ValueError(f"{page}: {len(found)} tables of `{command}`, not 1")
    return found[0]
