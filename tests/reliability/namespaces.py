"""Private disks for a test: a shell in a mount namespace, in which a user may mount and which ends with the shell."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.reading import one_line_each
from tests.reliability.processes import TINY, Ended

_TRY = "mkdir -p $1/try && mount -t tmpfs -o size=4k tmpfs $1/try && umount $1/try && rmdir $1/try"


def need_mounts(folder: Path) -> None:
    """Skip the test if this host allows no mounts by users."""
    if shutil.which("unshare") is None:
        pytest.skip("needs unshare, of util-linux")
    tried = subprocess.run(
        ["unshare", "-rm", "sh", "-euc", _TRY, "sh", str(folder)], capture_output=True, text=True, timeout=30
    )
    if tried.returncode:
        pytest.skip(f"this host allows no mounts of a user's own: {tried.stderr.strip()}")


def shell(folder: Path, script: str, **environment: str) -> dict[str, Ended]:
    """Run a script in `folder` in a mount namespace, in which `build NAME OPTIONS...` builds the tiny recipe.

    `name` -> how that build ended. A build that ends in an error does not end the script.
    """
    (folder / "script").write_text(_PREFACE.format(python=sys.executable, recipe=TINY) + script)
    done = subprocess.run(
        ["unshare", "-rm", "bash", "-eu", "script"],
        cwd=folder,
        env={**os.environ, "RECIPE_CACHE": str(folder / "cache"), **environment},
        capture_output=True,
        text=True,
        timeout=400,
    )
    assert done.returncode == 0, done.stderr
    return {path.stem: _ended(path) for path in sorted((folder / "ends").iterdir()) if path.suffix == ".code"}


def _ended(code: Path) -> Ended:
    errors = one_line_each(code.with_suffix(".errors").read_text(), warnings=False)
    return Ended(int(code.read_text()), code.with_suffix(".out").read_text(), errors)


_PREFACE = """\
mkdir ends
build() {{
  local name=$1; shift
  local code=0
  timeout 200 {python} -m recipe_cli build {recipe} --allow-large --workers 2 "$@" \
    >"$PWD/ends/$name.out" 2>"$PWD/ends/$name.errors" || code=$?
  echo $code >"$PWD/ends/$name.code"
}}
"""
