"""Statements have the form that in-toto's tools read, and are about the files of one identity only."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core.files import file_sha256
from recipe_runtime.dataset import reader
from recipe_runtime.lifecycle import attestation
from recipe_runtime.verify.verdict import Difference, Report
from recipe_runtime.verify.verify import Options, verify

from tests.cli.runner import run_here
from tests.runtime import fakes
from tests.runtime.fakes import quiet

PLAN = fakes.dataset_plan(frames=4, weathers=2)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    options = BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES)
    return build(PLAN, root / "tiny", options).path


@pytest.fixture(scope="module")
def report(built: Path) -> Report:
    held = reader.read(built)
    return verify(
        held.plan, held.lock, Options(nonce=7, count=5, workers=0), quiet, dataset=held, engines=fakes.ENGINES
    )


def document(report: Report, path: Path) -> Path:
    path.write_text(json.dumps([report.document()]))
    return path


def stated(built: Path, report: Report, folder: Path) -> dict[str, Any]:
    target = attestation.Target(built)
    file = document(report, folder / "report.json")
    return attestation.test_result(target, attestation.read_report(file, target.lock.identity))


def check_with_in_toto(statement: dict[str, Any], module: str, name: str) -> None:
    """Parse a statement and its predicate with in-toto's definitions, which refuse unknown fields."""
    pytest.importorskip("in_toto_attestation", reason="in-toto's definitions are optional")
    from google.protobuf import json_format  # type: ignore[import-untyped,unused-ignore]

    statement_pb2 = import_module("in_toto_attestation.v1.statement_pb2")
    parsed = json_format.ParseDict(statement, statement_pb2.Statement())
    import_module("in_toto_attestation.v1.statement").Statement.copy_from_pb(parsed).validate()
    kind = getattr(import_module(f"in_toto_attestation.predicates.{module}"), name)
    json_format.ParseDict(statement["predicate"], kind())


def test_a_verification_states_its_sample_and_bound(built: Path, report: Report, tmp_path: Path) -> None:
    statement = stated(built, report, tmp_path)
    (subject,) = statement["subject"]
    assert subject["name"] == "manifest.json"
    assert subject["digest"] == {"sha256": file_sha256(built / "manifest.json")}
    predicate = statement["predicate"]
    assert (predicate["result"], predicate["failedTests"], predicate["warnedTests"]) == ("PASSED", [], [])
    assert predicate["passedTests"][-1] == "file"
    sample = predicate["configuration"][0]["annotations"]
    assert (sample["nonce"], sample["checked"], sample["total"]) == (7, 5, report.bound.total)
    assert sample["differing_below"] == pytest.approx(report.bound.differing, abs=1e-6)
    check_with_in_toto(statement, "test_result.v0.test_result_pb2", "TestResult")


@pytest.mark.parametrize(
    ("differences", "result", "warned", "failed"),
    [
        ([Difference("shading", "a frame")], "FAILED", [], ["shading"]),
        ([Difference("shading", "a frame", excuse="another CPU")], "WARNED", ["shading"], []),
        (
            [Difference("shading", "a", excuse="another CPU"), Difference("encoding", "b")],
            "FAILED",
            ["shading"],
            ["encoding"],
        ),
    ],
)
def test_the_stages_before_the_first_difference_pass(
    built: Path,
    report: Report,
    tmp_path: Path,
    differences: list[Difference],
    result: str,
    warned: list[str],
    failed: list[str],
) -> None:
    predicate = stated(built, replace(report, differences=differences), tmp_path)["predicate"]
    assert (predicate["result"], predicate["warnedTests"], predicate["failedTests"]) == (result, warned, failed)
    assert predicate["passedTests"] == ["lockfile", "recipe", "plan", "trace", "observation", "labels"]


def test_a_lockfile_is_a_subject_too(built: Path, report: Report, tmp_path: Path) -> None:
    held = reader.read(built)
    path = tmp_path / "tiny.lock"
    replace(held.lock, source="tiny.yaml", files={"tiny.yaml": "a" * 64}).write(path)
    target = attestation.Target(path)
    assert target.subjects[0]["digest"] == {"sha256": file_sha256(path)}
    with pytest.raises(InputError, match="contains its recipe"):
        attestation.provenance(target, "urn:x")


def test_a_report_of_another_dataset_is_refused(built: Path, report: Report, tmp_path: Path) -> None:
    file = document(replace(report, identity="other@sha256:" + "0" * 64), tmp_path / "report.json")
    done = run_here("attest", built, "--report", file, cwd=tmp_path)
    assert done.returncode == 2 and "other@sha256" in done.stderr


@pytest.mark.parametrize("body", ["{}", "[", '[{"identity": 3}]', "[[[[[[", ""])
def test_a_damaged_report_is_refused(built: Path, tmp_path: Path, body: str) -> None:
    (tmp_path / "report.json").write_text(body)
    done = run_here("attest", built, "--report", "report.json", "-o", "out.json", cwd=tmp_path)
    assert done.returncode == 2 and "not a report" in done.stderr
    assert not (tmp_path / "out.json").exists()


@pytest.mark.slow
def test_a_build_states_its_recipe_plans_and_tools(tmp_path: Path) -> None:
    (tmp_path / "r.yaml").write_text(
        "recipe: r\nseed: 1\nbase:\n  clock: {fps: 10, frames: 1}\n  town: {name: plaza}\n  weather: ClearNoon\n"
        "  sensors:\n    s: {mount: {z: 2}, camera: {width: 64, height: 48}, capture: [rgb]}\n"
    )
    assert run_here("build", "r.yaml", "-o", "ds", cwd=tmp_path).returncode == 0
    assert run_here("attest", "ds", "--builder", "https://a.example/ci", "-o", "p.json", cwd=tmp_path).returncode == 0
    statement = json.loads((tmp_path / "p.json").read_text())
    held = reader.read(tmp_path / "ds")
    predicate = statement["predicate"]
    pack, *plans = predicate["buildDefinition"]["resolvedDependencies"]
    assert pack == {"name": "r.recipe", "digest": {"sha256": file_sha256(tmp_path / "ds" / "r.recipe")}}
    assert [plan["digest"]["sha256"] for plan in plans] == list(held.plan_digests.values())
    builder = predicate["runDetails"]["builder"]
    assert builder["id"] == "https://a.example/ci" and builder["version"]["numpy"] == held.lock.tools["numpy"]
    assert os.fspath(tmp_path) not in json.dumps(statement)
    check_with_in_toto(statement, "provenance.v1.provenance_pb2", "Provenance")
    again = run_here("attest", "ds", "-o", "p.json", cwd=tmp_path)
    assert again.returncode == 2 and "exists already" in again.stderr
    assert run_here("attest", "ds", "--builder", "me", cwd=tmp_path).returncode == 2
