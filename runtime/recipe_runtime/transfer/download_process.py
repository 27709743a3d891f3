"""Downloads a dataset in a child process, which is stopped if it needs too much memory or makes no progress.

A store is not trusted: its listing may never end, and a connection may send nothing, or one byte a second, for hours.
No library of a store limits its memory, and a thread that waits for a store cannot be stopped.

The child reads a JSON object with `url`, `root` and `memory` (bytes) from its standard input, and ends if that is
closed. It writes lines of JSON to its standard output: `{"beat": true}` for each listing and each MiB, lines
`{"progress": [stage, done, total]}`, and at the end `{"done": true}` or `{"problems": [...]}`.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import resource
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO

from recipe_compiler.ir.errors import Code, InputError, Problem, RecipeError, RunError

from recipe_runtime.core import subprocesses, urls
from recipe_runtime.core.interfaces import Progress

MAX_MEMORY = 1536 << 20  # bytes of data of the child process; manifest and listing of any dataset take less
MAX_PAUSE = 300.0  # seconds without progress: a MiB of a file, or one folder's listing

Download = Callable[[str, Path, Progress, Callable[[], None]], None]


def run(url: str, root: Path, progress: Progress) -> None:
    """Download the dataset at a URL into a folder.

    Raises:
        InputError: there is no dataset, its manifest is damaged, or its listing needs too much memory.
        RunError: the store or this host fails, or the store is too slow.
    """
    command = subprocesses.command("recipe_runtime.transfer.download_process", "main")
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        _converse(child, url, root, progress)
    finally:
        child.kill()
        child.wait()
        for pipe in (child.stdin, child.stdout):
            with contextlib.suppress(OSError):
                pipe.close()  # type: ignore[union-attr]


def _converse(child: subprocess.Popen[bytes], url: str, root: Path, progress: Progress) -> None:
    """Send the task, report progress, and raise the child's problems; RunError if it stops or pauses too long."""
    assert child.stdin is not None and child.stdout is not None
    shown = urls.shown(url)
    with contextlib.suppress(BrokenPipeError):
        child.stdin.write(json.dumps({"url": url, "root": str(root), "memory": MAX_MEMORY}).encode() + b"\n")
        child.stdin.flush()
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_forward, args=(child.stdout, lines), daemon=True).start()
    while True:
        try:
            line = lines.get(timeout=MAX_PAUSE)
        except queue.Empty:
            raise RunError(
                f"{shown}: no data arrived for {MAX_PAUSE:.0f} seconds; try again later", code=Code.REMOTE
            ) from None
        if not line:
            raise RunError(f"{shown}: the download ended without a result; try again", code=Code.REMOTE)
        answer = json.loads(line)
        if "progress" in answer:
            progress(*answer["progress"])
        elif "problems" in answer:
            problems = [Problem(message, help=help, code=Code(code)) for message, help, code in answer["problems"]]
            raise (InputError if answer["input"] else RunError)(problems)
        elif "done" in answer:
            return


def _forward(out: IO[bytes], lines: queue.SimpleQueue[bytes]) -> None:
    """Forward the child's lines, and an empty one at the end."""
    with contextlib.suppress(OSError, ValueError):
        for line in out:
            lines.put(line)
    lines.put(b"")


def main() -> None:
    """Entry point of the child: answers go to the original standard output, all other output to standard error."""
    from recipe_runtime.transfer.download import download

    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    task = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_DATA, (task["memory"], task["memory"]))
    _answer(answers, task["url"], Path(task["root"]), download)
    os._exit(0)  # a thread may still wait for the store


def _end_with_parent() -> None:
    """End this process when its standard input is closed."""
    sys.stdin.buffer.read()
    os._exit(1)


def _answer(answers: IO[bytes], url: str, root: Path, download: Download) -> None:
    """Download, and write the answers."""
    lock = threading.Lock()

    def say(**answer: object) -> None:
        with lock, contextlib.suppress(BrokenPipeError):
            answers.write(json.dumps(answer).encode() + b"\n")
            answers.flush()

    try:
        download(url, root, lambda *numbers: say(progress=numbers), lambda: say(beat=True))
    except RecipeError as error:
        rows = [(problem.message, problem.help or "", problem.code.value) for problem in error.problems]
        say(problems=rows, input=isinstance(error, InputError))
    except MemoryError:
        message = f"{urls.shown(url)}: its listing or its manifest takes more memory than that of any dataset"
        say(problems=[(message, "remove the other files from there", Code.REMOTE.value)], input=True)
    else:
        say(done=True)
