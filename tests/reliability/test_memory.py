"""Without memory, in any process, one line states the error, and the next build produces the same dataset."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.reading import one_line_each
from tests.reliability.processes import TINY, Build, scraps
from tests.runtime.fakes import tree

pytestmark = pytest.mark.reliability


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    assert Build(folder).end().code == 0
    return tree(folder / "out")


@pytest.mark.parametrize("mebibytes", [600, 650, 700, 800])
def test_allocations_that_fail(whole: dict[str, bytes], tmp_path: Path, mebibytes: int) -> None:
    """A limit on address space: allocations fail in each process, at a different point for each limit."""
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "recipe_cli",
            "build",
            str(TINY),
            "--out",
            str(tmp_path / "out"),
            "--workers",
            "2",
            "--allow-large",
        ],
        env={**os.environ, "RECIPE_CACHE": str(tmp_path / "cache")},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (mebibytes << 20, mebibytes << 20)),
        capture_output=True,
        text=True,
        timeout=200,
    )
    if done.returncode == 0:
        assert mebibytes > 600
    else:
        assert done.returncode == 1, done.stderr
        (line,) = one_line_each(done.stderr, warnings=False).splitlines()
        assert "memory" in line, line
        assert not (tmp_path / "out").exists()
    assert Build(tmp_path).end().code == 0
    assert tree(tmp_path / "out") == whole
    assert scraps(tmp_path) == []


@pytest.fixture
def cage(tmp_path: Path) -> Iterator[Path]:
    """Return a control group with 300 MiB; skip the test where the user may not create one."""
    root = Path("/sys/fs/cgroup")
    first = not (root / "cgroup.controllers").exists()
    folder = (root / "memory" if first else root) / f"recipe-test-{os.getpid()}"
    try:
        folder.mkdir()
        (folder / ("memory.limit_in_bytes" if first else "memory.max")).write_text(str(300 << 20))
    except OSError as error:
        if folder.is_dir():
            folder.rmdir()
        pytest.skip(f"no control group of our own here: {error}")
    yield folder
    for _ in range(100):
        try:
            folder.rmdir()
            return
        except OSError:
            time.sleep(0.05)


def test_the_kernel_kills_a_process_for_its_memory(whole: dict[str, bytes], tmp_path: Path, cage: Path) -> None:
    build = f"{sys.executable} -m recipe_cli build {TINY} --out out --workers 3 --allow-large"
    script = f"echo $$ >{cage}/cgroup.procs; exec {build}"
    done = subprocess.run(
        ["bash", "-euc", script],
        cwd=tmp_path,
        env={**os.environ, "RECIPE_CACHE": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert done.returncode in (1, -9), done.stderr
    if done.returncode == 1:
        (line,) = one_line_each(done.stderr, warnings=False).splitlines()
        assert "memory running out" in line or "ended with signal 9" in line
    assert not (tmp_path / "out").exists()
    assert Build(tmp_path).end().code == 0
    assert tree(tmp_path / "out") == whole
