"""A plan is refused before it is built or locked if the reader of its dataset would refuse it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import build
from recipe_runtime.dataset import plan_reader
from recipe_runtime.dataset.plan_reader import PlanReader, check_readable
from recipe_runtime.verify.locking import lock

from tests.runtime import fakes

GOLDEN = Path(__file__).parents[2] / "golden/tiny.yaml"
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


# `check_bounds` counts the poses of sensors
@pytest.mark.parametrize("what", sorted(plan_reader._MAX_NUMBERS.keys() - {"poses of sensors"}))
def test_what_the_reader_counts_is_counted_before_the_build(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both count distinct parts, so they refuse at the same number."""
    plan = compile_recipe(GOLDEN).plan
    reader = read(plan)
    number = reader._numbers[what]
    assert number
    monkeypatch.setitem(plan_reader._MAX_NUMBERS, what, number)
    check_readable(plan)
    monkeypatch.setitem(plan_reader._MAX_NUMBERS, what, number - 1)
    with pytest.raises(InputError, match=what):
        check_readable(plan)
    with pytest.raises(ValueError, match=what):
        read(plan)


def test_an_unreadable_plan_is_neither_built_nor_locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was built, and then no command could read the dataset."""
    monkeypatch.setattr(plan_reader, "MAX_BYTES", 1000)
    with pytest.raises(InputError, match="bytes together"):
        build(PLAN, tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=fakes.ENGINES)
    assert not (tmp_path / "tiny").exists()
    with pytest.raises(InputError, match="bytes together"):
        lock(PLAN, "tiny.yaml", {}, workers=0, progress=lambda *_: None, engines=fakes.ENGINES)


def test_fields_with_defaults_do_not_hide_objects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 1,000 camera responses `{}` in each of 10,000 variants, 1.5 MB of archive, took 9 GB of memory."""
    raw = json.loads(BODIES[0])
    raw["appearance"]["responses"] |= {f"s{number}": {} for number in range(900)}
    body = json.dumps(raw).encode()
    PlanReader().read(body)
    monkeypatch.setitem(plan_reader._MAX_NUMBERS, plan_reader._OBJECTS, 900)
    PlanReader().read(BODIES[0])
    with pytest.raises(ValueError, match=r"objects of towns, scenes, rigs and appearances are over 900"):
        PlanReader().read(body)


def test_the_slots_of_a_body_are_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 276,000 bodies of 64 slots, 239 MB of plans, took 2.9 GB of memory."""
    raw = json.loads(BODIES[0])
    slots = {f"s{number}": "#000000" for number in range(60)}
    raw["appearance"]["looks"] = {f"b{number}": slots for number in range(60)}
    monkeypatch.setitem(plan_reader._MAX_NUMBERS, plan_reader._SLOTS_OF_LOOKS, 100)
    PlanReader().read(json.dumps(raw).encode())
    raw["appearance"]["looks"]["b0"] = slots | {"s0": "#000001"}
    with pytest.raises(ValueError, match="120 slots of distinct colours are over 100"):
        PlanReader().read(json.dumps(raw).encode())


def test_sensors_that_variants_share_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 10,000 variants that share 250 sensors with bent lenses took three minutes to refuse."""
    monkeypatch.setitem(plan_reader._MAX_NUMBERS, plan_reader._SENSORS, 1)
    reader = PlanReader()
    raw = json.loads(BODIES[0])
    raw["rig"]["sensors"] = raw["rig"]["sensors"][:1]
    reader.read(json.dumps(raw).encode())
    with pytest.raises(ValueError, match="2 sensors of variants are over 1"):
        reader.read(json.dumps({**raw, "variant": "another"}).encode())
