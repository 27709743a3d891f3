"""Tier A: equal bytes on any x86-64 CPU, tested on emulated CPUs (Debian's qemu-user).

Every process of the verification runs on the emulated CPU: a wrapper replaces the interpreter, so that simulation and
workers are emulated too. Compiled kernels have the same machine code for all CPUs (render/device/setup.py), so they are
compiled natively and run emulated.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.runtime.core.test_codecs import PINNED
from tests.sources import ROOT

pytestmark = [
    pytest.mark.cpus,
    pytest.mark.skipif(shutil.which("qemu-x86_64") is None, reason="needs Debian's qemu-user"),
    pytest.mark.skipif(platform.machine() != "x86_64", reason="emulates x86-64 on x86-64"),
]
TINY = ROOT / "tests" / "golden" / "tiny.yaml"
_RUN = "import sys; sys.executable = sys.argv.pop(1); from recipe_cli.main import main; main()"


# Nehalem (2008) has SSE4.2 only. Sandy Bridge (2011) adds AVX, Haswell (2013) AVX2 and fused multiply-add.
def _emulated(cpu: str, folder: Path) -> Path:
    """Return an interpreter on an emulated CPU."""
    wrapper = folder / f"python-{cpu}"
    wrapper.write_text(f'#!/bin/sh\nexec qemu-x86_64 -cpu {cpu} "{sys.executable}" "$@"\n')
    wrapper.chmod(wrapper.stat().st_mode | stat.S_IXUSR)
    return wrapper


def _run(command: list[str | Path]) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, env=env, timeout=3600)


@pytest.fixture(scope="module", autouse=True)
def kernels() -> None:
    """Compile the kernels natively first."""
    done = _run([sys.executable, "-m", "recipe_cli", "verify", TINY, "--frames", "1", "--workers", "1"])
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("cpu", ["SandyBridge", "Haswell"])
def test_all_frames_of_the_tiny_recipe_pass_verification(cpu: str, tmp_path: Path) -> None:
    python = _emulated(cpu, tmp_path)
    done = _run([python, "-c", _RUN, python, "verify", TINY, "--all", "--workers", "1"])
    assert done.returncode == 0, done.stdout + done.stderr
    assert "PASS" in done.stdout


@pytest.mark.parametrize("cpu", ["Nehalem", "SandyBridge", "Haswell"])
def test_encoded_files_are_equal(cpu: str, tmp_path: Path) -> None:
    """The encoder selects its code by the CPU, and must give the same bytes on each."""
    python = _emulated(cpu, tmp_path)
    done = _run([python, "-c", "from tests.runtime.core.test_codecs import digests; print(digests())"])
    assert done.stdout.strip() == str(PINNED), done.stderr


def test_plans_and_motion_are_equal_without_avx(tmp_path: Path) -> None:
    """Kernels cannot run there, which the verdict states after plans and motion were equal."""
    python = _emulated("Nehalem", tmp_path)
    done = _run([python, "-c", _RUN, python, "verify", TINY, "--all", "--workers", "1", "--json"])
    (report,) = json.loads(done.stdout)
    assert (done.returncode, report["verdict"], report["stage"]) == (3, "INCONCLUSIVE", "observation"), done.stdout
    (difference,) = report["differences"]
    assert "needs a CPU with AVX" in difference["excuse"]
