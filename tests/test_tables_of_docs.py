"""The generated parts of README.md and docs/ are current."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.tables import PAGES, PARTS, ROOT, renewed

MARKED = [page for page in PAGES if "<!-- generated: " in page.read_text(encoding="utf-8")]


@pytest.mark.parametrize("page", MARKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_generated_parts_of_a_page_are_current(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert renewed(text) == text, "run `make tables`"
    assert text.count("<!-- generated: ") == text.count("<!-- end -->")


def test_each_part_is_on_a_page() -> None:
    marked = {name for page in MARKED for name in re.findall(r"<!-- generated: (.*?) -->", page.read_text())}
    assert marked == set(PARTS)
