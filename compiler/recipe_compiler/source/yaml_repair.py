"""Finds the one line of a text that is not YAML whose indentation is wrong: with another one, the text is YAML."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import islice, pairwise
from typing import NamedTuple

_ABOVE = 15  # entries above the place of the error that are tried, beside those of the maps that are open there
_WORK = 300_000  # characters that are parsed in all tries, about a second
_FAR = 1000  # lines from a line to a sibling
_MOST = 40  # lines that are tried
_ENTRY = re.compile(r"-( |\Z)|[^\s#].*:( |\Z)")


class Repair(NamedTuple):
    """A line to indent otherwise, with lines counted from 1."""

    line: int
    spaces: int  # that it should start with
    beside: int  # line of an entry of the same map or list
    is_list: bool


def misindented_line(lines: Sequence[str], place: int, parses: Callable[[str], bool]) -> Repair | None:
    """Return the line to indent otherwise; None if no change of one line makes the text YAML.

    If there are several, the smallest change is returned; of these, one to the indentation step of the text; the
    deepest; one of a line that is not indented, as few keys belong there; the nearest.

    Args:
        lines: the lines of the text.
        place: the line at which reading stopped, counted from 1.
        parses: returns whether a text is YAML.
    """
    found: list[tuple[tuple[int, ...], Repair]] = []
    left = _WORK // (1 + sum(len(line) + 1 for line in lines))
    if not left or (place <= len(lines) and _is_mixed(lines, place)):
        return None
    step = _step(lines)
    for number in islice(_candidates(lines, place), _MOST):
        for repair in _repairs(lines, number):
            if left <= 0:
                break
            left -= 1
            changed = [*lines[: number - 1], " " * repair.spaces + lines[number - 1].lstrip(), *lines[number:]]
            if parses("\n".join(changed)):
                own = column(lines[number - 1])
                shape = abs(repair.spaces - own), _unusual(changed, number, step), -repair.spaces
                found.append(((*shape, min(own, 1), abs(place - number)), repair))
    return min(found)[1] if found else None


def _candidates(lines: Sequence[str], place: int) -> Iterator[int]:
    """Yield the lines to change, the nearest first."""
    tried, least = 0, 1 << 20
    for number in range(min(place, len(lines)), 0, -1):
        line = lines[number - 1]
        if not _is_entry(line):
            continue
        tried += 1
        if tried <= _ABOVE or column(line) <= least:
            yield number
        least = min(least, column(line))


def _repairs(lines: Sequence[str], number: int) -> Iterator[Repair]:
    """Yield the other columns at which a line has siblings: entries of its kind, with no entry further left between."""
    own, seen = lines[number - 1], {column(lines[number - 1])}
    if _is_mixed(lines, number):
        return
    is_list, is_first = own.lstrip().startswith("-"), not any(map(_is_entry, lines[: number - 1]))
    last = min(number + _FAR, len(lines))
    for way in (range(number - 1, max(0, number - _FAR), -1), range(number + 1, last + 1)):
        least = 1 << 20
        for other in way:
            line = lines[other - 1]
            if not _is_entry(line):
                continue
            inner = _key_of_item(line) if other < number else None
            for at, listed in ((column(line), line.lstrip().startswith("-")), (inner, False)):
                if at is not None and at < least and at not in seen and listed == is_list and not (is_first and at):
                    seen.add(at)
                    yield Repair(number, at, other, is_list)
            least = min(least, column(line) + 1)


def _key_of_item(line: str) -> int | None:
    """Return the column of the key in a line such as `- key: value`; None for other lines."""
    found = re.match(r" *- +(?=[^\s#{\[\"'].*:( |\Z))", line)
    return found.end() if found else None


def _is_mixed(lines: Sequence[str], number: int) -> bool:
    """Return whether a line is a key in the column of a list's items, which another indentation does not explain."""
    own = lines[number - 1]
    above = (line for line in reversed(lines[: number - 1]) if _is_entry(line) and column(line) <= column(own))
    before = next(above, "")
    return column(before) == column(own) and before.lstrip().startswith("-") and not own.lstrip().startswith("-")


def _unusual(lines: Sequence[str], number: int, step: int) -> int:
    """Return 0 if a line is indented by one step more than the entry that it belongs to, else 1 or 2."""
    at = column(lines[number - 1])
    above = (column(line) for line in reversed(lines[: number - 1]) if _is_entry(line))
    parent = next((other for other in above if other < at), -step)
    return 0 if at - parent == step else 1 if (at - parent) % step == 0 else 2


def _step(lines: Sequence[str]) -> int:
    """Return by how many spaces an entry is usually indented more than the one above."""
    columns = [column(line) for line in lines if _is_entry(line)]
    deeper = Counter(b - a for a, b in pairwise(columns) if b > a)
    return min(deeper, key=lambda spaces: (-deeper[spaces], abs(spaces - 2), spaces), default=2)


def _is_entry(line: str) -> bool:
    return _ENTRY.match(line.lstrip(" ")) is not None


def column(line: str) -> int:
    """Return the number of spaces at the start of a line."""
    return len(line) - len(line.lstrip(" "))
