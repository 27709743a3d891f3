"""With full, read-only or several disks, the error is one line, no partial file is left, and the next build succeeds.

Disks are mounted in a private namespace; tests are skipped, with the reason, where a host does not allow it.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.reliability.namespaces import need_mounts, shell
from tests.reliability.processes import Build
from tests.runtime.fakes import tree

pytestmark = pytest.mark.reliability


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the dataset that all others are compared with."""
    folder = tmp_path_factory.mktemp("whole")
    need_mounts(folder)
    ended = Build(folder).end()
    assert ended.code == 0, ended.errors
    return tree(folder / "out")


@pytest.mark.parametrize("size", ["8k", "60k", "200k", "400k", "700k", "900k"])
def test_a_full_disk(whole: dict[str, bytes], tmp_path: Path, size: str) -> None:
    ends = shell(
        tmp_path,
        f"""
        mkdir disk; mount -t tmpfs -o size={size} tmpfs disk
        build full --out disk/out
        test ! -e disk/out; mkdir found; cp -r disk/.out.partial/dataset found/ || true
        mount -o remount,size=64m disk
        build again --out disk/out
        ls -A disk >beside; cp -r disk/out out
        """,
    )
    full = ends["full"]
    assert full.code == 1
    assert len(full.errors.splitlines()) == 1
    assert re.search(r"cannot (be written|write \S+): No space left on device; free some space", full.errors)
    for path, body in tree(tmp_path / "found").items():
        if not path.endswith(".tmp"):
            assert body == whole[path.removeprefix("dataset/")], path
    assert ends["again"].code == 0, ends["again"].errors
    assert tree(tmp_path / "out") == whole
    assert (tmp_path / "beside").read_text().split() == [".out.source.json", "out"]


def test_a_full_cache(whole: dict[str, bytes], tmp_path: Path) -> None:
    """A build fails if motion cannot be stored, but not if the record of its recipe cannot be written."""
    ends = shell(
        tmp_path,
        """
        mkdir disk; mount -t tmpfs -o size=4k tmpfs disk; mkdir disk/cache; ln -s disk/cache cache
        head -c 4096 /dev/zero >disk/other
        build full --out out
        test ! -e out; find disk -name '*.tmp' >scraps
        rm disk/other; mount -o remount,size=24k disk
        build again --out out
        """,
    )
    (line,) = ends["full"].errors.splitlines()
    assert ends["full"].code == 1
    assert "cache cannot be written: No space left on device; free some space, or set RECIPE_CACHE" in line
    assert (tmp_path / "scraps").read_text() == ""
    assert ends["again"].code == 0, ends["again"].errors
    assert tree(tmp_path / "out") == whole


def test_read_only_folders(whole: dict[str, bytes], tmp_path: Path) -> None:
    ends = shell(
        tmp_path,
        """
        mkdir sealed; mount -t tmpfs -o ro tmpfs sealed
        build output --out sealed/out
        RECIPE_CACHE=$PWD/sealed build cache --out out
        test ! -e out
        build first --out out
        rm -r out
        mount -o bind,ro cache cache; mount -o remount,bind,ro cache
        build second --out out
        mkdir disk; mount -t tmpfs tmpfs disk; cp -r out disk/out; mount -o remount,ro disk
        build there --out disk/out
        """,
    )
    assert (ends["output"].code, ends["cache"].code) == (1, 1)
    (line,) = ends["output"].errors.splitlines()
    assert "sealed/.out.partial cannot be written: Read-only file system; free some space or allow writing" in line
    (line,) = ends["cache"].errors.splitlines()
    assert "sealed cannot be written: Read-only file system; free some space, or set RECIPE_CACHE" in line
    assert (ends["second"].code, ends["second"].errors) == (0, "")  # a complete cache may be read-only
    assert (ends["there"].code, ends["there"].errors) == (0, "")  # and so may an existing dataset
    assert tree(tmp_path / "out") == whole


def test_other_disks(whole: dict[str, bytes], tmp_path: Path) -> None:
    """The output may be on another disk than the cache, also through a link, but must not be a mount point."""
    ends = shell(
        tmp_path,
        """
        mkdir disk home; mount -t tmpfs tmpfs disk; ln -s ../disk home/disk
        build there --out disk/out
        build linked --out home/disk/other
        build point --out disk
        mv disk/out disk/other .
        """,
    )
    assert [ends[name].code for name in ("there", "linked", "point")] == [0, 0, 2]
    assert tree(tmp_path / "out") == tree(tmp_path / "other") == whole
    (line,) = ends["point"].errors.splitlines()
    assert line.endswith(f"disk is a mount point; choose a folder (--output) in it, such as {tmp_path}/disk/dataset")


def test_kernels_that_cannot_be_stored(whole: dict[str, bytes], tmp_path: Path) -> None:
    """With a read-only home, kernels are compiled elsewhere; with a full one, the error is one line."""
    ends = shell(
        tmp_path,
        """
        mkdir sealed small tmp; mount -t tmpfs -o ro tmpfs sealed; mount -t tmpfs -o size=300k tmpfs small
        export TMPDIR=$PWD/tmp
        RECIPE_KERNEL_CACHE=$PWD/sealed/dataset-recipe XDG_CACHE_HOME=$PWD/sealed build aside --out out
        ls -A tmp >aside
        rm -r out; mkdir small/dataset-recipe
        RECIPE_KERNEL_CACHE=$PWD/small/dataset-recipe XDG_CACHE_HOME=$PWD/small build full --out out
        test ! -e out
        mount -o remount,size=64m small
        RECIPE_KERNEL_CACHE=$PWD/small/dataset-recipe XDG_CACHE_HOME=$PWD/small build again --out out
        """,
    )
    assert ends["aside"].code == 0, ends["aside"].errors
    ours = [name for name in (tmp_path / "aside").read_text().splitlines() if name.startswith("dataset-recipe")]
    assert ours == ["dataset-recipe-0"]
    assert ends["full"].code == 1  # the compiler ends the process itself, after a message
    assert "No space left on device" in ends["full"].errors and "Traceback" not in ends["full"].errors
    assert ends["full"].errors.endswith("build again: what is done is kept\n")
    assert ends["again"].code == 0, ends["again"].errors
    assert tree(tmp_path / "out") == whole
