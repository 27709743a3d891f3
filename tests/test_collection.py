"""Every test file is collected; by default, pytest silently skips folders named build or dist."""

from __future__ import annotations

import re
from fnmatch import fnmatch

import pytest

from tests.sources import ROOT


def test_no_folder_of_tests_is_skipped(pytestconfig: pytest.Config) -> None:
    """Regression: `make test` skipped tests/runtime/build with 160 tests."""
    patterns: list[str] = pytestconfig.getini("norecursedirs")
    files = [path.relative_to(ROOT) for path in sorted((ROOT / "tests").rglob("test_*.py"))]
    folders = {part for path in files for part in path.parts[:-1]}
    assert "build" in folders
    assert not [name for name in folders for pattern in patterns if fnmatch(name, pattern)]


def test_names_of_tests_are_short(request: pytest.FixtureRequest) -> None:
    """One was 12 MB long: pytest-xdist sends names between processes, and pytest puts them into the environment."""
    assert [item.nodeid[:200] for item in request.session.items if len(item.nodeid) > 500] == []


def test_no_gated_test_reads_a_clock_of_the_processor() -> None:
    """A loaded machine fails it; a time that only bounds a wait is `time.monotonic` or a timeout."""
    clocks = re.compile(r"\b(process_time|perf_counter|thread_time)\w*\(")
    files = [path for path in sorted((ROOT / "tests").rglob("*.py")) if "soak" not in path.parts]
    found = [f"{path.relative_to(ROOT)}: {line}" for path in files for line in clocks.findall(path.read_text())]
    assert found == []
