"""Counts with correct singular and plural forms."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from recipe_compiler.ir.plurals import count, form

from tests.sources import ROOT


@pytest.mark.parametrize(
    ("number", "reported"), [(0, "0 frames"), (1, "1 frame"), (2, "2 frames"), (100_000, "100,000 frames")]
)
def test_a_count_takes_the_form_of_its_number(number: int, reported: str) -> None:
    assert count(number, "frame") == reported


def test_irregular_plurals() -> None:
    assert [count(n, "body", "bodies") for n in (1, 3)] == ["1 body", "3 bodies"]
    assert [form(n, "differs", "differ") for n in (0, 1, 2)] == ["differ", "differs", "differ"]


def test_no_message_has_a_fixed_plural_after_a_number() -> None:
    """An f-string such as `{len(scenes)} scenes` gives `1 scenes`; numbers over a limit are never 1 and are exempt."""
    things = "variants|scenes|shards|frames|files|pictures|entries|bodies|images|annotations|actors"
    fixed = re.compile(rf"\{{(?:len\([^{{}}]*\)|[a-z_]+\.[a-z_.]+)(?::,)?\}} (?:{things})\b(?! (?:are|that|alone|and))")
    found = []
    for folder in ("cli", "compiler", "runtime"):
        for path in sorted(Path(ROOT / folder).rglob("*.py")):
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                if fixed.search(line):
                    found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    assert not found, "\n".join(found)
