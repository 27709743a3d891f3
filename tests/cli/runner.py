"""Run commands in this process with the errors and exit codes of `recipe`, but without starting Python."""

from __future__ import annotations

import contextlib
import io
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from recipe_cli.main import main

RENDERING = ("build", "lock", "verify")  # commands that use workers


def run_here(*arguments: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `recipe` with these arguments in a folder, without workers, and return its output and exit code.

    For tests of output and files. Tests of processes, signals and start-up need a process.
    """
    command = ["recipe", *map(str, arguments)]
    written = [io.BytesIO(), io.BytesIO()]
    out, errors = (io.TextIOWrapper(body, encoding="utf-8", write_through=True) for body in written)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(cwd)
        patch.setattr(sys, "argv", command)
        for name, value in environment.items():
            patch.setenv(name, value)
        for name in RENDERING:
            patch.setattr(import_module(f"recipe_cli.commands.{name}"), "worker_count", lambda *_: 0)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
                main()
        except SystemExit as ended:
            code = ended.code
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
    assert isinstance(code, int)
    return subprocess.CompletedProcess(command, code, *[body.getvalue().decode() for body in written])
