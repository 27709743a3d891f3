"""Standard streams that are closed or full: no traceback, and no output of a library in a file of the dataset."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CLOSED = ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"]
PROBE = """
import subprocess, sys
from recipe_cli.entry import _open_standard_streams
_open_standard_streams()
print("text", flush=True)
print("text", file=sys.stderr, flush=True)
done = subprocess.run([sys.executable, "-c", "import os; [os.fstat(number) for number in range(3)]"])
with open("result", "w") as file:
    print(file.fileno() > 2, done.returncode, file=file)
"""


def run(folder: Path, redirection: str, *command: str) -> subprocess.CompletedProcess[str]:
    shell = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, *command]
    environment = {**os.environ, "RECIPE_CACHE": str(folder / "cache")}
    return subprocess.run(shell, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)


@pytest.mark.slow
@pytest.mark.parametrize("redirection", CLOSED)
def test_no_file_gets_the_number_of_a_closed_stream(tmp_path: Path, redirection: str) -> None:
    """Otherwise what libraries print is written into a file of the dataset."""
    run(tmp_path, redirection, "-c", PROBE)
    assert (tmp_path / "result").read_text() == "True 0\n"


@pytest.mark.slow
@pytest.mark.parametrize("redirection", CLOSED)
def test_a_command_with_closed_streams_has_its_usual_exit_code(tmp_path: Path, redirection: str) -> None:
    for arguments, code in ((["cache"], 0), (["check", "none.yaml", "--json"], 2)):
        done = run(tmp_path, redirection, "-m", "recipe_cli", *arguments)
        assert done.returncode == code and "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("stream", ["full", "broken"])
@pytest.mark.parametrize("arguments", [["plan", "none.yaml"], ["plan", "none.yaml", "--json"]], ids=" ".join)
def test_errors_that_cannot_be_printed_leave_the_exit_code(tmp_path: Path, stream: str, arguments: list[str]) -> None:
    """Regression: with standard output closed by its reader, an error in JSON was two tracebacks."""
    if stream == "full":
        end = os.open("/dev/full", os.O_WRONLY)
    else:
        reader, end = os.pipe()
        os.close(reader)
    command = [sys.executable, "-m", "recipe_cli", *arguments]
    try:
        done = subprocess.run(command, cwd=tmp_path, stdout=end, stderr=subprocess.PIPE, text=True, timeout=60)
        assert done.returncode == 2 and "Traceback" not in done.stderr and "Exception ignored" not in done.stderr
        assert subprocess.run(command, cwd=tmp_path, stdout=end, stderr=end, timeout=60).returncode == 2
    finally:
        os.close(end)
