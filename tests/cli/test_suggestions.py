"""Errors for wrong command lines and paths are plain and suggest what to write instead."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from recipe_cli import suggestions
from recipe_compiler.schema import template

from tests.cli.runner import run_here


def _error(folder: Path, *arguments: str) -> list[str]:
    """Return what a command prints on standard error; its exit code must be 2."""
    done = run_here(*arguments, cwd=folder)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    return done.stderr.splitlines()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Return a folder with a recipe and with placeholders for its dataset and lockfile."""
    (tmp_path / "mine.yaml").write_text(template("mine"))
    (tmp_path / "datasets/town").mkdir(parents=True)
    (tmp_path / "datasets/town/manifest.json").write_text("{}")
    (tmp_path / "lockfiles").mkdir()
    (tmp_path / "lockfiles/rain.lock").write_text("")
    return tmp_path


@pytest.mark.parametrize(
    ("missing", "nearest"),
    [
        ("mine", "mine.yaml"),
        ("town", "datasets/town"),
        ("dataset/town", "datasets/town"),
        ("datasets/twon", "datasets/town"),
        ("rain", "lockfiles/rain.lock"),
        ("rain.lock", "lockfiles/rain.lock"),
        ("zebra", None),
        ("zebra/town", "datasets/town"),
    ],
)
def test_the_nearest_path_is_found(
    project: Path, monkeypatch: pytest.MonkeyPatch, missing: str, nearest: str | None
) -> None:
    monkeypatch.chdir(project)
    assert suggestions.nearest_place(Path(missing)) == nearest


def test_a_missing_target_of_verify_gets_a_suggestion(project: Path) -> None:
    assert _error(project, "verify", "dataset/town")[1] == "help: did you mean datasets/town?"
    assert _error(project, "verify", "s3:/bucket/x")[1] == "help: did you mean s3://bucket/x?"
    assert _error(project, "export", "datasets/twon", "out")[1] == "help: did you mean datasets/town?"
    assert _error(project, "verify", "datasets")[1] == "help: did you mean datasets/town?"


def test_a_url_with_one_slash_is_refused(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: the dataset was built into a folder named `s3:`."""
    message, help = _error(project, "build", "mine.yaml", "-o", "s3:/bucket/x")
    assert (message.partition(": ")[2], help) == (
        "s3:/bucket/x: there is no folder of that name",
        "help: did you mean s3://bucket/x?",
    )
    assert not (project / "s3:").exists()
    (project / "s3:").mkdir()  # an existing folder of this name may be used
    monkeypatch.chdir(project)
    assert suggestions.url_with_one_slash("s3:/bucket/x") is None
    assert suggestions.url_with_one_slash("/tmp/s3:/x") is None


@pytest.mark.parametrize(
    ("arguments", "message", "help"),
    [
        (("shot", "mine.yaml", "--frame", "two"), "invalid value for '--frame': 'two' is not a whole number", "see `"),
        (("build", "mine.yaml", "--workers", "0"), "invalid value for '--workers': 0 is not from 1 to 256", "see `"),
        (("verify", "--confidence", "95"), "'--confidence': 95.0 is not from 0.5 to 0.9999", "see `"),
        (("verify", "--bound", "nan"), "invalid value for '--bound': nan is not a number", "see `"),
        (("verify", "--against", "mine.yaml"), "'mine.yaml' is a file, not a folder", "see `"),
        (("pack", "mine.yaml", "-o", "datasets"), "'datasets' is a folder", "see `"),
        (("export", "datasets/town", "a", "-o", "b"), "OUT and --output are both given", "see `"),
        (("verify", "mine.yaml", "--all", "--frames", "3"), "--all checks every frame", "give one of the two"),
        (("shot", "plaza"), "plaza: there is no such file", "add --map to draw the town"),
        (("check", "datasets"), "datasets: is a folder", "name a recipe file"),
        (("shot", "mine.yaml", "-o", ""), "'-o' / '--output' / '--out': it is empty", "give a path, or . for"),
        (("import",), "missing argument 'FORMAT'. Choose from: carla", "see `recipe import"),
    ],
)
def test_wrong_usage_is_reported_in_plain_words(
    project: Path, arguments: tuple[str, ...], message: str, help: str
) -> None:
    first, second = _error(project, *arguments)
    assert message in first and second.startswith(f"help: {help}"), (first, second)


@pytest.mark.slow
@pytest.mark.parametrize("as_json", [False, True])
def test_ctrl_c_while_modules_are_imported_prints_no_traceback(project: Path, as_json: bool) -> None:
    """The signal is sent while click is imported, before the command's error handling is active."""
    program = (
        "import sys, os, signal\n"
        "class Stop:\n"
        "    def find_spec(self, name, *rest):\n"
        "        if name == 'click':\n"
        "            sys.meta_path.remove(self); os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Stop())\n"
        "from recipe_cli.entry import main\n"
        "main()\n"
    )
    options = ["--json"] if as_json else []
    done = subprocess.run(
        [sys.executable, "-c", program, "check", "mine.yaml", *options], cwd=project, capture_output=True, text=True
    )
    assert done.returncode == 130 and "Traceback" not in done.stderr, done.stderr
    assert ('"code": "interrupted"' in done.stdout) == as_json
    assert ("error[interrupted]: interrupted" in done.stderr) != as_json
