"""Findings of fuzzing stay fixed, and every target accepts its seeds."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.targets import TARGETS

FINDINGS = sorted((Path(__file__).parent / "findings").iterdir())


@pytest.mark.parametrize("path", FINDINGS, ids=lambda path: path.name)
def test_findings_are_refused(path: Path) -> None:
    TARGETS[path.name.partition("-")[0]].feed(path.read_bytes())


@pytest.mark.parametrize("name", TARGETS)
def test_seeds_and_truncated_seeds_are_no_findings(name: str) -> None:
    seeds = list(TARGETS[name].seeds())
    assert seeds
    for seed in seeds:
        for cut in (len(seed), len(seed) // 2, 1, 0):
            TARGETS[name].feed(seed[:cut])
