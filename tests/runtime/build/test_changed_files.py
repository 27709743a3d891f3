"""A build detects files that another program changes meanwhile, and then publishes nothing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.build import workspace
from recipe_runtime.build.pipeline import BuildResult, build
from recipe_runtime.core.files import file_sha256

from tests.runtime.fakes import ENGINES, dataset_plan, tree

PLAN = dataset_plan(frames=3, weathers=1)
PICTURE = "weather=w0,jitter=still/street/rgb/000002.png"
TEXT = "annotations/kwcoco.json"


def made(folder: Path, disturb: Callable[[Path], None] = lambda root: None, at: str = "finish") -> BuildResult:
    """Build, and change the files when a stage begins."""

    def progress(stage: str, done: int, total: int) -> None:
        if (stage, done) == (at, 0):
            disturb(folder / ".tiny.partial" / "dataset")

    return build(PLAN, folder / "tiny", workers=0, cache=folder / "cache", engines=ENGINES, progress=progress)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files of a build that nothing disturbs."""
    return tree(made(tmp_path_factory.mktemp("fresh")).path)


def overwrite(path: Path) -> None:
    body = path.read_bytes()
    path.write_bytes(body[:-1] + bytes([body[-1] ^ 1]))


def swap(path: Path) -> None:
    """Replace a file as editors do: another file under the same name, with the times of the first."""
    found, body = path.stat(), path.read_bytes()
    path.unlink()
    path.write_bytes(body[:-1] + bytes([body[-1] ^ 1]))
    os.utime(path, ns=(found.st_atime_ns, found.st_mtime_ns))


def lengthen(path: Path) -> None:
    with path.open("ab") as file:
        file.write(b"\n")


def link(path: Path) -> None:
    elsewhere = path.with_name("elsewhere")
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


@pytest.mark.slow
@pytest.mark.parametrize("how", [overwrite, swap, lengthen, link, Path.unlink])
@pytest.mark.parametrize("path", [PICTURE, TEXT])
def test_a_changed_file_is_named_and_nothing_is_published(
    fresh: dict[str, bytes], tmp_path: Path, how: Callable[[Path], None], path: str
) -> None:
    with pytest.raises(RunError, match="was changed or removed by another program during the build") as error:
        made(tmp_path, lambda root: how(root / path))
    assert path in str(error.value)
    assert not (tmp_path / "tiny").exists()
    assert tree(made(tmp_path).path) == fresh


@pytest.mark.slow
def test_a_file_added_to_the_old_dataset_during_the_build_is_kept(fresh: dict[str, bytes], tmp_path: Path) -> None:
    """Regression: the old dataset was deleted with the notes that its owner wrote into it meanwhile."""
    first = made(tmp_path)
    (first.path / PICTURE).unlink()
    notes = first.path / "notes.txt"

    def write_notes(root: Path) -> None:
        notes.write_text("mine")

    with pytest.raises(InputError, match=r"holds a file that is not the dataset's, notes.txt"):
        made(tmp_path, write_notes)
    assert notes.read_text() == "mine"
    notes.rename(tmp_path / "notes.txt")
    assert tree(made(tmp_path).path) == fresh


@pytest.mark.slow
def test_a_touched_or_copied_file_with_equal_bytes_is_accepted(tmp_path: Path) -> None:
    def touch(root: Path) -> None:
        (root / PICTURE).touch()
        copy = root / "copy"
        shutil.copyfile(root / TEXT, copy)
        copy.replace(root / TEXT)

    assert made(tmp_path, touch).built


@pytest.mark.slow
def test_a_change_of_a_reused_file_is_detected(fresh: dict[str, bytes], tmp_path: Path) -> None:
    """The file is a hard link to that of the earlier dataset, which is then damaged too and built again."""
    first = made(tmp_path)
    (first.path / "weather=w0,jitter=still/street/rgb/000000.png").unlink()
    with pytest.raises(RunError, match="was changed or removed by another program"):
        made(tmp_path, lambda root: overwrite(root / PICTURE))
    assert tree(made(tmp_path).path) == fresh


@pytest.mark.slow
def test_unchanged_files_are_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def noted(path: Path) -> str:
        read.append(path.suffix)
        return file_sha256(path)

    monkeypatch.setattr(workspace, "file_sha256", noted)
    made(tmp_path)
    assert [suffix for suffix in read if suffix == ".png"] == [".png"] * 2  # the preview's two pictures
