"""Install commands in messages and pages name existing extras and requirements of pyproject.toml."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.sources import ROOT

PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
EXTRAS = dict(re.findall(r"^(\w+) = \[(.*?)\]", PROJECT.partition("[project.optional-dependencies]")[2], re.M | re.S))
TEXTS = sorted(
    path
    for folder in ("cli", "compiler", "runtime", "docs", ".")
    for path in ((ROOT / folder).rglob("*") if folder != "." else ROOT.glob("*.md"))
    if path.suffix in (".py", ".md")
)


def wanted(text: str) -> list[str]:
    """Return what each `pip install` in a text installs; names of literals of the same file are replaced."""
    return [quoted for line in re.findall(r"pip install([^`\n]*)", text) for quoted in re.findall(r"'([^']+)'", line)]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_pip_lines_name_existing_extras_and_requirements(path: Path) -> None:
    for what in wanted(path.read_text(encoding="utf-8")):
        if what == "{library}":  # of stores.py
            continue
        extras = re.search(r"\[(.*)\]", what)
        if extras:
            assert set(extras[1].split(",")) <= set(EXTRAS), f"{path}: pip install {what}"
            assert what.startswith(".["), f"{what}: the project is on no index; install a checkout"
        else:
            assert f'"{what}"' in PROJECT, f"{path}: pip install {what}"


def test_the_page_lists_each_scheme_with_the_extra_of_its_library() -> None:
    from recipe_runtime.transfer.stores import SCHEMES

    table = (ROOT / "docs" / "dataset.md").read_text(encoding="utf-8").partition("| URL | place | extra |")[2]
    rows = [row.split("|") for row in table.partition("\n\n")[0].splitlines()[2:]]
    found = {scheme: row[3].strip(" `") for row in rows for scheme in re.findall(r"`(\w+)://", row[1])}
    assert {scheme: EXTRAS[extra] if extra else '""' for scheme, extra in found.items()} == {
        scheme: f'"{known.library}"' for scheme, known in SCHEMES.items()
    }


def test_the_check_detects_an_unknown_extra() -> None:
    assert wanted("write pip install 'dataset-recipe[abfs]' now") == ["dataset-recipe[abfs]"]
    assert "abfs" not in EXTRAS and set(EXTRAS) >= {"dev", "gcs", "ray", "s3", "torch"}
