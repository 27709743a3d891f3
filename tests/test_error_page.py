"""docs/errors.md explains every code that a problem can have, and each code that it explains is in use."""

from __future__ import annotations

import re

from recipe_compiler.ir.errors import Code, Problem

from tests.sources import ROOT

PAGE = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")


def test_every_code_is_explained_in_the_order_of_the_list() -> None:
    assert re.findall(r"^\| `([a-z-]+)` \| \S", PAGE, re.M) == [str(code) for code in Code]
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", str(code)) for code in Code)


def test_every_code_is_in_use() -> None:
    text = "".join(p.read_text() for folder in ("cli", "compiler", "runtime") for p in (ROOT / folder).rglob("*.py"))
    unused = [code.name for code in Code if f"Code.{code.name}" not in text]
    assert not unused


def test_a_problem_without_a_code_has_the_general_one() -> None:
    assert Problem("x").code is Code.INVALID_INPUT
