"""A build that needs more memory than the host has is refused before any work, and `plan` shows its memory."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from recipe_cli import diagnostics
from recipe_cli.main import recipe as cli
from recipe_compiler.estimate import TooLargeError
from recipe_runtime.core import host

from tests.compiler.kitchen import small


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(json.dumps(small()))
    return path


def _run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, list(map(str, arguments)), standalone_mode=False)


@pytest.mark.parametrize("command", ["plan", "build", "lock"])
def test_too_little_memory_is_an_error_before_any_work(
    path: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(host, "total_memory", lambda: 300 << 20)
    error = _run(command, path).exception
    assert isinstance(error, TooLargeError)  # exit code 2
    assert "over the 300 MiB of this host" in str(error)
    assert [diagnostics.remedy(problem) for problem in error.problems] == [
        "ask for fewer frames or variants, or give --allow-large"
    ]
    assert [found.name for found in path.parent.iterdir()] == ["tiny.yaml"]


def test_check_warns_and_allow_large_permits_the_build(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "process_memory_limit", lambda: 100 << 20)
    checked = _run("check", path)
    assert checked.exception is None
    assert "of memory a process are over the 100 MiB" in checked.output
    assert _run("plan", "--allow-large", path).exception is None


def test_plan_shows_memory(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "total_memory", lambda: 64 << 30)
    assert "this host has 64.0 GiB" in _run("plan", path).output
    document = json.loads(_run("plan", "--json", path).output)
    cost, memory = document["cost"], document["memory"]
    assert memory["host"] == 64 << 30
    used = min(memory["workers"], cost["frames"])  # on a host with many cores, some workers have no frame to render
    assert memory["needed"] == cost["main_memory"] + used * cost["worker_memory"]
