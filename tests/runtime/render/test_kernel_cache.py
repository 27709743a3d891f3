"""Compiled kernels are stored below RECIPE_CACHE, or where RECIPE_KERNEL_CACHE says."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_runtime.cache import pruning
from recipe_runtime.render.device import setup


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.delenv("RECIPE_KERNEL_CACHE", raising=False)
    monkeypatch.delenv("RECIPE_CACHE", raising=False)
    return tmp_path / "home" / "dataset-recipe"


def test_kernels_follow_the_cache_and_are_counted_there(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Path(setup._cache_folder()).parent == home / "kernels"
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "moved"))
    moved = Path(setup._cache_folder())
    assert moved.parent == tmp_path / "moved" / "kernels"
    assert pruning.folders() == [tmp_path / "moved"]
    module = moved / "1.19.0" / "wp_render.shade_0123abc"
    module.mkdir(parents=True)
    (module / "wp_render.shade_0123abc.o").write_bytes(b"x" * 70)
    assert pruning.sizes(pruning.entries(pruning.folders())) == {"kernels": (1, 70)}
    monkeypatch.setenv("RECIPE_KERNEL_CACHE", str(tmp_path / "apart"))
    assert Path(setup._cache_folder()).parent == tmp_path / "apart" / "kernels"
    assert pruning.folders() == [tmp_path / "moved", tmp_path / "apart"]
