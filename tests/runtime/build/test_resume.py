"""`lock` and `verify --all` resume an interrupted run, and `lock` reuses the dataset that was built."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import CameraPlan, ScenePlan
from recipe_runtime.build import known_frames as known_frames_module
from recipe_runtime.build import reuse
from recipe_runtime.build.known_frames import Known, known_frames
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import host
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.frames.engines import Engines
from recipe_runtime.verify import verify
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options

from tests.runtime.fakes import BROKEN, ENGINES, Renderer, Seen, appearance_plan, dataset_plan, quiet, simulate, tree

PLAN = dataset_plan(frames=8)
FRAMES = 4 * 2 * 8  # variants, sensors, frames of each
STOPPED = 5 * 2  # the broken renderer fails in the second shard of the first view, which two variants share
PICTURE = "weather=w0,jitter=still/street/rgb/000003.png"


def counting(frames: list[float]) -> Engines:
    """Return engines that record the times of observed frames, in this process only."""

    class Counted(Renderer):
        def observe(
            self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
        ) -> Seen:
            frames.append(0.0)
            return super().observe(camera, world_from_sensor, parts)

    return replace(ENGINES, renderer=lambda scene, device: Counted(scene))


@pytest.fixture(scope="module")
def fresh() -> Lockfile:
    return lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=ENGINES)


def relock(cache: Path, engines: Engines = ENGINES) -> tuple[Lockfile, Known]:
    known = known_frames(PLAN, cache)
    made = lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=engines, known=known)
    return made, known


@pytest.fixture
def built(tmp_path: Path) -> Path:
    return build(PLAN, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)).path


@pytest.mark.slow
def test_a_lock_after_a_build_renders_nothing(fresh: Lockfile, built: Path, tmp_path: Path) -> None:
    seen: list[float] = []
    made, known = relock(tmp_path / "cache", counting(seen))
    assert made == fresh and made.dumps() == fresh.dumps()
    assert (seen, known.taken_frames, known.resumed_frames) == ([], FRAMES, 0)


@pytest.mark.slow
def test_frames_without_a_valid_dataset_file_are_rendered(fresh: Lockfile, built: Path, tmp_path: Path) -> None:
    picture = built / PICTURE
    picture.write_bytes(bytes(picture.stat().st_size))
    (built / "weather=w0,jitter=shaky/street/depth/000004.png").unlink()
    seen: list[float] = []
    made, known = relock(tmp_path / "cache", counting(seen))
    assert made == fresh
    assert len(seen) == 2
    assert known.taken_frames == FRAMES - 2 * 2  # a frame is reused for all variants of its view or for none


@pytest.mark.slow
@pytest.mark.parametrize("how", ["another cache", "changed manifest", "other code", "gone"])
def test_only_a_dataset_built_on_this_host_is_reused(
    fresh: Lockfile, built: Path, tmp_path: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Manifests are untrusted: one is accepted if this host's cache has its digest."""
    cache = tmp_path / "cache"
    if how == "another cache":
        cache = tmp_path / "other"
    elif how == "changed manifest":
        value = fresh.frames[next(iter(fresh.frames))]
        manifest = built / "manifest.json"
        manifest.write_text(manifest.read_text().replace(value, "0" * 64))
    elif how == "other code":
        monkeypatch.setattr(reuse, "builder_identity", lambda: "another")
    else:
        shutil.rmtree(built)
    made, known = relock(cache)
    assert known.taken_frames == 0
    assert made == fresh


@pytest.mark.slow
def test_a_dataset_with_another_motion_is_not_reused(built: Path, tmp_path: Path) -> None:
    def other(scene: ScenePlan) -> Trace:
        trace = simulate(scene)
        return replace(trace, positions=trace.positions + 1)

    engines = replace(ENGINES, simulate=other)
    made, known = relock(tmp_path / "cache", engines)
    assert known.taken_frames == 0
    assert made == lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=engines)


def stopped_lock(cache: Path) -> Path:
    """Return the journal of a lock that failed in its second shard, with one record."""
    with pytest.raises(RunError, match="frame 7"):
        relock(cache, BROKEN)
    (record,) = (path for path in cache.glob("shards/??/*") if b"\n[" in path.read_bytes())  # not their list
    return record


def test_a_dataset_whose_plans_were_exchanged_is_not_reused(tmp_path: Path) -> None:
    """The plans decide whose frames the pictures are; with the plan of a new weather, those of the old one were it."""
    first = dataset_plan(frames=3, weathers=1).variants[0]
    old, new = (
        dataset_plan(variants=(first.model_copy(update={"variant": "v", "appearance": appearance_plan(clouds)}),))
        for clouds in (0.0, 50.0)
    )
    build(old, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    plan = tmp_path / "tiny/plans/v.json"
    plan.unlink()
    plan.write_text(pretty(new.variants[0].document()))
    made = build(new, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    assert made.taken_frames == 0
    assert made.identity == lock(new, "tiny.yaml", {}, workers=0, progress=quiet, engines=ENGINES).identity


def test_a_failed_lock_is_resumed_and_removes_its_journal(fresh: Lockfile, tmp_path: Path) -> None:
    stopped_lock(tmp_path)
    seen: list[float] = []
    made, known = relock(tmp_path, counting(seen))
    assert made == fresh and made.dumps() == fresh.dumps()
    assert (known.resumed_frames, len(seen)) == (STOPPED, 3 * 8 - 5)
    assert known.kept_frames() == FRAMES  # writing the lockfile may still fail
    known.close()
    assert not list(tmp_path.glob("shards/??/*"))


@pytest.mark.slow
@pytest.mark.parametrize("how", ["edited", "cut off", "other code", "other plan"])
def test_a_journal_of_another_run_is_not_used(
    fresh: Lockfile, tmp_path: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = stopped_lock(tmp_path)
    if how == "edited":
        record.write_bytes(record.read_bytes().replace(b'"rgb": {', b'"rgb": {"x": "y", '))
    elif how == "cut off":
        record.write_bytes(record.read_bytes()[:-20])
    elif how == "other code":
        monkeypatch.setattr(known_frames_module, "builder_identity", lambda: "another")
    plan = dataset_plan(frames=8, weathers=1) if how == "other plan" else PLAN
    known = known_frames(plan, tmp_path)
    made = lock(plan, "tiny.yaml", {}, workers=0, progress=quiet, engines=ENGINES, known=known)
    assert known.resumed_frames == 0
    if plan is PLAN:
        assert made == fresh


def test_an_unwritable_cache_is_not_an_error(fresh: Lockfile, tmp_path: Path) -> None:
    (tmp_path / "shards").write_text("in the way")
    assert relock(tmp_path)[0] == fresh


LOCK_SLOWLY = """
from pathlib import Path
from recipe_runtime.build.known_frames import known_frames
from recipe_runtime.verify.locking import lock
from tests.runtime.fakes import SLOW, dataset_plan
plan = dataset_plan(frames=8)
known = known_frames(plan, Path({cache!r}))
lock(plan, "", {{}}, workers=1, progress=lambda *_: None, engines=SLOW, known=known)
"""
VERIFY_SLOWLY = """
from pathlib import Path
from recipe_compiler.ir.lockfile import read
from recipe_runtime.verify.verify import Options, verify
from tests.runtime.fakes import SLOW, dataset_plan
options = Options(1, everything=True, cache=Path({cache!r}))
verify(dataset_plan(frames=8), read(Path({lock!r})), options, lambda *_: None, engines=SLOW)
"""


def stop(code: str, cache: Path, how: signal.Signals) -> None:
    """Run code in a process, and stop it after a completed shard."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with (cache.parent / "stderr").open("wb") as errors:
        process = subprocess.Popen([sys.executable, "-c", code], cwd=cache.parent, stderr=errors, env=environment)
    deadline = time.monotonic() + 60
    while not list(cache.glob("shards/??/*")):
        assert process.poll() is None and time.monotonic() < deadline, (cache.parent / "stderr").read_text()
        time.sleep(0.02)
    process.send_signal(how)
    process.wait(10)


@pytest.mark.slow
def test_a_killed_lock_is_resumed(fresh: Lockfile, tmp_path: Path) -> None:
    stop(LOCK_SLOWLY.format(cache=str(tmp_path / "cache")), tmp_path / "cache", signal.SIGKILL)
    made, known = relock(tmp_path / "cache")
    assert STOPPED <= known.resumed_frames < FRAMES
    assert replace(made, source="tiny.yaml") == fresh


def check(lockfile: Lockfile, cache: Path, engines: Engines = ENGINES, **more: Any) -> Report:
    options = Options(nonce=1, everything=more.pop("everything", True), workers=0, cache=cache)
    return verify.verify(PLAN, lockfile, options, quiet, engines=engines, **more)


@pytest.mark.slow
def test_an_interrupted_verification_is_resumed(fresh: Lockfile, tmp_path: Path) -> None:
    fresh.write(tmp_path / "tiny.lock")
    cache = tmp_path / "cache"
    stop(VERIFY_SLOWLY.format(cache=str(cache), lock=str(tmp_path / "tiny.lock")), cache, signal.SIGINT)
    report = check(fresh, cache)
    assert report.verdict == "PASS"
    assert STOPPED <= report.resumed < FRAMES
    assert f"{report.resumed} were rendered by the run that was stopped" in report.extent
    assert report.document()["resumed_frames"] == report.resumed
    assert not list(cache.glob("shards/??/*"))


def stopped_verification(lockfile: Lockfile, cache: Path, **more: Any) -> None:
    with pytest.raises(RunError, match="frame 7"):
        check(lockfile, cache, BROKEN, **more)
    assert list(cache.glob("shards/??/*"))


def test_a_resumed_verification_detects_differences(fresh: Lockfile, tmp_path: Path) -> None:
    """This includes a frame that the stopped run had rendered."""
    stopped_verification(fresh, tmp_path)
    row = next(key for key in fresh.frames if key[1:] == ("street", "rgb", 2))
    report = check(replace(fresh, frames={**fresh.frames, row: "0" * 64}), tmp_path)
    assert report.resumed == STOPPED
    assert [d.frame for d in report.differences if d.stage == "shading"] == [2]


def _other_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify, "devices", lambda device: ("cpu", "cpu"))


def _other_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "host_identity", lambda: ["elsewhere"])


def _other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify, "builder_identity", lambda: "another")


@pytest.mark.slow
@pytest.mark.parametrize("change", [_other_device, _other_host, _other_code])
def test_a_verification_resumes_only_work_of_this_host_code_and_device(
    fresh: Lockfile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[pytest.MonkeyPatch], None]
) -> None:
    stopped_verification(fresh, tmp_path)
    change(monkeypatch)
    report = check(fresh, tmp_path)
    assert (report.verdict, report.resumed) == ("PASS", 0)


def test_a_sampled_verification_does_not_use_the_journal(fresh: Lockfile, tmp_path: Path) -> None:
    stopped_verification(fresh, tmp_path)
    assert check(fresh, tmp_path, everything=False).resumed == 0


def test_verify_does_not_use_the_journal_of_lock(fresh: Lockfile, tmp_path: Path) -> None:
    stopped_lock(tmp_path)
    assert check(fresh, tmp_path).resumed == 0


@pytest.mark.slow
def test_a_resumed_verification_of_a_dataset_reads_the_files_again(
    fresh: Lockfile, built: Path, tmp_path: Path
) -> None:
    """The stopped run kept no files, so the dataset's files must have the recorded digests."""
    cache, held = tmp_path / "cache", datasets.read(built)
    stopped_verification(fresh, cache, dataset=held)
    assert check(fresh, cache, dataset=held).resumed == STOPPED
    stopped_verification(fresh, cache, dataset=held)
    before = tree(built)[PICTURE]
    (built / PICTURE).write_bytes(before[:-1] + b"\0")
    report = check(fresh, cache, dataset=held)
    assert report.resumed == 0
    assert {d.path for d in report.differences} == {PICTURE}
