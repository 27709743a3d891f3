"""Builds as processes in a session of their own, which tests end in various ways and check for leftovers."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.cli.reading import one_line_each
from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"


@dataclass(frozen=True)
class Ended:
    """The result of a build."""

    code: int
    out: str
    errors: str


class Build:
    """A `recipe build` into `folder/out` with the cache in `folder/cache`, unless the environment sets another."""

    def __init__(self, folder: Path, *options: str, out: str = "out", recipe: Path = TINY, **environment: str) -> None:
        self._texts = [folder / f"{out}.stdout", folder / f"{out}.stderr"]
        command = [sys.executable, "-m", "recipe_cli", "build", str(recipe), "--out", str(folder / out)]
        with self._texts[0].open("wb") as stdout, self._texts[1].open("wb") as stderr:
            self.process = subprocess.Popen(
                [*command, "--workers", "2", *options],
                cwd=folder,
                env={**os.environ, "RECIPE_CACHE": str(folder / "cache"), **environment},
                stdout=stdout,
                stderr=stderr,
                start_new_session=True,
            )

    def end(self, timeout: float = 300.0) -> Ended:
        """Wait for the end, and remove the two files of its output."""
        code = self.process.wait(timeout)
        out, errors = (path.read_text() for path in self._texts)
        for path in self._texts:
            path.unlink()
        return Ended(code, out, one_line_each(errors, warnings=False))

    def send(self, number: int, *, group: bool = False) -> None:
        """Send a signal to the build's process or, as from a terminal, to its group; it may have ended."""
        with contextlib.suppress(ProcessLookupError):
            (os.killpg if group else os.kill)(self.process.pid, number)

    def kill_a_child(self) -> bool:
        """Kill a worker or the simulation as soon as there is one; return False if the build ends first."""
        while self.process.poll() is None:
            children = [p for p in session(self.process.pid) if p != self.process.pid]
            workers = [p for p in children if "recipe_runtime.build.local" in _command(p)] or children
            if workers:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(workers[0], signal.SIGKILL)
                return True
            time.sleep(0.005)
        return False


def session(leader: int) -> list[int]:
    """Return the running processes of a session."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            fields = (entry / "stat").read_text().rpartition(") ")[2].split()
            if int(entry.name) and int(fields[3]) == leader and fields[0] not in "ZX":
                found.append(int(entry.name))
    return sorted(found)


def gone(leader: int, within: float = 5.0) -> bool:
    """Return whether every process of a session ends within `within` seconds."""
    deadline = time.monotonic() + within
    while session(leader):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def scraps(root: Path) -> list[str]:
    """Return the temporary files that interrupted writes left."""
    return sorted(str(p.relative_to(root)) for p in root.rglob("*.tmp"))


def named_files(root: Path) -> Iterator[tuple[str, bytes]]:
    """Return the content of every file below a folder except temporary ones."""
    for path in sorted(root.rglob("*")):
        if path.is_file() and not path.name.endswith(".tmp"):
            yield path.relative_to(root).as_posix(), path.read_bytes()


def _command(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text()
    return ""
