"""The self-test finds the first stage that differs, states a possible reason, and confirms a host that agrees."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import pytest
from click.testing import CliRunner
from recipe_cli.commands.doctor import command
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.verify import self_test
from recipe_runtime.verify.locking import lock

from tests.runtime.fakes import ENGINES, dataset_plan, quiet

PLAN = dataset_plan(frames=3, weathers=1)


@pytest.fixture
def golden(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Golden digests of the fake engines, in place of the shipped ones."""
    made = build(PLAN, tmp_path / "made", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    files = {"x.yaml": "a" * 64}
    lock(PLAN, "x.yaml", files, workers=0, progress=quiet, engines=ENGINES).write(tmp_path / "golden.lock")
    rows = self_test.file_rows(made.manifest["files"])
    (tmp_path / "golden.files").write_text("".join(f"{v}  {p}\n" for p, v in rows.items()))
    monkeypatch.setattr(self_test, "LOCK", tmp_path / "golden.lock")
    monkeypatch.setattr(self_test, "FILES", tmp_path / "golden.files")
    return tmp_path


def _states() -> dict[str, str]:
    return {check.stage: check.state for check in self_test.self_test(PLAN, quiet, engines=ENGINES)}


def _frame(modality: str) -> Callable[[Lockfile], dict[str, Any]]:
    def change(held: Lockfile) -> dict[str, Any]:
        row = next(k for k in held.frames if k[2] == modality)
        return {"frames": {**held.frames, row: "0" * 64}}

    return change


CHANGES: dict[str, Callable[[Lockfile], dict[str, Any]]] = {
    "plan": lambda held: {"plan": "0" * 64},
    "trace": lambda held: {"traces": dict.fromkeys(held.traces, "0" * 64)},
    "observation": _frame("depth"),
    "labels": _frame("labels"),
    "shading": _frame("rgb"),
}


@pytest.mark.slow
def test_equal_stages_are_reported(golden: Path) -> None:
    assert set(_states().values()) == {"equal"}


@pytest.mark.slow
@pytest.mark.parametrize("stage", CHANGES)
def test_the_first_stage_that_differs_is_named(golden: Path, stage: str) -> None:
    held = lockfile.read(golden / "golden.lock")
    replace(held, **CHANGES[stage](held)).write(golden / "golden.lock")
    states = _states()
    order = list(self_test.STAGES)
    at = order.index(stage)
    assert [states[s] for s in order[:at]] == ["equal"] * at
    assert states[stage] == "differs"
    assert {states[s] for s in order[at + 1 :]} == {"not reached"}


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "stage"), [("rgb/000001.png", "encoding"), ("kwcoco.json", "annotate")])
def test_a_differing_file_belongs_to_its_stage(golden: Path, ending: str, stage: str) -> None:
    lines = (golden / "golden.files").read_text().splitlines()
    lines = [("0" * 64 + line[64:]) if line.endswith(ending) else line for line in lines]
    (golden / "golden.files").write_text("\n".join(lines) + "\n")
    assert _states()[stage] == "differs"


@pytest.mark.slow
def test_another_tool_version_is_a_possible_reason(golden: Path) -> None:
    held = lockfile.read(golden / "golden.lock")
    changed = replace(held, **CHANGES["shading"](held), tools={**held.tools, "warp-lang": "0.1"})
    changed.write(golden / "golden.lock")
    found = self_test.Examination(self_test.fingerprint([]), self_test.self_test(PLAN, quiet, engines=ENGINES))
    assert found.healthy
    assert found.tiers["A"].startswith("not promised here: ")
    assert "warp-lang 0.1" in found.tiers["A"]


@pytest.mark.slow
def test_a_host_that_cannot_run_a_stage_gets_the_reason(golden: Path) -> None:
    def barred(scene: ScenePlan) -> NoReturn:
        raise RunError("there is no PyBullet here")

    checks = self_test.self_test(PLAN, quiet, engines=replace(ENGINES, simulate=barred))
    assert {(c.state, c.reason) for c in checks} == {("not reached", "there is no PyBullet here")}
    found = self_test.Examination(self_test.fingerprint([]), checks)
    assert (found.tiers["A"], found.healthy) == ("no", False)


@pytest.mark.parametrize("options", [[], ["--json"]])
@pytest.mark.parametrize(("state", "code"), [("equal", 0), ("differs", 1), ("not reached", 1), ("may differ", 0)])
def test_the_exit_code_is_1_without_tier_a(
    monkeypatch: pytest.MonkeyPatch, options: list[str], state: Any, code: int
) -> None:
    """Regression: on a host without PyBullet the report said `tier A: no`, but the exit code was 0."""
    host = self_test.fingerprint([])
    found = self_test.Examination(host, [self_test.Check(stage, state, "a reason") for stage in self_test.STAGES])
    monkeypatch.setattr(self_test, "examine", lambda progress: found)
    completed = CliRunner().invoke(command, options)
    assert completed.exit_code == code, completed.output
    denied = '"A": "no"' if options else "tier A: no\n"
    assert (denied in completed.output) == (code == 1)


def test_the_fingerprint_names_no_host_user_or_place() -> None:
    completed = json.dumps(self_test.fingerprint(["cuda:0"]))
    for private in (socket.gethostname(), str(Path.home()), str(Path.cwd()), os.environ.get("USER", "\0")):
        assert len(private) < 3 or private not in completed


@pytest.mark.slow
def test_this_host_reproduces_the_shipped_digests() -> None:
    found = self_test.examine(quiet, gpus=[])
    assert [(c.stage, c.state, c.reason) for c in found.checks] == [(s, "equal", "") for s in self_test.STAGES]
    assert found.tiers == {"A": "yes", "B": "no CUDA GPU here"}
