"""Devices: their names are checked before work begins, and a CUDA GPU renders the bytes of a CPU."""

from __future__ import annotations

from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.lockfile import read
from recipe_runtime.annotate.records import label_digest
from recipe_runtime.build.worker import Job, Worker
from recipe_runtime.cache.store import Store
from recipe_runtime.frames.engines import devices, real_engines
from recipe_runtime.frames.source import SceneSource
from recipe_runtime.loading import compiled
from recipe_runtime.modalities import pixel_digest
from recipe_runtime.render.device import setup as device_module
from recipe_runtime.verify.verify import Options, verify

from tests.runtime.fakes import ENGINES, dataset_plan
from tests.runtime.frame_source import FrameSource
from tests.sources import ROOT

GOLDEN = ROOT / "tests" / "golden"


def test_the_cpu_is_always_available() -> None:
    assert devices("cpu") == ("cpu",)


@pytest.mark.parametrize("name", ["gpu", "cuda:", "cuda:x", "CUDA", "cuda:-1", "", "cuda:0;rm"])
def test_an_unknown_device_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"there is no device .*; write cpu, cuda"):
        devices(name)


def test_absent_gpus_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_module, "cuda_devices", lambda: [])
    with pytest.raises(InputError, match="device cuda:0: there is no CUDA GPU here"):
        devices("cuda:0")
    monkeypatch.setattr(device_module, "cuda_devices", lambda: ["cuda:0", "cuda:1"])
    assert (devices("cuda"), devices("cuda:1")) == (("cuda:0", "cuda:1"), ("cuda:1",))
    with pytest.raises(InputError, match="there is no device cuda:2; write one of cuda:0, cuda:1"):
        devices("cuda:2")


def test_workers_are_distributed_over_the_devices(tmp_path: Path) -> None:
    job = Job(dataset_plan(), ENGINES, ("cuda:0", "cuda:1"), tmp_path, None)
    assert [Worker(job, number)._device for number in range(5)] == ["cuda:0", "cuda:1", "cuda:0", "cuda:1", "cuda:0"]


@pytest.mark.gpu
def test_a_gpu_renders_the_bytes_of_the_cpu() -> None:
    """Every frame of the golden recipe: every variant, sensor and modality, and the labels."""
    plan, store = compiled(GOLDEN / "tiny.yaml"), Store()
    for variant in plan.variants:
        trace = store.trace(variant.scene, lambda scene=variant.scene: real_engines().simulate(scene))  # type: ignore[misc]
        sources = [SceneSource(variant.scene, trace, device=name) for name in ("cpu", "cuda:0")]
        for sensor in variant.rig.sensors:
            for frame in range(variant.scene.clock.frames):
                made = [FrameSource(variant, trace, source=s).render_labelled(sensor.name, frame) for s in sources]
                found = [
                    {"labels": label_digest(labels), **{m: pixel_digest(m, a) for m, a in arrays.items()}}
                    for arrays, labels in made
                ]
                assert found[0] == found[1], f"{variant.variant}, {sensor.name}, frame {frame}"


@pytest.mark.gpu
def test_a_lockfile_of_a_cpu_passes_verification_on_a_gpu() -> None:
    plan, lock = compiled(GOLDEN / "tiny.yaml"), read(GOLDEN / "lockfiles" / "tiny.lock")
    options = Options(nonce=1, everything=True, workers=0, device="cuda:0")
    report = verify(plan, lock, options, lambda *_: None, files=lock.files)
    assert report.verdict == "PASS", report.differences
