"""Builds do not follow symbolic links that others placed in their folders."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.ir.errors import RecipeError
from recipe_runtime.build.pipeline import BuildOptions, build

from tests.runtime.fakes import BROKEN, ENGINES, dataset_plan

PLAN = dataset_plan(frames=8)


@pytest.mark.slow
def test_foreign_folders_and_links_are_not_published(tmp_path: Path) -> None:
    """Regression: after a build with a foreign empty folder in its work folder, `recipe verify` failed."""
    with pytest.raises(RecipeError):
        build(PLAN, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=BROKEN))
    dataset = tmp_path / ".tiny.partial" / "dataset"
    (dataset / "empty" / "inner").mkdir(parents=True)
    (dataset / "empty" / "file").touch()
    built = build(PLAN, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)).path
    assert not (built / "empty").exists()
