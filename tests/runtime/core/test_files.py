"""Files in a folder are opened without following links, and read only if regular and within a size limit."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import RunError
from recipe_runtime.core.files import host_errors, open_inside, read_inside


@pytest.fixture
def root(tmp_path: Path) -> Path:
    folder = tmp_path / "root"
    (folder / "a" / "b").mkdir(parents=True)
    (folder / "a" / "b" / "file").write_bytes(b"body")
    (tmp_path / "secret").write_bytes(b"secret")
    return folder


def test_a_regular_file_is_read(root: Path) -> None:
    assert read_inside(root, "a/b/file", 4) == b"body"
    with pytest.raises(ValueError, match="has 4 bytes, and at most 3 are read"):
        read_inside(root, "a/b/file", 3)


def test_nothing_else_is_opened(root: Path) -> None:
    os.mkfifo(root / "pipe")
    (root / "link").symlink_to(root / "a")
    (root / "a" / "out").symlink_to("../../secret")
    for path in ("pipe", "a"):
        with pytest.raises(ValueError, match="is not a regular file"):
            open_inside(root, path)
    for path in ("link/b/file", "a/out", "a/none", "a/b/file/x"):
        with pytest.raises(OSError):
            open_inside(root, path)
    before = len(list(Path("/proc/self/fd").iterdir()))
    with open_inside(root, "a/b/file"), pytest.raises(OSError):
        open_inside(root, "link/b/file")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_name_that_is_too_long_gets_another_remedy_than_a_full_disk(tmp_path: Path) -> None:
    error = pytest.raises(RunError, match="File name too long; choose a shorter name")
    with error, host_errors("x", "free some space"):
        (tmp_path / ("x" * 300)).touch()
