"""Builds as real processes: started in a session of their own, ended in every way, and searched for what they leave."""

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
    """How a build ended."""

    code: int
    out: str
    errors: str


class Build:
    """`recipe build` of a recipe into `folder/out`, the cache in `folder/cache` unless the environment says so."""

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
        """Wait for it, and take away its two text files."""
        code = self.process.wait(timeout)
        out, errors = (path.read_text() for path in self._texts)
        for path in self._texts:
            path.unlink()
        return Ended(code, out, one_line_each(errors, warnings=False))

    def send(self, number: int, *, group: bool = False) -> None:
        """A signal to the build's process, or to all of its group as from a terminal; it may have ended."""
        with contextlib.suppress(ProcessLookupError):
            (os.killpg if group else os.kill)(self.process.pid, number)

    def kill_a_child(self) -> bool:
        """Kill a worker, else the simulation, as soon as there is one; False if the build ends without."""
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
    """The living processes of a session."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            fields = (entry / "stat").read_text().rpartition(") ")[2].split()
            if int(entry.name) and int(fields[3]) == leader and fields[0] not in "ZX":
                found.append(int(entry.name))
    return sorted(found)


def gone(leader: int, within: float = 5.0) -> bool:
    """Whether every process of a session ends within so many seconds."""
    deadline = time.monotonic() + within
    while session(leader):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def scraps(root: Path) -> list[str]:
    """Files that were being written when their process ended."""
    return sorted(str(p.relative_to(root)) for p in root.rglob("*.tmp"))


def named_files(root: Path) -> Iterator[tuple[str, bytes]]:
    """Every file below a folder that stands under its own name, with its bytes."""
    for path in sorted(root.rglob("*")):
        if path.is_file() and not path.name.endswith(".tmp"):
            yield path.relative_to(root).as_posix(), path.read_bytes()


def _command(process: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/cmdline").read_text()
    return ""
