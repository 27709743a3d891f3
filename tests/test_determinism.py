"""Tier A on one host: bytes do not depend on the environment, the number of workers and the order.

Each test renders every frame of tests/golden/tiny.yaml and compares with its committed lockfile, so it also compares
bytes with earlier versions of the code. test_cpus.py tests emulated CPUs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_compiler.ir import lockfile
from recipe_runtime.dataset.reader import read

from tests.cli.runner import run_here
from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"
LOCKED = ROOT / "tests" / "golden" / "lockfiles" / "tiny.lock"


def _numpy_features() -> str:
    """Return the CPU features of this host for which this numpy has separate code."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))


# Masks all CPU features. To find the cause of a failure, change one variable at a time.
OTHER_PROCESSOR = {
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4",
    "NPY_DISABLE_CPU_FEATURES": _numpy_features(),
    "OPENBLAS_CORETYPE": "Nehalem",
    "OMP_NUM_THREADS": "4",
}
OTHER_USER = {
    "TZ": "Asia/Kolkata",
    "LC_ALL": "de_DE.UTF-8",
    "PYTHONHASHSEED": "12345",
    "USER": "someone",
    "LOGNAME": "someone",
    "HOSTNAME": "elsewhere",
}


def _recipe(*arguments: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "recipe_cli", *map(str, arguments)]
    return subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, timeout=600
    )


@pytest.mark.slow
def test_the_golden_recipe_passes_verification_on_another_processor(tmp_path: Path) -> None:
    done = _recipe("verify", TINY, "--all", "--json", "--workers", "1", cwd=tmp_path, **OTHER_PROCESSOR)
    (report,) = json.loads(done.stdout)
    assert (done.returncode, report["verdict"], report["differences"]) == (0, "PASS", [])
    assert report["checked"] == report["total"] == 24


@pytest.mark.slow
def test_files_do_not_depend_on_user_locale_time_zone_and_number_of_workers(tmp_path: Path) -> None:
    """This includes every file of the dataset, in addition to the pixels and labels of the lockfile."""
    here = run_here("build", TINY, "--out", "here", cwd=tmp_path, RECIPE_CACHE=str(tmp_path / "cache-here"))
    assert here.returncode == 0, here.stderr
    old = os.umask(0o077)
    try:
        cache = str(tmp_path / "cache-there")
        there = _recipe(
            "build", TINY, "--out", "there", "--workers", "3", cwd=tmp_path, RECIPE_CACHE=cache, **OTHER_USER
        )
    finally:
        os.umask(old)
    assert there.returncode == 0, there.stderr
    trees = []
    for name in ("here", "there"):
        out = tmp_path / name
        trees.append({p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()})
        assert read(out).lock.identity == lockfile.read(LOCKED).identity
    assert trees[0].keys() == trees[1].keys()
    assert [path for path in trees[0] if trees[0][path] != trees[1][path]] == []
