"""Statements about a dataset in the form of in-toto: how it was built, and what a verification found.

A statement is a JSON document of in-toto's attestation framework, version 1: subjects with their digests, and a
predicate. The predicates are SLSA Provenance v1 and Test Result v0.1, which stock tools know. Statements are not
signed; docs/dataset.md shows how to sign them.

The subjects are files whose digests anyone can compute: the dataset's manifest, which has the SHA-256 of every other
file, or a lockfile, which has a digest of every frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

from recipe_compiler.ir import lockfile
from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.lockfile import Lockfile

from recipe_runtime.core import layout
from recipe_runtime.core.documents import Meta, Whole, decode
from recipe_runtime.core.files import file_sha256
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.verify.verdict import ORDER, Verdict

STATEMENT = "https://in-toto.io/Statement/v1"
PROVENANCE = "https://slsa.dev/provenance/v1"
TEST_RESULT = "https://in-toto.io/attestation/test-result/v0.1"
BUILD = "urn:dataset-recipe:build:v1"
"""The type of the build: `recipe build` of a pack, whose plan and tools determine every byte."""

_RESULTS: dict[Verdict, str] = {"PASS": "PASSED", "INCONCLUSIVE": "WARNED", "FAIL": "FAILED"}
_MAX_REPORT_BYTES = 64 << 20

Statement = dict[str, Any]


class _Difference(TypedDict):
    stage: Annotated[str, Meta(max_length=40)]
    message: Annotated[str, Meta(max_length=10_000)]
    excuse: Annotated[str, Meta(max_length=10_000)] | None


class VerifiedReport(TypedDict):
    """The part of a report of `recipe verify --json` that a statement is made of."""

    identity: Annotated[str, Meta(max_length=400)]
    verdict: Literal["PASS", "FAIL", "INCONCLUSIVE"]
    nonce: Annotated[int, Meta(ge=0, lt=2**53)]
    checked: Whole
    total: Whole
    confidence: Annotated[float, Meta(ge=0, le=1)]
    differing_below: Annotated[float, Meta(ge=0, le=1)] | None
    differences: Annotated[list[_Difference], Meta(max_length=1_000_000)]


class Target:
    """What statements are about: a dataset's folder, or a lockfile.

    Attributes:
        subjects: In-toto's descriptors of the files.
        lock: The digests of plans, traces and frames.
        dataset: The dataset; None for a lockfile.
    """

    def __init__(self, path: Path) -> None:
        """Read a dataset's folder or a lockfile.

        Raises:
            InputError: it is neither.
        """
        self.dataset: Dataset | None = None
        if path.is_dir():
            self.dataset = read(path)
            self.lock: Lockfile = self.dataset.lock
            file, name = path / layout.MANIFEST, layout.MANIFEST
        else:
            self.lock = lockfile.read(path)
            file, name = path, path.name
        annotations = {"identity": self.lock.identity, "plan": self.lock.plan}
        self.subjects = [{"name": name, "digest": {"sha256": file_sha256(file)}, "annotations": annotations}]


def provenance(target: Target, builder: str) -> Statement:
    """Return a statement in the form of SLSA Provenance v1: how a dataset was built.

    Args:
        target: A dataset that contains its recipe's pack.
        builder: A URI that names the host or the service that built it. The statement proves no more of it than the
            signature does.

    Raises:
        InputError: the target is a lockfile, or a dataset without its recipe.
    """
    dataset = target.dataset
    if dataset is None or dataset.recipe_file is None:
        raise InputError(
            "how a dataset was built is stated of a dataset that contains its recipe",
            help="name the folder that `recipe build RECIPE` wrote, or state a verification",
        )
    pack = {"name": dataset.recipe_file, "digest": {"sha256": dataset.files[dataset.recipe_file][1]}}
    plans = [{"name": f"plan of {name}", "digest": {"sha256": d}} for name, d in sorted(dataset.plan_digests.items())]
    internal = {"outputs": list(dataset.plan.outputs), "plan": dataset.plan.digest, "stages": dict(target.lock.stages)}
    definition = {
        "buildType": BUILD,
        "externalParameters": {"recipe": pack},
        "internalParameters": internal,
        "resolvedDependencies": [pack, *plans],
    }
    details = {"builder": {"id": builder, "version": dict(sorted(target.lock.tools.items()))}}
    return _statement(target, PROVENANCE, {"buildDefinition": definition, "runDetails": details})


def test_result(target: Target, report: VerifiedReport) -> Statement:
    """Return a statement in the form of Test Result v0.1: what a verification found.

    The tests are the stages of the pipeline, up to the first that differs: what follows it was not compared. The sample
    and the bound that it proves are the configuration.

    Raises:
        InputError: the report is of another dataset.
    """
    if report["identity"] != target.lock.identity:
        raise InputError(
            f"the report is of {report['identity']}, and the target is {target.lock.identity}",
            help="verify this target again, and keep the report",
        )
    excused = {d["stage"] for d in report["differences"]}
    failed = {d["stage"] for d in report["differences"] if d["excuse"] is None}
    first = min((ORDER.index(stage) for stage in excused if stage in ORDER), default=len(ORDER))
    sample = {key: report[key] for key in ("nonce", "checked", "total", "confidence", "differing_below")}
    predicate = {
        "result": _RESULTS[report["verdict"]],
        "configuration": [
            {"name": "sample", "annotations": sample},
            {"name": "plan", "digest": {"sha256": target.lock.plan}},
        ],
        "passedTests": list(ORDER[:first]),
        "warnedTests": sorted(excused - failed),
        "failedTests": sorted(failed),
    }
    return _statement(target, TEST_RESULT, predicate)


def read_report(path: Path, identity: str) -> VerifiedReport:
    """Read the report of one identity from a file that `recipe verify --json` wrote.

    Raises:
        InputError: it is no such file, or has no report of this identity.
    """
    try:
        reports: Sequence[VerifiedReport] = decode(read_regular(path, _MAX_REPORT_BYTES), list[VerifiedReport])
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} is not a report of a verification: {error}",
            help="write one with `recipe verify`, as JSON",
        ) from None
    found = [report for report in reports if report["identity"] == identity]
    if not found:
        known = ", ".join(report["identity"][:100] for report in reports[:3]) or "nothing"
        raise InputError(f"{path} reports on {known}, and not on {identity}", help="verify this target, and report it")
    return found[-1]


def _statement(target: Target, kind: str, predicate: Mapping[str, object]) -> Statement:
    return {"_type": STATEMENT, "subject": target.subjects, "predicateType": kind, "predicate": dict(predicate)}
