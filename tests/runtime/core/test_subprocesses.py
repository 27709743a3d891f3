"""Processes start without garbage collection, which took a tenth of the CPU time of their imports."""

from __future__ import annotations

import gc
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from recipe_cli import entry
from recipe_cli import main as command_line
from recipe_runtime.core import subprocesses

PROBE = """
import gc

def main():
    before = sum(generation["collections"] for generation in gc.get_stats())
    from recipe_runtime.annotate import records
    print(sum(generation["collections"] for generation in gc.get_stats()) - before)
"""


@pytest.fixture
def threshold() -> Iterator[tuple[int, int, int]]:
    """Return the thresholds of garbage collection before the test, and restore them after it."""
    before = gc.get_threshold()
    yield before
    gc.set_threshold(*before)


@pytest.mark.slow
def test_no_collection_runs_while_a_child_imports_modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gc_probe.py").write_text(PROBE)
    monkeypatch.syspath_prepend(tmp_path)
    command = subprocesses.command("gc_probe", "main")
    assert subprocess.run(command, capture_output=True, check=True).stdout == b"0\n"


def test_the_command_line_has_the_thresholds_of_its_children(
    threshold: tuple[int, int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    monkeypatch.setattr(command_line, "main", lambda: found.append(gc.get_threshold()[0]))
    entry.main()
    assert found == [subprocesses.GC_THRESHOLD] and found[0] > threshold[0]
