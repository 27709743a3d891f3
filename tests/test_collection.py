"""Every file of tests is collected: by default pytest passes over folders called build or dist, without a word."""

from __future__ import annotations

from fnmatch import fnmatch

import pytest

from tests.sources import ROOT


def test_no_folder_of_tests_is_passed_over(pytestconfig: pytest.Config) -> None:
    """tests/runtime/build, with 160 tests, was left out of `make test`."""
    patterns: list[str] = pytestconfig.getini("norecursedirs")
    files = [path.relative_to(ROOT) for path in sorted((ROOT / "tests").rglob("test_*.py"))]
    folders = {part for path in files for part in path.parts[:-1]}
    assert "build" in folders
    assert not [name for name in folders for pattern in patterns if fnmatch(name, pattern)]
