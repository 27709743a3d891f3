"""A work folder is untrusted: each of its files is read up to a limit, and its folders may be nested deeply."""

from __future__ import annotations

import os
import subprocess
import tracemalloc
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.output_folder import check_files
from recipe_runtime.build.pipeline import build
from recipe_runtime.core.files import remove_tree
from recipe_runtime.dataset import reader
from recipe_runtime.transfer.layouts import export_layout

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


def _nest(folder: Path, depth: int = 1900) -> None:
    """Make folders inside each other, deeper than Python recurses, as an archive of some KB holds them."""
    folder.mkdir(parents=True, exist_ok=True)
    above = os.open(folder, os.O_RDONLY)
    for _ in range(depth):
        os.mkdir("a", dir_fd=above)
        below = os.open("a", os.O_RDONLY, dir_fd=above)
        os.close(above)
        above = below
    os.close(above)


def _unnest(folder: Path) -> None:
    """Remove the folders, so that pytest can remove its own."""
    subprocess.run(["rm", "-r", folder], check=True)


@pytest.mark.slow
def test_deeply_nested_folders_are_an_error_of_one_line(tmp_path: Path) -> None:
    """Regression: they ended `build` and `export` with a RecursionError."""
    out, cache = tmp_path / "sets" / "tiny", tmp_path / "cache"
    found = build(PLAN, out, workers=0, cache=cache, engines=fakes.ENGINES)
    partial, work, inner = tmp_path / "sets" / ".other.partial", tmp_path / ".mots.export", out / "inner"
    for folder in (partial / "dataset", work, inner):
        _nest(folder)
    (partial / "job.json").write_text("{}")
    (work / ".dataset-recipe-export").touch()
    try:
        with pytest.raises(InputError, match="nested too deeply"):
            build(PLAN, partial.parent / "other", workers=0, cache=cache, engines=fakes.ENGINES)
        with pytest.raises(InputError, match="nested too deeply"):
            export_layout(reader.read(found.path), tmp_path / "mots", "mots", lambda *_: None)
        with pytest.raises(InputError, match="nested too deeply"):
            check_files(out, out)
        with pytest.raises(InputError, match="nested too deeply"):
            remove_tree(inner)
    finally:
        for folder in (partial / "dataset", work, inner):
            if folder.exists():
                _unnest(folder)
