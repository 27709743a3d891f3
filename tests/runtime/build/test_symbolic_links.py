"""Builds do not follow symbolic links that others placed in their folders."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError, RecipeError
from recipe_runtime.build.pipeline import build
from recipe_runtime.build.workspace import Workspace
from recipe_runtime.dataset.reader import damaged_files, read

from tests.runtime.fakes import BROKEN, ENGINES, dataset_plan, tree

PLAN = dataset_plan(frames=8)


def victim(folder: Path) -> dict[str, bytes]:
    """Return a folder of a user's files, with the names that a build gives its own files."""
    for name in ("old/important", "home/letter", "dataset/photo", "shards/x", "job.json"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("{}")
    return tree(folder)


@pytest.mark.slow
@pytest.mark.parametrize("there", [False, True])
def test_a_work_folder_that_is_a_link_is_refused(tmp_path: Path, there: bool) -> None:
    before = victim(tmp_path / "victim")
    out = tmp_path / "datasets" / "tiny"
    if there:
        build(PLAN, out, workers=0, cache=tmp_path / "cache", engines=ENGINES)
    out.parent.mkdir(exist_ok=True)
    (out.parent / ".tiny.partial").symlink_to(tmp_path / "victim")
    Workspace.settle(out)
    if not there:
        with pytest.raises(InputError, match="is a symbolic link"):
            build(PLAN, out, workers=0, cache=tmp_path / "cache", engines=ENGINES)
    assert tree(tmp_path / "victim") == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["old", "dataset", "shards"])
def test_a_link_within_a_work_folder_is_not_followed(tmp_path: Path, name: str) -> None:
    before = victim(tmp_path / "victim")
    partial = tmp_path / ".tiny.partial"
    partial.mkdir()
    (partial / "job.json").write_text("{}")
    (partial / name).symlink_to(tmp_path / "victim")
    build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=ENGINES)
    assert tree(tmp_path / "victim") == before
    assert not partial.exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dataset", "shards", "of a variant"])
def test_a_link_that_appears_in_unfinished_work_is_removed(tmp_path: Path, name: str) -> None:
    """Regression: a link in place of a folder was accepted as finished by later builds, which could not publish it."""
    with pytest.raises(RecipeError):
        build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=BROKEN, shard_frames=2)
    place, elsewhere = tmp_path / ".tiny.partial" / name, tmp_path / "elsewhere"
    if name == "of a variant":
        place = next(path for path in sorted((tmp_path / ".tiny.partial/dataset").iterdir()) if path.is_dir())
    place.rename(elsewhere)
    place.symlink_to(elsewhere)
    before = tree(elsewhere)
    built = build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=ENGINES, shard_frames=2)
    assert tree(elsewhere) == before
    assert damaged_files(read(built.path), lambda *_: None) == []


@pytest.mark.slow
def test_foreign_folders_and_links_are_not_published(tmp_path: Path) -> None:
    """Regression: after a build with a foreign empty folder in its work folder, `recipe verify` failed."""
    with pytest.raises(RecipeError):
        build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=BROKEN)
    dataset = tmp_path / ".tiny.partial" / "dataset"
    (dataset / "empty" / "inner").mkdir(parents=True)
    (dataset / "empty" / "file").touch()
    built = build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=ENGINES).path
    assert not (built / "empty").exists()
