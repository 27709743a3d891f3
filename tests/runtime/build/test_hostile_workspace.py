"""A work folder is untrusted: each of its files is read up to a limit."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest
from recipe_runtime.build.pipeline import build

from tests.runtime import fakes

PLAN = fakes.dataset_plan(frames=2, weathers=1)


@pytest.mark.slow
def test_a_large_job_file_is_not_read_in_full(tmp_path: Path) -> None:
    partial = tmp_path / "sets" / ".tiny.partial"
    partial.mkdir(parents=True)
    with (partial / "job.json").open("wb") as file:
        file.truncate(1 << 28)
    tracemalloc.start()
    try:
        built = build(PLAN, tmp_path / "sets" / "tiny", workers=0, cache=tmp_path / "cache", engines=fakes.ENGINES)
        assert built.built
        assert tracemalloc.get_traced_memory()[1] < 1 << 27
    finally:
        tracemalloc.stop()
