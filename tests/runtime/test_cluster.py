"""A Ray cluster makes the same bytes, and loses nothing when it loses a node. `make test-ray`."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.errors import InputError, RunError
from recipe_runtime.build import build
from recipe_runtime.opening import compiled

from tests.runtime.fakes import BROKEN, DYING, ENGINES, SLOW, dataset_plan, tree
from tests.sources import ROOT

pytestmark = pytest.mark.ray
ray = pytest.importorskip("ray")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two nodes on this host, each with a processor; the first holds no work."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))  # workers import the fakes
        patch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
        nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
        nodes.add_node(num_cpus=1)
        nodes.add_node(num_cpus=1)
        nodes.wait_for_nodes()
        yield nodes
        nodes.shutdown()


def _build(folder: Path, cluster: Any, engines: Any = ENGINES, plan: Any = None, **more: Any) -> Any:
    from recipe_runtime.cluster import joined

    plan = plan or dataset_plan()
    with joined(cluster.address) as run:
        return build(plan, folder / "tiny", cache=folder / "cache", engines=engines, run=run, **more)


def _here(folder: Path, plan: Any = None) -> dict[str, bytes]:
    plan = plan or dataset_plan()
    return tree(build(plan, folder / "tiny", workers=0, cache=folder / "cache", engines=ENGINES).path)


def test_a_cluster_makes_the_same_bytes(cluster: Any, tmp_path: Path) -> None:
    made = _build(tmp_path / "cluster", cluster, workers=2, shard_frames=3)
    assert tree(made.path) == _here(tmp_path / "here")
    assert made.seconds["observe"] > 0.0


def test_real_engines_make_the_same_bytes(cluster: Any, tmp_path: Path) -> None:
    plan = compiled(ROOT / "tests" / "golden" / "tiny.yaml")
    made = _build(tmp_path / "cluster", cluster, engines=None, plan=plan, workers=2)
    here = build(plan, tmp_path / "here" / "tiny", workers=1, cache=tmp_path / "here" / "cache")
    assert tree(made.path) == tree(here.path)


def test_a_worker_killed_in_the_middle_changes_nothing(cluster: Any, tmp_path: Path) -> None:
    killed = []

    def kill(stage: str, done: int, total: int) -> None:
        if stage == "render" and done > 0 and not killed:
            killed.append(_kill_one())

    made = _build(tmp_path / "cluster", cluster, engines=SLOW, workers=2, shard_frames=2, progress=kill)
    assert killed[0] > 0
    assert tree(made.path) == _here(tmp_path / "here")


def test_a_node_lost_in_the_middle_changes_nothing(cluster: Any, tmp_path: Path) -> None:
    lost = []

    def lose(stage: str, done: int, total: int) -> None:
        if stage == "render" and done > 0 and not lost:
            node = sorted(cluster.worker_nodes, key=lambda n: n.node_id)[0]
            lost.append(node)
            threading.Thread(target=lambda: cluster.remove_node(node, allow_graceful=False), daemon=True).start()
            time.sleep(1.0)

    made = _build(tmp_path / "cluster", cluster, engines=SLOW, workers=2, shard_frames=2, progress=lose)
    assert lost
    assert tree(made.path) == _here(tmp_path / "here")
    cluster.add_node(num_cpus=1)


def _kill_one() -> int:
    """End one worker process, as the kernel does when memory runs out; its number."""
    for process in sorted(Path("/proc").glob("[0-9]*"), key=lambda p: int(p.name)):
        try:
            command = (process / "cmdline").read_bytes()
        except OSError:
            continue
        if command.startswith(b"ray::Hand"):
            os.kill(int(process.name), signal.SIGKILL)
            return int(process.name)
    return 0


def test_a_frame_that_fails_is_named(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"(street|side), frame 7: ArithmeticError: the lamp went out"):
        _build(tmp_path, cluster, engines=BROKEN, workers=2)


def test_a_shard_that_takes_every_worker_with_it_is_named(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"frames 6 to 7: 4 workers were lost over it; build again"):
        _build(tmp_path, cluster, engines=DYING, workers=1, shard_frames=2)


def test_no_cluster_is_an_error_in_a_line(tmp_path: Path) -> None:
    from recipe_runtime.cluster import joined

    with pytest.raises(InputError, match="there is no Ray cluster to join") as caught, joined("127.0.0.1:1"):
        pass
    assert len(str(caught.value).splitlines()) == 1
