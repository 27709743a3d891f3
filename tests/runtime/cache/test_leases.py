"""Readers of the cache hold a lease: entries that a lock, verification, shot or scenario reads are not pruned."""

from __future__ import annotations

import gc
import os
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_runtime.cache import pruning
from recipe_runtime.cache.store import MARKER, create_cache_folder
from recipe_runtime.frames.engines import Engines, SceneRenderer
from recipe_runtime.frames.shot import shot
from recipe_runtime.scenario import Scenario, Scenes
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verify import Options, verify

from tests.runtime.fakes import ENGINES, dataset_plan

PLAN = dataset_plan(frames=4, weathers=1)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("RECIPE_KERNEL_CACHE", str(tmp_path / "user"))  # (the user's own cache is not pruned)
    create_cache_folder(tmp_path / "cache")
    create_cache_folder(tmp_path / "user")
    return tmp_path / "cache"


def held() -> bool:
    """Return whether both cache folders are in use."""
    found = set()
    for root in pruning.folders():
        with (root / MARKER).open("r+b") as marker:
            found.add(not pruning._lock_alone(marker.fileno()))
    assert len(pruning.folders()) == 2 and len(found) == 1
    return found.pop()


def _lock(engines: Engines) -> None:
    lock(PLAN, "tiny.yaml", {}, workers=0, progress=lambda *_: None, engines=engines)


def _verify(engines: Engines) -> None:
    made = lock(PLAN, "tiny.yaml", {}, workers=0, progress=lambda *_: None, engines=ENGINES)
    assert not held()
    verify(PLAN, made, Options(nonce=1, count=2, workers=0), lambda *_: None, engines=engines)


def _shot(engines: Engines) -> None:
    shot(PLAN.variants[0], engines=engines)


@pytest.mark.parametrize("work", [_lock, _verify, _shot])
def test_a_lease_lasts_as_long_as_the_command_reads(work: Callable[[Engines], None]) -> None:
    asked: list[bool] = []

    def renderer(scene: ScenePlan, device: str) -> SceneRenderer:
        asked.append(held())
        return ENGINES.renderer(scene, device)

    work(replace(ENGINES, renderer=renderer))
    assert asked and all(asked)
    assert not held()


def scenario(plan: DatasetPlan = PLAN) -> Scenario:
    return Scenario(plan.variants[0], Scenes("cpu", ENGINES))


@pytest.mark.slow
def test_the_lease_of_a_scenario_ends_when_it_is_closed_or_collected() -> None:
    street = scenario()
    assert not held()  # nothing has been read yet
    street.render(0)
    assert held()
    trace = [e.path for e in pruning.entries(pruning.folders()) if e.kind == "traces"]
    assert trace and pruning.auto_prune(pruning.folders(), 0) == []
    street.close()
    assert not held()
    street.render(1)  # it can still be used
    assert held()
    del street
    gc.collect()
    assert not held()
    with scenario() as other:
        other.labels(0)
        assert held()
    assert not held()


def test_two_scenarios_have_separate_leases() -> None:
    first, second = scenario(), scenario()
    first.render(0)
    second.render(0)
    first.close()
    assert held()
    second.close()
    assert not held()


def test_an_unpickled_scenario_has_a_lease_in_its_process() -> None:
    """This is the case in workers of a `DataLoader` that are started with `spawn`."""
    street = scenario()
    street.render(0)
    sent = pickle.loads(pickle.dumps(street))
    street.close()
    assert not held()
    sent.render(0)
    assert held()


def test_a_forked_process_has_a_lease_of_its_own_and_keeps_its_parents() -> None:
    street = scenario()
    street.render(0)
    child = os.fork()
    if child == 0:  # as in a worker of a `DataLoader`
        code = 1
        try:
            street.render(1)
            street.close()
            code = 0 if held() else 2  # by the parent
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert held()
    street.close()
    assert not held()
