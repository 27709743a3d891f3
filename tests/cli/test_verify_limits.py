"""A dataset's folder may be anyone's: what its plan asks for is admitted like a recipe's, before anything is made."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from recipe_cli.commands.verify import _check_cost
from recipe_compiler.ir.errors import InputError
from recipe_compiler.lowering.workload import plan_cost
from recipe_runtime.build.pipeline import build
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes

PLAN = fakes.dataset_plan(frames=2, weathers=1)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    return build(PLAN, root / "tiny", workers=0, cache=root / "cache", engines=fakes.ENGINES).path


def test_a_plan_over_the_limits_is_refused_unless_allowed(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recipe_compiler.limits.FRAME_LIMIT", 1)
    with pytest.raises(InputError, match="frames are over 1") as caught:
        _check_cost(datasets.read(built).plan, "tiny", False)
    assert "--allow-large" in str(caught.value)
    _check_cost(datasets.read(built).plan, "tiny", True)


def test_a_plan_of_hours_costs_hours() -> None:
    """As the attacker wrote it: long, with large pictures, and no frame of it in the manifest."""
    (long,) = fakes.dataset_plan(frames=60_000, weathers=1).variants[:1]
    assert plan_cost(PLAN).over() == []
    assert plan_cost(PLAN.model_copy(update={"variants": (long,)})).over() != []


def test_nothing_is_simulated_where_frames_have_no_digest(built: Path) -> None:
    held = datasets.read(built)
    frames = dict(list(held.lock.frames.items())[1:])
    engines = replace(fakes.ENGINES, simulate=lambda scene: pytest.fail("it was simulated"))
    lock = replace(held.lock, frames=frames)
    report = verify(held.plan, lock, Options(nonce=1, workers=0), lambda *_: None, dataset=held, engines=engines)
    assert (report.verdict, report.stage, report.bound.checked) == ("FAIL", "lockfile", 0)
