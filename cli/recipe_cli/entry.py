"""Entry point of the `recipe` command: Ctrl-C prints no traceback, also while modules are still imported."""

from __future__ import annotations

import gc
import os
import signal
import sys


def main() -> None:
    """Import and run the command; exit code 130 if that is interrupted."""
    gc.set_threshold(200_000)  # as in child processes (core.subprocesses)
    _open_standard_streams()
    try:
        from recipe_cli.main import main as run

        run()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second one would interrupt the message
        from recipe_compiler.ir.errors import Code, Problem

        from recipe_cli.console import State, fail

        problem = Problem("interrupted", help="run the command again", code=Code.INTERRUPTED)
        fail([problem], State(as_json="--json" in sys.argv[1:]))
        sys.exit(130)


def _open_standard_streams() -> None:
    """Open the null device in place of each standard stream that is closed.

    Otherwise a file of the command would get its number, and what libraries print would be written into that file.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", encoding="utf-8", closefd=False))
