"""Tier A on one host: bytes do not depend on the environment, the number of workers and the order.

Each case verifies every frame of tests/golden/tiny.yaml against its committed lockfile, so it also compares bytes with
earlier versions of the code. A build in an unchanged environment has the lockfile's identity. test_cpus.py tests
emulated CPUs.
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

from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"
LOCKED = ROOT / "tests" / "golden" / "lockfiles" / "tiny.lock"


def _numpy_features() -> str:
    """Return the CPU features of this host for which this numpy has separate code."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))


MASK = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4"
# One run masks all CPU features, the other changes everything else. To find the cause of a failure, change one variable
# at a time.
CASES: dict[str, tuple[dict[str, str], int]] = {
    "another processor": (
        {
            "GLIBC_TUNABLES": MASK,
            "NPY_DISABLE_CPU_FEATURES": _numpy_features(),
            "OPENBLAS_CORETYPE": "Nehalem",
            "OMP_NUM_THREADS": "4",
        },
        1,
    ),
    "another user, place, language and number of workers": (
        {
            "TZ": "Asia/Kolkata",
            "LC_ALL": "de_DE.UTF-8",
            "PYTHONHASHSEED": "12345",
            "USER": "someone",
            "LOGNAME": "someone",
            "HOSTNAME": "elsewhere",
        },
        3,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_golden_recipe_passes_verification(case: str, tmp_path: Path) -> None:
    environment, workers = CASES[case]
    command = [sys.executable, "-m", "recipe_cli", "verify", str(TINY), "--all", "--json", "--workers", str(workers)]
    old = os.umask(0o077 if "USER" in environment else 0o022)
    try:
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, **environment}, capture_output=True, text=True, timeout=600
        )
    finally:
        os.umask(old)
    (report,) = json.loads(done.stdout)
    assert (done.returncode, report["verdict"], report["differences"]) == (0, "PASS", [])
    assert report["checked"] == report["total"] == 24


@pytest.mark.slow
def test_files_are_the_same_bytes_in_another_environment(tmp_path: Path) -> None:
    """This includes every file of the dataset, in addition to the pixels and labels of the lockfile."""
    trees = []
    for name, environment, workers in (("a", {}, 1), ("b", {"TZ": "Asia/Kolkata", "PYTHONHASHSEED": "77"}, 2)):
        out = tmp_path / name
        command = [sys.executable, "-m", "recipe_cli", "build", str(TINY), "--out", str(out), "--workers", str(workers)]
        env = {**os.environ, **environment, "RECIPE_CACHE": str(tmp_path / f"cache-{name}")}
        done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        trees.append({p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()})
        assert read(out).lock.identity == lockfile.read(LOCKED).identity
    assert trees[0].keys() == trees[1].keys()
    assert [path for path in trees[0] if trees[0][path] != trees[1][path]] == []
