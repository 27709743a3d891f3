"""The bytes of a build depend only on the plan: not on workers, order, shards, interruptions, place or time."""

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NoReturn, cast

import numpy as np
import pytest
from PIL import Image
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import DatasetPlan, RigPlan
from recipe_runtime.build import local, worker, workspace
from recipe_runtime.build import pipeline as build_module
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.core import files
from recipe_runtime.dataset.schedule import SHARD_FRAMES, Shard, all_shards
from recipe_runtime.frames.engines import Engines
from recipe_runtime.modalities import declared, pixel_digest
from recipe_runtime.verify import locking

from tests.runtime.fakes import BROKEN, DYING, ENGINES, NOTED, UNLOADABLE, dataset_plan, sensor_plan, simulate, tree
from tests.runtime.frame_source import FrameSource

ROOT = Path(__file__).parents[3]
PLAN = dataset_plan(frames=8)  # the broken renderers fail at frame 7


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    """Return the dataset that all others are compared with."""
    folder = tmp_path_factory.mktemp("made")
    return build(PLAN, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES))


def again(
    folder: Path,
    plan: DatasetPlan | None = None,
    engines: Engines = ENGINES,
    *,
    workers: int,
    shard_frames: int = SHARD_FRAMES,
) -> BuildResult:
    return build(
        plan or PLAN,
        folder / "tiny",
        BuildOptions(
            workers=workers,
            cache=folder / "cache",
            engines=engines,
            shard_frames=shard_frames,
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "size"), [(2, 2), (0, 100)])
def test_workers_and_shards_change_no_byte(made: BuildResult, tmp_path: Path, workers: int, size: int) -> None:
    result = again(tmp_path, workers=workers, shard_frames=size)
    assert tree(result.path) == tree(made.path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cache", "tiny"]


@pytest.mark.slow
def test_order_changes_no_byte(made: BuildResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shards = all_shards(PLAN, 2)
    random.Random(4).shuffle(shards)
    monkeypatch.setattr(build_module, "all_shards", lambda *_: shards)
    assert tree(again(tmp_path, workers=0).path) == tree(made.path)


def test_no_file_contains_a_path_of_the_host(made: BuildResult) -> None:
    for path, body in tree(made.path).items():
        assert str(made.path.parent).encode() not in body, path


def test_files_hold_the_same_frames_as_single_renderings(made: BuildResult) -> None:
    for variant in PLAN.variants:
        frames = made.manifest["variants"][variant.variant]["frames"]
        for number in (7, 0, 4):
            source = FrameSource(variant, simulate(variant.scene), engines=ENGINES)
            arrays = source.render("street", number)
            folder = made.path / variant.variant / "street"
            for modality, array in arrays.items():
                (path,) = folder.glob(f"{modality}/{number:06d}.*")
                shown = declared(modality).files[path.suffix[1:]].store(array)
                if shown.dtype == np.uint16 and shown.ndim == 3:  # Pillow reads the upper 8 bits
                    shown = shown.astype(np.uint16) >> 8
                stored = np.load(path) if path.suffix == ".npy" else np.asarray(Image.open(path))
                assert np.array_equal(stored, shown)
                assert frames["street"][modality][number] == pixel_digest(modality, array)


def test_the_manifest_lists_every_file_with_its_size_and_digest(made: BuildResult) -> None:
    rows = {**made.manifest["files"], **made.manifest["pictures"]}
    files = tree(made.path)
    manifest = json.loads(files.pop("manifest.json"))
    assert manifest == made.manifest
    assert {p: {"size": len(b), "sha256": hashlib.sha256(b).hexdigest()} for p, b in files.items()} == rows
    assert all(path.startswith("preview/") for path in made.manifest["pictures"])


def test_equal_labels_are_one_file(made: BuildResult) -> None:
    one, other = (made.path / f"weather={w},jitter=still" for w in ("w0", "w1"))
    for modality in ("depth", "instance", "semantic"):
        assert (one / "street" / modality / "000003.png").samefile(other / "street" / modality / "000003.png")
    assert not (one / "street/rgb/000003.png").samefile(other / "street/rgb/000003.png")
    shaky = made.path / "weather=w0,jitter=shaky"
    assert (one / "side/rgb/000003.png").samefile(shaky / "side/rgb/000003.png")  # the side camera does not shake
    assert not (one / "street/depth/000002.png").samefile(shaky / "street/depth/000002.png")
    assert (one / "tracks.csv").samefile(shaky / "tracks.csv")


@pytest.mark.slow
def test_without_hard_links_the_bytes_are_the_same(
    made: BuildResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_links(*_: object) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    result = again(tmp_path, workers=0)
    assert tree(result.path) == tree(made.path)
    assert {p.stat().st_nlink for p in result.path.rglob("*.png")} == {1}


@pytest.mark.slow
def test_only_a_damaged_dataset_is_built_again(made: BuildResult, tmp_path: Path) -> None:
    def never(*_: object) -> NoReturn:
        raise AssertionError("an engine was used")

    first = again(tmp_path, workers=0)
    stamp = (first.path / "manifest.json").stat().st_mtime_ns
    second = again(tmp_path, engines=Engines(never, never, never), workers=0)
    assert (second.built, second.identity, second.manifest) == (False, first.identity, first.manifest)
    assert (first.path / "manifest.json").stat().st_mtime_ns == stamp
    (first.path / "weather=w0,jitter=still/street/rgb/000003.png").write_bytes(b"short")
    assert again(tmp_path, workers=0).built
    assert tree(first.path) == tree(made.path)


BUILD_SLOWLY = """
from pathlib import Path
from recipe_runtime.build.pipeline import BuildOptions, build
from tests.runtime.fakes import SLOW, dataset_plan
folder = Path({folder!r})
options = BuildOptions(cache=folder / "cache", engines=SLOW, workers=2, shard_frames=2)
build(dataset_plan(frames=8), folder / "tiny", options)
"""


def slow_build(folder: Path) -> tuple[subprocess.Popen[bytes], list[Path]]:
    """Return the process of an unfinished build that has completed three shards, and its children."""
    code = BUILD_SLOWLY.format(folder=str(folder))
    with (folder / "stderr").open("wb") as errors:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}  # workers import the fakes
        process = subprocess.Popen([sys.executable, "-c", code], cwd=folder, stderr=errors, env=environment)
    deadline = time.monotonic() + 30
    while len(list(folder.glob("cache/shards/*/[0-9a-f]*"))) < 3 + 1:  # and the list of them; without temporary files
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert len(children) >= 2
    return process, [Path("/proc") / child for child in children]


def all_ended(processes: list[Path]) -> bool:
    """Return whether all have ended within 1.5 s; zombies count as ended."""
    deadline = time.monotonic() + 1.5
    while time.monotonic() < deadline:
        if all(not p.exists() or ") Z " in (p / "stat").read_text() for p in processes):
            return True
        time.sleep(0.02)
    return False


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_build_leaves_no_orphan_and_is_resumed(
    made: BuildResult, tmp_path: Path, how: signal.Signals
) -> None:
    process, children = slow_build(tmp_path)
    process.send_signal(how)
    process.wait(5)
    assert all_ended(children)
    assert "Spawn" not in (tmp_path / "stderr").read_text()  # no worker prints anything
    assert not (tmp_path / "tiny").exists()
    result = again(tmp_path, workers=0, shard_frames=2)
    assert 3 <= result.resumed < result.shards
    assert tree(result.path) == tree(made.path)


def stopped(folder: Path) -> Path:
    """Return the workspace of a build that failed at frame 7."""
    with pytest.raises(RunError):
        again(folder, engines=BROKEN, workers=0, shard_frames=2)
    return folder / ".tiny.partial"


@pytest.mark.slow
def test_a_resumed_build_renders_lost_and_damaged_files_again(made: BuildResult, tmp_path: Path) -> None:
    """After a power failure, a file can have the right size and wrong bytes."""
    partial = stopped(tmp_path)
    (partial / "dataset/weather=w0,jitter=still/street/rgb/000000.png").unlink()
    depth = partial / "dataset/weather=w0,jitter=still/street/depth/000002.png"
    depth.write_bytes(bytes(depth.stat().st_size))
    (partial / "dataset/weather=w0,jitter=still/street/rgb/.000009.png.4711.tmp").write_bytes(b"half a fi")
    result = again(tmp_path, workers=0, shard_frames=2)
    assert result.resumed == 1
    assert 0 < result.resumed_frames < result.made_frames and result.taken_frames == 0
    assert tree(result.path) == tree(made.path)


@pytest.mark.slow
def test_work_of_another_version_is_not_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped(tmp_path)
    monkeypatch.setattr(workspace, "builder_identity", lambda: "another")
    assert again(tmp_path, workers=0, shard_frames=2).resumed == 0


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 1])
def test_an_error_names_variant_sensor_and_frame(tmp_path: Path, workers: int) -> None:
    with pytest.raises(RunError) as caught:
        again(tmp_path, engines=BROKEN, workers=workers)
    assert str(caught.value) == "weather=w0,jitter=still, street, frame 7: ArithmeticError: the lamp went out"


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 1])
def test_a_scene_that_cannot_be_loaded_is_reported_with_its_first_frame(tmp_path: Path, workers: int) -> None:
    """Workers load the scene during simulation; their errors are reported too."""
    with pytest.raises(RunError) as caught:
        again(tmp_path, engines=UNLOADABLE, workers=workers)
    assert str(caught.value) == "weather=w0,jitter=still, street, frame 0: ArithmeticError: the scene has no ground"


def test_invalid_input_that_a_worker_finds_is_not_a_failure_of_the_host() -> None:
    """Exit code 1 means that datasets differ or the host failed; a plan with too many triangles is neither."""

    class Refusing:
        def do(self, shard: object, tick: object) -> None:
            raise InputError("too many triangles", help="use simpler meshes", code=Code.INPUT_LIMIT)

    class Pipe:
        def recv(self) -> object:
            return local._answer(cast("worker.Worker", Refusing()), cast("Shard", None), lambda count: None)

    pool = object.__new__(local.WorkerPool)
    with pytest.raises(InputError) as caught:
        pool._receive(cast("local.End", Pipe()), iter(()), lambda shard, records: None, lambda count: None)
    (problem,) = caught.value.problems
    assert (problem.help, problem.code) == ("use simpler meshes", Code.INPUT_LIMIT)


@pytest.mark.slow
def test_workers_load_the_scene_while_it_is_simulated(
    made: BuildResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes = tmp_path / "notes"
    monkeypatch.setenv("NOTES", str(notes))
    result = again(tmp_path, engines=NOTED, workers=2)
    lines = notes.read_text().splitlines()
    assert sorted(lines) == ["renderer", "renderer", "simulation begins", "simulation ends"]  # loaded once each
    assert lines.index("renderer") < lines.index("simulation ends")
    assert tree(result.path) == tree(made.path)


@pytest.mark.slow
def test_a_lost_worker_is_reported(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"weather=w0,jitter=still.*frames 5 to 7: a worker process was lost \(exit -9"):
        again(tmp_path, engines=DYING, workers=1)


@pytest.mark.slow
def test_a_lock_without_a_journal_does_not_promise_to_resume(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"a worker process was lost .* with fewer workers, try again$"):
        locking.lock(PLAN, "", {}, workers=1, progress=lambda *_: None, engines=DYING)


@pytest.mark.slow
def test_a_worker_lost_between_two_shards_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sending the next shard then fails with a broken pipe."""
    sends, sent = Connection.send, []

    def lose(pipe: Any, value: Any) -> None:
        sent.append(value)
        if len(sent) == 3:  # after the job and a shard
            raise BrokenPipeError(32, "Broken pipe")
        sends(pipe, value)

    monkeypatch.setattr(Connection, "send", lose)
    with pytest.raises(RunError, match=r"frames 5 to 7: a worker process was lost .* build again: what is done"):
        again(tmp_path, workers=1)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_an_interrupt_while_workers_start_is_silent(tmp_path: Path, delay: float) -> None:
    """As from a terminal, the whole process group gets the signal; workers must print nothing."""
    code = textwrap.indent(BUILD_SLOWLY.format(folder=str(tmp_path)), "    ")
    process = subprocess.Popen(
        [sys.executable, "-c", f"try:\n{code}\nexcept KeyboardInterrupt:\n    raise SystemExit(130)"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    while not children.read_text():
        assert process.poll() is None
        time.sleep(0.005)
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, b"")


@pytest.mark.slow
def test_after_a_full_disk_the_finished_work_is_resumed(
    made: BuildResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = 0

    def fill(path: Path, body: bytes) -> None:
        nonlocal written
        written += 1
        if written > 40:
            raise OSError(28, "No space left on device", str(path))
        files.write_atomic(path, body)

    with monkeypatch.context() as patched:
        patched.setattr(worker, "write_atomic", fill)
        with pytest.raises(RunError, match=r"frame \d+: cannot write \S+: No space left on device; free some space"):
            again(tmp_path, workers=0, shard_frames=2)
    result = again(tmp_path, workers=0, shard_frames=2)
    assert result.resumed > 0
    assert tree(result.path) == tree(made.path)


def test_variant_names_that_would_share_a_folder_are_refused(tmp_path: Path) -> None:
    plan = PLAN
    for names, message in (
        (("speed=1.5", "speed=1_5"), "would share the folder speed=1_5/"),
        (("a", "preview"), "would share the folder preview/"),
        (("a", "../b"), "cannot be a folder's name"),
    ):
        variants = tuple(v.model_copy(update={"variant": n}) for v, n in zip(plan.variants, names, strict=False))
        with pytest.raises(InputError, match=message):
            again(tmp_path, plan.model_copy(update={"variants": variants}), workers=0)


def test_a_dataset_with_labels_only(tmp_path: Path) -> None:
    plan = dataset_plan(forms={"depth": "npy"}, annotations=())
    rig = RigPlan(sensors=(sensor_plan(capture=("depth",)),))
    variant = plan.variants[0].model_copy(update={"rig": rig})
    result = again(tmp_path, plan.model_copy(update={"variants": (variant,)}), workers=0)
    metres = np.load(result.path / "weather=w0,jitter=still/street/depth/000003.npy")
    assert np.array_equal(
        metres, FrameSource(variant, simulate(variant.scene), engines=ENGINES).render("street", 3)["depth"]
    )
    assert not (result.path / "annotations").exists()


@pytest.mark.slow
def test_progress_ends_at_the_total_and_seconds_are_counted_by_stage(tmp_path: Path) -> None:
    events: dict[str, list[tuple[int, int]]] = {}
    result = build(
        PLAN,
        tmp_path / "tiny",
        BuildOptions(
            workers=1,
            cache=tmp_path / "cache",
            engines=ENGINES,
            progress=lambda stage, done, total: events.setdefault(stage, []).append((done, total)),
        ),
    )
    assert list(events) == ["simulate", "render", "annotate", "finish"]
    for steps in events.values():
        assert [done for done, _ in steps] == sorted(done for done, _ in steps)
        assert steps[-1][0] == steps[-1][1] > 0
    assert events["render"][-1] == (64, 64)
    assert {"simulate", "observe", "shade", "encode", "annotate", "hash", "write"} <= result.seconds.keys()
