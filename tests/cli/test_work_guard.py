"""A command whose real work far exceeds its estimate ends with an error, whatever it does, and keeps what is done."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import NoReturn

import pytest
from recipe_cli import work_guard
from recipe_cli.commands import build
from recipe_cli.work_guard import within_estimate
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.errors import Code, InputError
from recipe_compiler.ir.plan import ScenePlan
from recipe_compiler.limits import Cost
from recipe_compiler.lowering.workload import plan_cost
from recipe_runtime.build import local

from tests.cli.runner import run_here
from tests.cli.test_commands import RECIPE
from tests.runtime.fakes import ENGINES

pytestmark = pytest.mark.slow

LONG = 60.0  # seconds; a guard that does nothing fails its test after them
BURN = "import time\nwhile time.process_time() < 10: pass"
HOLD = f"body = bytearray(300 << 20); import time; time.sleep({LONG})"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(RECIPE)
    return path


@pytest.fixture
def cost(path: Path) -> Cost:
    """An estimate of little work."""
    return dataclasses.replace(plan_cost(compile_recipe(path).plan), minutes=0.0, main_memory=1, worker_memory=1)


@pytest.fixture
def strict(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow a second and 100 MiB beyond the estimate."""
    monkeypatch.setattr(work_guard, "SECONDS", 1.0)
    monkeypatch.setattr(work_guard, "MEMORY_BYTES", 100 << 20)


def _burn() -> None:
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        pass


def _endless_simulation(scene: ScenePlan) -> NoReturn:
    _burn()
    raise AssertionError("nothing stopped it")


def _hold() -> None:
    body = bytearray(300 << 20)
    time.sleep(LONG)
    del body


def _child(text: str) -> Callable[[], None]:
    return lambda: _run(text)


def _run(text: str) -> None:
    with subprocess.Popen([sys.executable, "-c", text]) as child:
        try:
            child.wait(LONG)
        finally:
            child.kill()
            child.wait()


def _grandchild() -> None:
    _run(f"import subprocess, sys; subprocess.run([sys.executable, '-c', {BURN!r}], timeout=10)")


@pytest.mark.usefixtures("strict")
@pytest.mark.parametrize("work", [_burn, _child(BURN), _grandchild], ids=["this process", "child", "grandchild"])
def test_processor_time_far_over_the_estimate_stops_the_work(cost: Cost, work: Callable[[], None]) -> None:
    too_much = pytest.raises(InputError, match="the work was stopped: it has taken")
    with too_much as raised, within_estimate("the work", cost, workers=1):
        work()
    assert [problem.code for problem in raised.value.problems] == [Code.SIZE_LIMIT]


@pytest.mark.usefixtures("strict")
@pytest.mark.parametrize("work", [_hold, _child(HOLD)], ids=["this process", "child"])
def test_memory_far_over_the_estimate_stops_the_work(cost: Cost, work: Callable[[], None]) -> None:
    too_much = pytest.raises(InputError, match="MiB of memory, far more than the estimate")
    with too_much, within_estimate("the work", cost, workers=1):
        work()


@pytest.mark.usefixtures("strict")
def test_work_within_its_estimate_is_not_stopped(cost: Cost) -> None:
    with within_estimate("the work", dataclasses.replace(cost, minutes=1.0, worker_memory=1 << 30), workers=1):
        _run("body = bytearray(300 << 20); import time\nwhile time.process_time() < 2: pass")


@pytest.mark.usefixtures("strict")
def test_allow_large_measures_nothing(cost: Cost) -> None:
    with within_estimate("the work", cost, workers=1, allow_large=True):
        _run("import time\nwhile time.process_time() < 2: pass")


@pytest.mark.usefixtures("strict")
def test_an_error_in_place_of_the_interrupt_is_recognized(cost: Cost) -> None:
    with pytest.raises(InputError, match="the work was stopped"), within_estimate("the work", cost, workers=1):
        try:
            _burn()
        except KeyboardInterrupt:
            raise ValueError("a serializer failed") from None


@pytest.mark.usefixtures("strict")
def test_an_interrupt_that_the_work_ignores_is_repeated(cost: Cost, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_guard, "_AGAIN", 0.2)
    with pytest.raises(InputError, match="the work was stopped"), within_estimate("the work", cost, workers=1):
        with suppress(KeyboardInterrupt):
            _burn()
        _burn()


def test_a_child_that_ends_while_it_is_measured_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error in the thread would end the guard, with a traceback on the terminal."""

    def ended(read: Callable[[object], object]) -> Callable[[object], object]:
        def listing(path: object = ".") -> object:
            if str(path).startswith(f"/proc/{child.pid}/"):
                raise FileNotFoundError(str(path))
            return read(path)

        return listing

    with subprocess.Popen([sys.executable, "-c", HOLD]) as child:
        with monkeypatch.context() as patch:
            for name in ("listdir", "scandir"):
                patch.setattr(os, name, ended(getattr(os, name)))
            assert work_guard._processor_seconds() > 0 and work_guard._memory_bytes() > 0
        child.kill()


@pytest.mark.usefixtures("strict")
def test_each_worker_may_load_the_scenes_again(cost: Cost) -> None:
    """With 14 workers, a build of one large town took ten times its estimate."""
    loading = dataclasses.replace(cost, frames=100, minutes_to_load=0.1, minutes_to_load_shards=1.0)
    with within_estimate("the work", loading, workers=4):
        _run("import time\nwhile time.process_time() < 3: pass")


def test_interrupts_and_errors_of_the_work_are_not_changed(cost: Cost) -> None:
    for kind in (KeyboardInterrupt, ValueError, SystemExit):
        with pytest.raises(kind), within_estimate("the work", cost, workers=1):
            raise kind


def test_a_late_signal_does_nothing(cost: Cost) -> None:
    with within_estimate("the work", cost, workers=1):
        pass
    signal.raise_signal(signal.SIGXCPU)


def test_a_stopped_build_says_so_and_continues_with_allow_large(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The build stops after its first shard; exit code 2, no dataset, and the next build resumes."""
    folder = path.parent
    monkeypatch.setattr(build, "engines_for", lambda compiled: ENGINES)

    def endless(job, shards, workers, done, tick):  # type: ignore[no-untyped-def]
        local.run(job, shards[:1], 0, done, tick)
        monkeypatch.setattr(work_guard, "TIMES", -1000)  # as if the estimate were far exceeded
        _burn()

    with monkeypatch.context() as patch:
        patch.setattr(build, "_runner", lambda ray: nullcontext(endless))
        stopped = run_here("build", path, cwd=folder, RECIPE_CACHE=str(folder / "cache"))
    assert stopped.returncode == 2
    assert "error[size-limit]: the build was stopped: it has taken" in stopped.stderr
    assert "--allow-large" in stopped.stderr
    assert not (folder / "datasets" / "small").exists()
    again = run_here("build", path, "--allow-large", cwd=folder, RECIPE_CACHE=str(folder / "cache"))
    assert again.returncode == 0 and "resumed from the stopped build" in again.stdout


def test_a_build_that_writes_far_more_than_estimated_is_stopped(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = path.parent
    monkeypatch.setattr(build, "engines_for", lambda compiled: ENGINES)
    monkeypatch.setattr(build, "_runner", lambda ray: nullcontext(lambda *a: local.run(a[0], a[1], 0, a[3], a[4])))
    with monkeypatch.context() as patch:
        patch.setattr(work_guard, "DISK_TIMES", 0)
        patch.setattr(work_guard, "DISK_BYTES", 1 << 10)
        stopped = run_here("build", path, cwd=folder, RECIPE_CACHE=str(folder / "cache"))
    assert stopped.returncode == 2, stopped.stderr
    assert "error[size-limit]: the build was stopped: it writes" in stopped.stderr
    assert not (folder / "datasets" / "small").exists()
    again = run_here("build", path, "--allow-large", cwd=folder, RECIPE_CACHE=str(folder / "cache"))
    assert again.returncode == 0, again.stderr


@pytest.mark.parametrize("command", ["shot", "lock", "verify"])
def test_other_commands_that_render_are_stopped_too(path: Path, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cache = str(path.parent / "cache")
    if command == "verify":
        monkeypatch.setattr("recipe_cli.commands.lock.engines_for", lambda compiled: ENGINES)
        assert run_here("lock", path, cwd=path.parent, RECIPE_CACHE=cache).returncode == 0
    monkeypatch.setattr(
        f"recipe_cli.commands.{command}.engines_for",
        lambda *_: dataclasses.replace(ENGINES, simulate=_endless_simulation),
    )
    monkeypatch.setattr(work_guard, "TIMES", -1000)
    stopped = run_here(command, path, cwd=path.parent, RECIPE_CACHE=cache + "2")
    assert stopped.returncode == 2 and "error[size-limit]" in stopped.stderr, stopped.stderr
