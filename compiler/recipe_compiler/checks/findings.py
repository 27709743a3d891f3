"""Collects the problems of many variants and reports each once, with a note if only some variants have it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from recipe_compiler.ir.errors import Code, Place, Problem, printable
from recipe_compiler.ir.plurals import count

if TYPE_CHECKING:
    from recipe_compiler.expand import Variant

_NOWHERE = Place("", 0, 0)


@dataclass
class _Finding:
    """A problem, the first variant that has it, the last, and how many have it."""

    problem: Problem
    first: Variant | None
    last: Variant | None
    variants: int = 1


class Findings:
    """Distinct problems of several variants.

    Messages that differ in numbers only, as with random draws, count as one. The first is reported; of those on what a
    town has room for, the one with the least numbers, which all variants have room for.
    """

    def __init__(self) -> None:
        self.total = 0  # problems added, counted in each variant
        self._variants = 0
        self._last: Variant | None = None
        self._found: dict[tuple[Place | None, str], _Finding] = {}

    def add(self, problems: Iterable[Problem], variant: Variant | None = None) -> None:
        """Add the problems of a variant, or of the recipe as a whole."""
        if variant is not None and variant is not self._last:
            self._variants, self._last = self._variants + 1, variant
        for problem in problems:
            self.total += 1
            key = (problem.place, re.sub(r"[0-9][0-9,.]*", "0", problem.message))
            finding = self._found.setdefault(key, _Finding(problem, variant, variant))
            if problem.code is Code.NO_ROOM and _numbers(problem) < _numbers(finding.problem):
                finding.problem = problem
            finding.variants += finding.last is not variant
            finding.last = variant

    def problems(self) -> list[Problem]:
        """Return all problems, sorted by place, with a note on those that only some variants have."""
        shown = [_noted(finding, self._variants) for finding in self._found.values()]
        return sorted(shown, key=lambda problem: problem.place or _NOWHERE)


def _numbers(problem: Problem) -> list[int]:
    return [int(number) for number in re.findall(r"[0-9]+", problem.message.replace(",", ""))]


def _noted(finding: _Finding, variants: int) -> Problem:
    problem, variant = finding.problem, finding.first
    note = problem.note
    if variant is not None and finding.variants < variants:
        town = variant.base.get("town", "name")
        where = f", town {printable(town.data)[:64]}" if town is not None and isinstance(town.data, str) else ""
        others = finding.variants - 1
        more = f", and in {count(others, 'other variant')}" if others else ""
        note = f"in variant {printable(variant.name)[:200]}{where}{more}"
    help = None if problem.help is None else printable(problem.help)
    return replace(problem, message=printable(problem.message), help=help or "", note=note)
