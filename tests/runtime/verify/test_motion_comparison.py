"""A forged digest of motion excuses no forged frame: FAIL does not become INCONCLUSIVE by it."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import ScenePlan
from recipe_runtime.build.pipeline import build
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.versions import host_versions
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes

PLAN = fakes.dataset_plan(frames=4, weathers=1)
ELSEWHERE = {**host_versions(), "glibc": "2.31"}
RGB = "weather=w0,jitter=still/street/rgb/000002.png"


def quiet(stage: str, done: int, total: int) -> None:
    pass


def moved(scene: ScenePlan) -> Trace:
    """Another host's simulation: all bodies are a metre off from frame 3 on."""
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[3:, :, 1] += METRE
    return replace(trace, positions=positions)


@pytest.fixture(scope="module")
def locked() -> Lockfile:
    return replace(
        lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=fakes.ENGINES),
        tools=ELSEWHERE,
    )


def check(forged: Lockfile, **more: Any) -> Report:
    options = Options(nonce=1, everything=True, workers=0)
    return verify(PLAN, forged, options, quiet, engines=more.pop("engines", fakes.ENGINES), **more)


def other_motion(locked: Lockfile, **changes: Any) -> Lockfile:
    """A lockfile whose traces and bodies are forged, so that nothing of its motion agrees."""
    bodies = {key: replace(motion, digest="1" * 64, checkpoints=()) for key, motion in locked.bodies.items()}
    bodies = changes.pop("bodies", bodies)
    return replace(locked, traces=dict.fromkeys(locked.traces, "0" * 64), bodies=bodies, **changes)


def test_a_trace_digest_that_its_own_bodies_contradict_fails(locked: Lockfile) -> None:
    report = check(other_motion(locked, bodies=locked.bodies))
    assert (report.verdict, report.stage) == ("FAIL", "trace")
    assert "the lockfile contradicts itself" in report.differences[0].message


def test_frames_are_compared_though_the_motion_is_said_to_be_another(locked: Lockfile) -> None:
    assert check(other_motion(locked, bodies={})).verdict == "INCONCLUSIVE"  # nothing else differs
    frames = {**locked.frames, next(k for k in locked.frames if k[2] == "rgb"): "0" * 64}
    report = check(other_motion(locked, bodies={}, frames=frames))
    assert report.bound.checked == len(PLAN.variants) * 2 * 4
    assert (report.verdict, [d.stage for d in report.differences]) == ("FAIL", ["trace", "shading"])


def test_frames_before_the_bodies_part_have_no_excuse(locked: Lockfile) -> None:
    """A host with other motion from frame 3 on is inconclusive; forged labels of frame 0 are not excused by it."""
    engines = replace(fakes.ENGINES, simulate=moved)
    honest = check(locked, engines=engines)
    assert honest.verdict == "INCONCLUSIVE"
    assert {d.frame for d in honest.differences if d.frame is not None} == {3}
    frames = {**locked.frames, next(k for k in locked.frames if k[2] == "labels" and k[3] == 0): "0" * 64}
    report = check(replace(locked, frames=frames), engines=engines)
    assert [d.frame for d in report.differences if d.excuse is None] == [0] * len(
        {d.variant for d in report.differences if d.frame == 0}
    )
    assert report.verdict == "FAIL"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    build(PLAN, root / "tiny", workers=0, cache=root / "cache", engines=fakes.ENGINES)
    return root / "tiny"


def check_folder(root: Path, simulate: Any = moved) -> Report:
    held = datasets.read(root)
    engines = replace(fakes.ENGINES, simulate=simulate)
    return verify(
        held.plan, held.lock, Options(nonce=1, everything=True, workers=0), quiet, dataset=held, engines=engines
    )


def test_a_dataset_of_other_motion_is_inconclusive(built: Path) -> None:
    report = check_folder(built)
    assert report.verdict == "INCONCLUSIVE"
    assert any(d.path == "weather=w0,jitter=still/tracks.csv" and d.excuse for d in report.differences)


def test_a_datasets_pictures_must_be_its_own_digests(built: Path, tmp_path: Path) -> None:
    """A forged picture of which the manifest has the file's SHA-256, but another digest of the pixels."""
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    (root / RGB).unlink()
    Image.new("RGB", (64, 48), (255, 0, 0)).save(root / RGB)
    body = (root / RGB).read_bytes()
    manifest = json.loads((root / "manifest.json").read_text())
    manifest["files"][RGB] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
    (root / "manifest.json").write_text(pretty(manifest))
    report = check_folder(root)
    assert report.verdict == "FAIL"
    (fault,) = [d for d in report.differences if d.excuse is None]
    assert fault.message == f"{RGB} does not hold the pixels whose digest the manifest has"
