"""Outputs are written to files, pipes and devices in /dev, and nowhere else."""

from __future__ import annotations

import os
import stat
import threading
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.core.outputs import check_output, write_output


@pytest.mark.parametrize("replace", [False, True])
def test_a_link_to_a_device_is_not_followed(tmp_path: Path, replace: bool) -> None:
    """Regression: where NAME.recipe was a link to a disk, `recipe pack` of root wrote onto the disk."""
    link = tmp_path / "r.recipe"
    link.symlink_to("/dev/null")
    with pytest.raises(InputError, match="is a symbolic link"):
        write_output(link, b"pack", replace=replace)
    (tmp_path / "devices").symlink_to("/dev")
    with pytest.raises(InputError, match="is a device"):
        write_output(tmp_path / "devices" / "null", b"pack", replace=replace)


def test_a_disk_is_not_written(tmp_path: Path) -> None:
    disk = tmp_path / "r.recipe"
    try:
        os.mknod(disk, stat.S_IFBLK | 0o600, os.makedev(7, 250))
    except PermissionError:
        pytest.skip("only root can make devices")
    with pytest.raises(InputError, match="is a device"):
        check_output(disk, replace=True)


def test_pipes_and_standard_output_are_written(tmp_path: Path) -> None:
    body, read = bytes(range(256)) * 1000, list[bytes]()  # more than a pipe holds
    ours, theirs = os.pipe()

    def collect() -> None:
        with os.fdopen(ours, "rb") as file:
            read.append(file.read())

    reader = threading.Thread(target=collect)
    reader.start()
    try:
        write_output(Path(f"/dev/fd/{theirs}"), body)
    finally:
        os.close(theirs)
        reader.join()
    assert read == [body]
    write_output(Path("/dev/null"), body)
