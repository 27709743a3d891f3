"""A Ray cluster builds the same bytes, also after losing a worker or a node. `make test-ray`."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_runtime.annotate.records import FrameRecord
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.build.ray import JobInputs, RemoteWorker
from recipe_runtime.build.worker import Job, Worker
from recipe_runtime.core.versions import renderer_identity
from recipe_runtime.dataset.schedule import all_shards
from recipe_runtime.frames.engines import Engines
from recipe_runtime.loading import compiled, opened

from tests.runtime.fakes import BROKEN, DYING, ENGINES, SLOW, Renderer, actor_bodies, dataset_plan, simulate, tree
from tests.sources import ROOT

GOOD = ROOT / "tests" / "cases" / "good" / "assets"

pytestmark = pytest.mark.ray
ray = pytest.importorskip("ray")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Start a head node without CPUs and two worker nodes with one CPU each, on this host."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        roots = [ROOT, *(ROOT / name for name in ("cli", "compiler", "runtime"))]  # the fakes and the packages
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, roots)))
        patch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
        nodes.add_node(num_cpus=1)
        nodes.add_node(num_cpus=1)
        nodes.wait_for_nodes()
        yield nodes
        nodes.shutdown()


def _build(
    folder: Path, cluster: Any, engines: Engines | None = ENGINES, plan: DatasetPlan | None = None, **more: Any
) -> BuildResult:
    from recipe_runtime.build.ray import joined

    plan = plan or dataset_plan()
    with joined(cluster.address) as run:
        return build(plan, folder / "tiny", BuildOptions(cache=folder / "cache", engines=engines, run=run, **more))


def _built_locally(folder: Path, plan: DatasetPlan | None = None) -> dict[str, bytes]:
    plan = plan or dataset_plan()
    return tree(build(plan, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)).path)


def test_a_cluster_builds_the_same_bytes(cluster: Any, tmp_path: Path) -> None:
    made = _build(tmp_path / "cluster", cluster, workers=2, shard_frames=3)
    assert tree(made.path) == _built_locally(tmp_path / "here")
    assert made.seconds["observe"] > 0.0


def test_a_node_needs_no_file_of_this_host(tmp_path: Path) -> None:
    """A remote worker without access to the recipe's folder and the cache renders the same files."""
    shutil.copytree(GOOD, tmp_path / "recipe")
    plan, engines = opened(tmp_path / "recipe" / "recipe.yaml")
    job = Job(plan, engines, ("cpu",), tmp_path / "cache", tmp_path / "here")
    shard = all_shards(plan)[0]
    records, inputs = Worker(job).do(shard, lambda count: None), JobInputs.of(job)
    assert len(inputs.assets) == 4
    shutil.rmtree(tmp_path / "recipe")
    shutil.rmtree(tmp_path / "cache")
    worker = RemoteWorker(job, 0, inputs, renderer_identity())
    made = worker.do(shard)
    worker.leave()
    assert _portable(made.records) == _portable(records)
    rows = [row for record in records for row in record["files"].items()]
    assert {path: made.bodies[row[1]] for path, row in rows} == tree(tmp_path / "here")


def _portable(records: list[FrameRecord]) -> list[FrameRecord]:
    """Return records without file times and inodes, which differ between hosts."""
    return [{**record, "files": {path: row[:2] for path, row in record["files"].items()}} for record in records]


def test_a_node_of_another_release_is_refused(tmp_path: Path) -> None:
    job = Job(dataset_plan(), ENGINES, ("cpu",), tmp_path / "cache", None)
    with pytest.raises(RunError, match="runs another release"):
        RemoteWorker(job, 0, JobInputs.of(job), "0" * 64)


def _on_its_gpu(scene: ScenePlan, device: str) -> Renderer:
    """Create a renderer; the worker must have exactly one GPU, assigned by Ray."""
    assert device == "cuda:0" and ray.get_gpu_ids() == [int(os.environ["CUDA_VISIBLE_DEVICES"])]
    return Renderer(scene)


def test_a_worker_has_a_gpu_of_its_own(cluster: Any, tmp_path: Path) -> None:
    """A node that declares two GPUs runs two workers; a cluster without GPUs is refused."""
    engines = Engines(simulate, actor_bodies, _on_its_gpu)
    with pytest.raises(InputError, match="the Ray cluster has no GPU for a worker"):
        _build(tmp_path / "without", cluster, engines=engines, device="cuda")
    node = cluster.add_node(num_cpus=1, num_gpus=2)
    made = _build(tmp_path / "cluster", cluster, engines=engines, device="cuda", shard_frames=1, workers=2)
    cluster.remove_node(node)
    assert tree(made.path) == _built_locally(tmp_path / "here")
    with pytest.raises(InputError, match="every worker has a GPU of its own; say cuda"):
        _build(tmp_path / "one", cluster, engines=engines, device="cuda:1")


def test_real_engines_build_the_same_bytes(cluster: Any, tmp_path: Path) -> None:
    plan = compiled(ROOT / "tests" / "golden" / "tiny.yaml")
    made = _build(tmp_path / "cluster", cluster, engines=None, plan=plan, workers=2)
    here = build(plan, tmp_path / "here" / "tiny", BuildOptions(workers=1, cache=tmp_path / "here" / "cache"))
    assert tree(made.path) == tree(here.path)


def test_a_killed_worker_changes_no_byte(cluster: Any, tmp_path: Path) -> None:
    killed: list[int] = []

    def kill(stage: str, done: int, total: int) -> None:
        if stage == "render" and done > 0 and not killed:
            killed.append(_kill_one())

    made = _build(tmp_path / "cluster", cluster, engines=SLOW, workers=2, shard_frames=2, progress=kill)
    assert killed[0] > 0
    assert tree(made.path) == _built_locally(tmp_path / "here")


def test_a_lost_node_changes_no_byte(cluster: Any, tmp_path: Path) -> None:
    lost: list[object] = []

    def lose(stage: str, done: int, total: int) -> None:
        if stage == "render" and done > 0 and not lost:
            node = sorted(cluster.worker_nodes, key=lambda n: n.node_id)[0]
            lost.append(node)
            threading.Thread(target=lambda: cluster.remove_node(node, allow_graceful=False), daemon=True).start()
            time.sleep(1.0)

    made = _build(tmp_path / "cluster", cluster, engines=SLOW, workers=2, shard_frames=2, progress=lose)
    assert lost
    assert tree(made.path) == _built_locally(tmp_path / "here")
    cluster.add_node(num_cpus=1)


def _is_descendant(process: Path) -> bool:
    """Return whether a process descends from this one, and not from another cluster on this host."""
    while process.name not in ("0", "1", str(os.getpid())):
        process = process.parent / (process / "stat").read_text().rpartition(")")[2].split()[1]
    return process.name == str(os.getpid())


def _kill_one() -> int:
    """Kill one worker process, as the kernel does when memory runs out, and return its process ID."""
    for process in sorted(Path("/proc").glob("[0-9]*"), key=lambda p: int(p.name)):
        try:
            command = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if command.startswith(b"ray::RemoteWorker") and _is_descendant(process):
            os.kill(int(process.name), signal.SIGKILL)
            return int(process.name)
    return 0


def test_a_failing_frame_is_named(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"(street|side), frame 7: ArithmeticError: the lamp went out"):
        _build(tmp_path, cluster, engines=BROKEN, workers=2)


def test_a_shard_that_kills_every_worker_is_named(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"frames 6 to 7: 4 workers were lost over it; build again"):
        _build(tmp_path, cluster, engines=DYING, workers=1, shard_frames=2)


def test_a_refused_connection_is_an_error_of_one_line(tmp_path: Path) -> None:
    from recipe_runtime.build.ray import joined

    with pytest.raises(InputError) as caught, joined("127.0.0.1:1"):
        pass
    assert str(caught.value) == "there is no Ray cluster to join at 127.0.0.1:1: Connection refused"
