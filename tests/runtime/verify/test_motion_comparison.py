"""A forged digest of the motion excuses no forged frame, and motion of another host causes no false alarm."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, Pose, ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.core.versions import host_versions
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.frames.engines import Engines
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.render.renderer import Renderer
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes
from tests.runtime.fakes import quiet
from tests.runtime.forging import edited
from tests.runtime.render import street
from tests.runtime.render.street import box

PLAN = fakes.dataset_plan(frames=4, weathers=1)
ELSEWHERE = {**host_versions(), "glibc": "2.31"}
RGB = "weather=w0,jitter=still/street/rgb/000002.png"


def moved(scene: ScenePlan) -> Trace:
    """Simulate as another host could: all bodies are offset by 1 m from frame 3 on."""
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[3:, :, 1] += METRE
    return replace(trace, positions=positions)


MOVED = replace(fakes.ENGINES, simulate=moved)


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
    """Return a lockfile with forged rows of traces and bodies."""
    bodies = {key: replace(motion, digest="1" * 64, checkpoints=()) for key, motion in locked.bodies.items()}
    bodies = changes.pop("bodies", bodies)
    return replace(locked, traces=dict.fromkeys(locked.traces, "0" * 64), bodies=bodies, **changes)


def test_a_trace_digest_that_contradicts_its_bodies_fails(locked: Lockfile) -> None:
    report = check(other_motion(locked, bodies=locked.bodies))
    assert (report.verdict, report.stage) == ("FAIL", "trace")
    assert "the lockfile contradicts itself" in report.differences[0].message


def test_frames_are_compared_though_the_lockfile_claims_another_motion(locked: Lockfile) -> None:
    report = check(other_motion(locked, bodies={}))
    assert [d.stage for d in report.differences if d.excuse is None] == ["lockfile"]  # it lacks rows; nothing else
    frames = {**locked.frames, next(k for k in locked.frames if k[2] == "rgb"): "0" * 64}
    report = check(other_motion(locked, bodies={}, frames=frames))
    assert report.bound.checked == len(PLAN.variants) * 2 * 4
    assert (report.verdict, [d.stage for d in report.differences]) == ("FAIL", ["lockfile", "trace", "shading"])


def test_frames_before_the_bodies_diverge_have_no_excuse(locked: Lockfile) -> None:
    """Other motion from frame 3 on makes the result inconclusive, but does not excuse forged labels of frame 0."""
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


class ShadowRenderer(fakes.Renderer):
    """Render the shadow of a van behind the camera, as a red tint; the van itself is not visible."""

    def observe(
        self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
    ) -> fakes.Seen:
        self._red = int(parts[2][1, 3] * 8) % 128
        return super().observe(camera, world_from_sensor, parts, lamps)

    def picture(self, obs: fakes.Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        colours = super().picture(obs, appearance, frame)
        colours[..., 0] = colours[..., 0] // 2 + self._red
        return colours


def behind(scene: ScenePlan) -> Trace:
    """Simulate the fakes' motion, with the van behind the camera."""
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[:, 2, 0] = -5 * METRE
    return replace(trace, positions=positions)


def behind_elsewhere(scene: ScenePlan) -> Trace:
    """Simulate as another host could: the invisible van is offset by 1 m from frame 3 on."""
    trace = behind(scene)
    positions, linear = trace.positions.copy(), trace.linear.copy()
    positions[3:, 2, 1] += METRE
    linear[3:, 2, 1] += 1
    return replace(trace, positions=positions, linear=linear)


SHADOWS = Engines(behind, fakes.actor_bodies, lambda scene, device: ShadowRenderer(scene))
SHADOWS_ELSEWHERE = replace(SHADOWS, simulate=behind_elsewhere)


@pytest.fixture(scope="module")
def locked_shadows() -> Lockfile:
    return replace(lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=SHADOWS), tools=ELSEWHERE)


def forged_rgb(lock: Lockfile, frame: int) -> Lockfile:
    row = next(key for key in lock.frames if key[2:] == ("rgb", frame))
    return replace(lock, frames={**lock.frames, row: "0" * 64})


def test_the_shadow_of_a_body_outside_the_picture_causes_no_false_alarm(locked_shadows: Lockfile) -> None:
    report = check(locked_shadows, engines=SHADOWS_ELSEWHERE)
    assert report.verdict == "INCONCLUSIVE"
    frames = {(d.stage, d.frame, d.modality) for d in report.differences if d.frame is not None}
    assert frames == {("shading", 3, "rgb")}  # the labels agree
    assert check(locked_shadows, engines=SHADOWS).verdict == "PASS"


@pytest.mark.parametrize(("frame", "engines"), [(0, SHADOWS_ELSEWHERE), (0, SHADOWS), (3, SHADOWS)])
def test_forged_colours_before_the_motion_differs_fail(locked_shadows: Lockfile, frame: int, engines: Engines) -> None:
    report = check(forged_rgb(locked_shadows, frame), engines=engines)
    assert report.verdict == "FAIL"
    assert {d.frame for d in report.differences if d.excuse is None} == {frame}


def test_forged_colours_fail_where_no_other_motion_is_recorded(locked_shadows: Lockfile) -> None:
    """The digest of the trace differs, but no row states which body differs."""
    report = check(other_motion(forged_rgb(locked_shadows, 3), bodies={}), engines=SHADOWS)
    found = [d.stage for d in report.differences if d.excuse is None]
    assert (report.verdict, found) == ("FAIL", ["lockfile", "shading"])


def test_a_scene_without_bodies_has_no_other_motion() -> None:
    variant = PLAN.variants[0]
    variant = variant.model_copy(update={"scene": variant.scene.model_copy(update={"actors": ()})})
    plan = PLAN.model_copy(update={"variants": (variant,)})
    made = replace(lock(plan, "t", {}, workers=0, progress=quiet, engines=fakes.ENGINES), tools=ELSEWHERE)
    made = replace(made, traces=dict.fromkeys(made.traces, "0" * 64))
    report = verify(plan, made, Options(nonce=1, workers=0), quiet, engines=fakes.ENGINES)
    assert (report.verdict, report.stage) == ("FAIL", "trace")


@pytest.mark.slow
def test_a_rendered_body_outside_the_picture_changes_only_colours() -> None:
    """So colours have an excuse that labels do not have: a body outside the picture can cast its shadow into it."""
    pole = Body("pole", 14001, (("base", box([-0.5, -0.5, 0], [0.5, 0.5, 3], street.PAINT)),))
    renderer = Renderer([Body("road", 0, (("base", street.ground(60, street.ROAD)),)), pole])
    looks = {"road": {"asphalt": "#4a4a4c"}, "pole": {"paint": "#1f4f9a"}}
    eye, low_sun = from_pose(Pose(z=1.7, pitch=30)), street.appearance(20.0, azimuth=180.0, looks=looks)
    seen = [
        renderer.observe(CameraPlan(width=48, height=32, fov=60), eye, np.stack([from_pose(Pose(x=-3, y=y))]))
        for y in (0.0, 0.5)
    ]
    pictures = [renderer.shade(one, low_sun, "street", 0, 0.0) for one in seen]
    for name in ("depth", "instance", "semantic"):
        assert np.array_equal(getattr(seen[0], name), getattr(seen[1], name))
    assert not np.array_equal(pictures[0], pictures[1])


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES))
    return root / "tiny"


def check_folder(root: Path, engines: Engines = MOVED) -> Report:
    held = datasets.read(root)
    return verify(
        held.plan, held.lock, Options(nonce=1, everything=True, workers=0), quiet, dataset=held, engines=engines
    )


@pytest.mark.slow
def test_a_dataset_of_other_motion_is_inconclusive(built: Path) -> None:
    report = check_folder(built)
    assert report.verdict == "INCONCLUSIVE"
    assert any(d.path == "weather=w0,jitter=still/tracks.csv" and d.excuse for d in report.differences)


@pytest.mark.slow
@pytest.mark.parametrize("tracks", ["another host's", "this host's"])
def test_a_dataset_is_excused_by_its_tracks(tmp_path: Path, tracks: str) -> None:
    """A manifest has no rows of bodies, so the dataset's tracks must show whether its motion differs."""
    root = tmp_path / "tiny"
    build(PLAN, root, BuildOptions(workers=0, cache=tmp_path / "cache", engines=SHADOWS_ELSEWHERE))
    report = check_folder(root, SHADOWS)
    assert report.verdict == "INCONCLUSIVE"
    assert {(d.stage, d.frame) for d in report.differences if d.frame is not None} == {("shading", 3)}
    if tracks == "this host's":
        build(PLAN, tmp_path / "here", BuildOptions(workers=0, cache=tmp_path / "cache2", engines=SHADOWS))
        with edited(root) as manifest:
            here = json.loads((tmp_path / "here" / "manifest.json").read_text())
            for path in [path for path in manifest["files"] if path.endswith("tracks.csv")]:
                shutil.copy(tmp_path / "here" / path, root / path)
                manifest["files"][path] = here["files"][path]
        report = check_folder(root, SHADOWS)
        assert report.verdict == "FAIL"
        assert {d.frame for d in report.differences if d.excuse is None and d.frame is not None} == {3}


@pytest.mark.slow
def test_a_datasets_pictures_must_have_its_digests(built: Path, tmp_path: Path) -> None:
    """The manifest has the SHA-256 of a forged file, but another digest of its pixels."""
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    (root / RGB).unlink()
    Image.new("RGB", (64, 48), (255, 0, 0)).save(root / RGB)
    body = (root / RGB).read_bytes()
    with edited(root) as manifest:
        manifest["files"][RGB] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
    report = check_folder(root)
    assert report.verdict == "FAIL"
    (fault,) = [d for d in report.differences if d.excuse is None]
    assert fault.message == f"{RGB} does not hold the pixels whose digest the manifest has"


@pytest.mark.parametrize("forge", ["digest", "checkpoints", "surplus", "missing", "none"])
def test_rows_of_bodies_are_compared_where_the_trace_agrees(locked: Lockfile, forge: str) -> None:
    key = next(iter(locked.bodies))
    bodies = dict(locked.bodies)
    if forge == "digest":
        bodies[key] = replace(bodies[key], digest="1" * 64)
    elif forge == "checkpoints":  # they determine which frames can be excused on another host
        bodies[key] = replace(bodies[key], checkpoints=tuple("deadbeef" for _ in bodies[key].checkpoints))
    elif forge == "none":
        bodies.clear()
    elif forge == "surplus":
        bodies["f" * 64, "ghost"] = bodies[key]
    else:
        del bodies[key]
    report = check(replace(locked, bodies=bodies))
    assert (report.verdict, report.stage) == ("FAIL", "trace" if forge in ("digest", "checkpoints") else "lockfile")


@pytest.mark.slow
@pytest.mark.parametrize("forge", [{"sealed": False}, {"recipe": "imagenet"}])
def test_a_forged_identity_of_a_dataset_fails_against_a_recipe(locked: Lockfile, built: Path, forge: Any) -> None:
    honest = datasets.read(built)
    assert check(locked, dataset=honest).verdict == "PASS"
    report = check(locked, dataset=replace(honest, lock=replace(honest.lock, **forge)))
    assert (report.verdict, report.stage) == ("FAIL", "lockfile")
