"""A plan is refused before it is built or locked if the reader of its dataset would refuse it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset import plan_reader
from recipe_runtime.dataset.plan_checks import MAX_BOXES, MAX_POINTS_IN_ALL, MAX_POSES
from recipe_runtime.dataset.plan_reader import PlanReader, check_readable
from recipe_runtime.verify.locking import lock

from tests.runtime import fakes

PLAN = fakes.dataset_plan(frames=2)
BODIES = [pretty(variant.document()).encode() for variant in PLAN.variants]


def read(plan: DatasetPlan) -> PlanReader:
    reader = PlanReader()
    for variant in plan.variants:
        reader.read(pretty(variant.document()).encode())
    return reader


def test_plans_are_as_large_as_the_check_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check counts shared parts once, and must not be far from the bytes that the reader counts."""
    size = sum(map(len, BODIES))
    monkeypatch.setattr(plan_reader, "MAX_BYTES", size - 1)
    with pytest.raises(InputError, match="bytes together"):
        check_readable(PLAN)
    with pytest.raises(ValueError, match=f"together more than {size - 1:,} bytes"):
        read(PLAN)
    monkeypatch.setattr(plan_reader, "MAX_BYTES", size + 400 * len(BODIES))
    check_readable(PLAN)
    read(PLAN)


def test_a_single_plan_has_a_limit_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_reader, "MAX_PLAN_BYTES", len(BODIES[0]) - 1)
    with pytest.raises(InputError, match="the plan of weather=w0,jitter=still has over"):
        check_readable(PLAN)
    with pytest.raises(ValueError, match="a plan of more than"):
        read(PLAN)


def test_an_unreadable_plan_is_neither_built_nor_locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was built, and then no command could read the dataset."""
    monkeypatch.setattr(plan_reader, "MAX_BYTES", 1000)
    with pytest.raises(InputError, match="bytes together"):
        build(PLAN, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=fakes.ENGINES))
    assert not (tmp_path / "tiny").exists()
    with pytest.raises(InputError, match="bytes together"):
        lock(PLAN, "tiny.yaml", {}, workers=0, progress=lambda *_: None, engines=fakes.ENGINES)


BOX = {"x": 0, "y": 0, "z": 0, "yaw": 0, "size": [1, 1, 1]}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda raw: raw["rig"]["sensors"][0].update(poses=raw["rig"]["sensors"][0]["poses"] * (MAX_POSES + 1)),
            "300,000 poses of sensors",
        ),
        (
            lambda raw: raw["scene"]["actors"][0].update(route=[{"x": 0, "y": 0}] * (MAX_POINTS_IN_ALL + 1)),
            "300,000 points of routes",
        ),
        (
            lambda raw: raw["scene"]["actors"][0].update(
                pauses=[{"waypoint": 0, "seconds": 1}] * (MAX_POINTS_IN_ALL + 1)
            ),
            "300,000 points of routes",
        ),
        (
            lambda raw: raw["rig"]["sensors"][0].update(arm={"decay": 0, "obstacles": [BOX] * (MAX_BOXES + 1)}),
            "250,000 boxes that shorten arms",
        ),
    ],
)
def test_totals_are_limited_before_they_become_objects(change: Callable[[Any], None], words: str) -> None:
    """A pose has 40 bytes in a plan and 600 in memory."""
    raw = json.loads(BODIES[0])
    change(raw)
    with pytest.raises(ValueError, match=f"more than {words}"):
        PlanReader().read(json.dumps(raw).encode())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda raw: raw["rig"]["sensors"][0]["poses"][0].pop("roll"), "missing required"),
        (lambda raw: raw["scene"]["clock"].update(frames="2"), "Expected `int`"),
        (lambda raw: raw["scene"]["clock"].update(more=2), "unknown field"),
    ],
)
def test_a_plan_in_another_form_than_the_compiler_writes_is_refused(change: Callable[[Any], None], words: str) -> None:
    """Regression: 1,000 camera responses `{}` in each of 10,000 variants, 1.5 MB of archive, took 9 GB of memory."""
    raw = json.loads(BODIES[0])
    PlanReader().read(json.dumps(raw).encode())
    change(raw)
    with pytest.raises(ValueError, match=words):
        PlanReader().read(json.dumps(raw).encode())
