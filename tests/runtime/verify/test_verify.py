"""The verifier passes equal datasets, and reports a difference at the right stage.

The engines are those of fakes.py, so that each stage can be changed separately.
"""

from __future__ import annotations

import random
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, DatasetPlan, ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.cache.store import Store
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array
from recipe_runtime.core.versions import host_versions
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.digests import frame_keys
from recipe_runtime.frames.engines import Engines
from recipe_runtime.verify.compare import compare_locks, text_note
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.pictures import draw_differences
from recipe_runtime.verify.verdict import Difference, Report
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes
from tests.runtime.fakes import quiet
from tests.runtime.forging import edited, rewrite

PLAN = fakes.dataset_plan(frames=6, weathers=2)
FILES = {"tiny.yaml": "a" * 64}


@pytest.fixture(scope="module")
def locked() -> Lockfile:
    return lock(PLAN, "../tiny.yaml", FILES, workers=0, progress=quiet, engines=fakes.ENGINES)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES))
    return root / "tiny"


def check(lockfile: Lockfile, plan: DatasetPlan = PLAN, engines: Engines = fakes.ENGINES, **more: Any) -> Report:
    traces = more.pop("traces", None)
    options = Options(nonce=more.pop("nonce", 1), everything=more.pop("everything", True), workers=0, **more)
    return verify(plan, lockfile, options, quiet, files=FILES, traces=traces, engines=engines)


def check_folder(root: Path, **more: Any) -> Report:
    held = datasets.read(root)
    options = Options(nonce=1, everything=True, workers=0, **more)
    return verify(held.plan, held.lock, options, quiet, dataset=held, engines=fakes.ENGINES)


def test_an_equal_lockfile_passes(locked: Lockfile) -> None:
    report = check(locked)
    assert (report.verdict, report.stage, report.differences) == ("PASS", None, [])
    assert report.bound.checked == report.bound.total == 4 * 2 * 6


def test_a_sample_is_repeatable_by_its_nonce(locked: Lockfile) -> None:
    wrong = dict.fromkeys(locked.frames, "0" * 64)
    samples = [
        [d.message for d in check(replace(locked, frames=wrong), nonce=n, everything=False, count=5).differences]
        for n in (1, 1, 2)
    ]
    assert samples[0] == samples[1] != samples[2]
    assert len(samples[0]) == 5


@pytest.mark.slow
def test_workers_do_not_matter(locked: Lockfile) -> None:
    options = Options(nonce=1, everything=True, workers=2)
    assert verify(PLAN, locked, options, quiet, engines=fakes.ENGINES).verdict == "PASS"


def test_lockfile_and_dataset_have_one_identity(locked: Lockfile, built: Path) -> None:
    held = datasets.read(built)
    assert held.lock.sealed
    assert held.lock.identity == locked.identity
    assert held.lock.frames == locked.frames


def test_a_broken_seal_is_reported_first(locked: Lockfile) -> None:
    report = check(replace(locked, sealed=False))
    assert (report.verdict, report.stage) == ("FAIL", "lockfile")


ROW = ("0" * 16, "street", "rgb", 3)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"frames": {}}, f"it lacks {len(set(frame_keys(PLAN)))} frame rows"),
        ({"frames": {ROW: "0" * 64}}, "it has 1 surplus frame row"),
        ({"traces": {}}, "it lacks 1 trace row"),
        ({"stages": {}}, "it lacks 6 stage rows"),
        ({"recipe": "imagenet"}, "it is of the recipe 'imagenet', and this is 'tiny'"),
    ],
)
def test_a_lockfile_has_exactly_the_rows_of_its_recipe(locked: Lockfile, change: dict[str, Any], says: str) -> None:
    """Seals are untrusted: missing and surplus rows are found by comparison with the plan, in verify and in build."""
    frames = {"frames": {**locked.frames, **change["frames"]}} if change.get("frames") else {}
    other = replace(locked, **{**change, **frames})
    report = check(other, everything=False, count=1)
    assert (report.verdict, report.stage) == ("FAIL", "lockfile")
    assert any(says in d.message for d in report.differences)
    assert any(says in d.message for d in compare_locks(PLAN, other, locked))


def test_no_confidence_bound_is_stated_after_a_difference(locked: Lockfile) -> None:
    wrong = replace(locked, frames=dict.fromkeys(locked.frames, "0" * 64))
    report = check(wrong)
    assert report.extent == "48 of 48 frames compared, 48 of them differ"
    assert report.document()["differing_below"] is None
    report = check(locked, fakes.dataset_plan(frames=6, weathers=1), everything=False, count=5)
    assert report.extent == "5 of 24 frames compared, no rendered frame differs"
    moved = check(locked, engines=replace(fakes.ENGINES, simulate=_noisy_simulate))
    assert moved.extent == "none of 48 frames compared, because what precedes rendering differs"


def test_a_build_is_compared_with_its_lockfile_stage_by_stage(locked: Lockfile) -> None:
    assert compare_locks(PLAN, locked, locked) == []
    one = next(key for key in locked.frames if key[2] == "depth")
    made = replace(locked, frames={**locked.frames, one: "0" * 64}, traces=dict.fromkeys(locked.traces, "0" * 64))
    assert [d.stage for d in compare_locks(PLAN, locked, made)] == ["trace", "observation"]
    assert [d.stage for d in compare_locks(PLAN, replace(locked, sealed=False), locked)] == ["lockfile"]
    fewer = {key: value for key, value in locked.frames.items() if key != one}
    assert [d.stage for d in compare_locks(PLAN, locked, replace(locked, frames=fewer))] == ["lockfile"]


def test_an_edited_recipe_is_reported(locked: Lockfile) -> None:
    """Another text with an equal plan is a note; another plan is a difference that names the file."""
    edited = replace(locked, files={"tiny.yaml": "b" * 64})
    report = check(edited)
    assert (report.verdict, report.differences) == ("PASS", [])
    assert report.notes == ["the text of tiny.yaml has changed since it was locked; the plan has not"]
    report = check(edited, fakes.dataset_plan(frames=6, weathers=1))
    assert (report.verdict, report.stage, report.notes) == ("FAIL", "recipe", [])
    assert "tiny.yaml has changed since it was locked" in str(report.differences[0])


def test_a_renamed_recipe_is_noted_with_its_locked_name(locked: Lockfile) -> None:
    """Regression: the note said that the file was not locked or its text had changed; there was none for a new name."""
    (same,) = locked.files.values()
    assert text_note(locked, PLAN.digest, {"new.yaml": same}) == "new.yaml was locked as tiny.yaml; the plan is equal"
    both = {"a.png": same, "new.yaml": same}
    assert text_note(locked, PLAN.digest, both) == "new.yaml was locked as tiny.yaml; the plan is equal"
    other = "new.yaml was locked as tiny.yaml, with another text; the plan is equal"
    assert text_note(locked, PLAN.digest, {"new.yaml": "b" * 64}) == other
    assert text_note(locked, PLAN.digest, locked.files) is None
    assert text_note(locked, "another plan", {"new.yaml": same}) is None


def test_another_plan_is_reported_by_its_part(locked: Lockfile) -> None:
    report = check(locked, fakes.dataset_plan(frames=6, weathers=1))
    assert (report.verdict, report.stage) == ("FAIL", "plan")
    assert "variant weather=w1,jitter=still is in the lockfile only" in report.differences[0].message
    name, row = next(iter(locked.variants.items()))
    other = {**locked.variants, name: replace(row, rig="0" * 64)}
    assert f"{name}: different rig plan" in str(check(replace(locked, variants=other)).differences[0])


def _noisy_simulate(scene: ScenePlan) -> Trace:
    """Simulate with an error: one body is offset by a grid step from frame 3 on."""
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[3:, 1, 0] += random.Random().randint(1, 9)
    return replace(trace, positions=positions)


class _NoisyShader(fakes.Renderer):
    def picture(self, obs: fakes.Seen, appearance: AppearancePlan, frame: int) -> NDArray[np.uint8]:
        picture = super().picture(obs, appearance, frame)
        picture[0, 0, 0] ^= random.Random().randint(1, 255)
        return picture


class _NoisyObserver(fakes.Renderer):
    def observe(
        self, camera: CameraPlan, world_from_sensor: Array, parts: Array, lamps: NDArray[np.int32] | None = None
    ) -> fakes.Seen:
        seen = super().observe(camera, world_from_sensor, parts, lamps)
        seen.depth[2, 3] += np.float32(random.Random().uniform(1, 2))
        return seen


def test_an_error_of_the_simulation_is_reported_with_its_body(locked: Lockfile) -> None:
    report = check(locked, engines=replace(fakes.ENGINES, simulate=_noisy_simulate))
    assert (report.verdict, report.stage) == ("FAIL", "trace")
    assert "body hero2 diverges at frame 3 (from step 72); 1 of 3 bodies differ" in str(report.differences[0])


def _moved(scene: ScenePlan) -> Trace:
    """Simulate as another host could: the second body is offset by a grid step."""
    trace = fakes.simulate(scene)
    positions = trace.positions.copy()
    positions[3, 1, 0] += 1
    return replace(trace, positions=positions)


def _barred(scene: ScenePlan) -> Trace:
    raise RunError("there is no PyBullet here")


OTHER_PYTHON = {**host_versions(), "python": "3.9"}


def test_another_host_compares_frames_from_the_locked_motion(locked: Lockfile) -> None:
    held = {scene: fakes.simulate(PLAN.variants[0].scene) for scene in locked.traces}
    for engines, says in (
        (replace(fakes.ENGINES, simulate=_moved), "body hero2 diverges at frame 3"),
        (replace(fakes.ENGINES, simulate=_barred), "it was not simulated here"),
    ):
        report = check(replace(locked, tools=OTHER_PYTHON), engines=engines, traces=held)
        (difference,) = report.differences
        assert (report.verdict, report.stage, report.bound.checked) == ("INCONCLUSIVE", "trace", 48)
        assert difference.message.startswith(says)
        assert difference.message.endswith("frames are compared from the locked motion on")


def test_other_motion_does_not_excuse_frames_rendered_from_the_locked_motion(locked: Lockfile) -> None:
    held = {scene: fakes.simulate(PLAN.variants[0].scene) for scene in locked.traces}
    frames = {**locked.frames, next(k for k in locked.frames if k[2] == "rgb"): "0" * 64}
    engines = replace(fakes.ENGINES, simulate=_moved)
    report = check(replace(locked, tools=OTHER_PYTHON, frames=frames), engines=engines, traces=held)
    assert report.verdict == "FAIL"
    assert [d.stage for d in report.differences] == ["trace", "shading"]


def test_the_locked_motion_is_not_used_on_a_host_that_must_agree(locked: Lockfile) -> None:
    held = {scene: fakes.simulate(PLAN.variants[0].scene) for scene in locked.traces}
    report = check(locked, engines=replace(fakes.ENGINES, simulate=_moved), traces=held)
    assert (report.verdict, report.stage, report.bound.checked) == ("FAIL", "trace", 0)


@pytest.mark.parametrize(("renderer", "stage"), [(_NoisyShader, "shading"), (_NoisyObserver, "observation")])
def test_an_error_of_the_renderer_is_reported(locked: Lockfile, renderer: type[fakes.Renderer], stage: str) -> None:
    engines = replace(fakes.ENGINES, renderer=lambda scene, device: renderer(scene))
    report = check(locked, engines=engines)
    assert (report.verdict, report.stage) == ("FAIL", stage)


def test_another_stage_version_is_inconclusive_from_that_stage_on(locked: Lockfile) -> None:
    engines = replace(fakes.ENGINES, renderer=lambda scene, device: _NoisyShader(scene))
    newer = replace(locked, stages={**locked.stages, "observe": 2}, tools={**locked.tools, "dataset-recipe": "99.0"})
    report = check(newer, engines=engines)
    assert (report.verdict, report.stage) == ("INCONCLUSIVE", "shading")
    assert "observe version 2, this is 1; dataset-recipe 99.0 reproduces it" in str(report.differences[0])
    assert check(newer).verdict == "PASS"  # equal bytes pass with any version


@pytest.mark.parametrize(
    ("stages", "tools"),
    [
        ({}, {"warp-lang": "0.1", "numpy": "1.0", "pycocotools": "1", "glibc": "2.17", "python": "3.9"}),
        ({"shade": 2}, {}),  # of this release, which has version 1
        ({"shade": 2}, {"dataset-recipe": "0.0.1"}),  # an older release with a higher version
        ({"shade": 0}, {"dataset-recipe": "0.0.1"}),
        ({"shade": 10**6}, {"dataset-recipe": "99.0"}),
        ({"shade": 2}, {"dataset-recipe": "ninety-nine"}),
        ({"encode": 2, "simulate": 2, "plan": 2}, {"dataset-recipe": "99.0"}),  # other stages
    ],
)
def test_a_forged_version_excuses_no_forged_frame(
    locked: Lockfile, stages: dict[str, int], tools: dict[str, str]
) -> None:
    frames = {**locked.frames, next(k for k in locked.frames if k[2] == "rgb"): "0" * 64}
    forged = replace(locked, frames=frames, stages={**locked.stages, **stages}, tools={**locked.tools, **tools})
    assert check(forged).verdict == "FAIL"


@pytest.mark.parametrize(
    "tools", [{"glibc": "9999.1"}, {"glibc": "none of yours"}, {"python": "2.7"}, {"numpy": "1.0"}]
)
def test_an_invalid_c_library_version_excuses_no_motion(locked: Lockfile, tools: dict[str, str]) -> None:
    moved = check(replace(locked, tools={**locked.tools, **tools}), engines=replace(fakes.ENGINES, simulate=_moved))
    assert moved.verdict == "FAIL"
    assert any(d.stage == "trace" and d.excuse is None for d in moved.differences)


@pytest.mark.slow
def test_forged_labels_are_not_excused_by_a_tool(built: Path, tmp_path: Path) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    path = "annotations/kwcoco.json"
    rewrite(root, path, (root / path).read_bytes().replace(b"hero1", b"hero7", 1))
    with edited(root) as manifest:
        manifest["tools"] |= {"dataset-recipe": "0.0.9", "pycocotools": "1.0"}
    assert check_folder(root).verdict == "FAIL"


def test_another_tool_version_excuses_only_its_stage(locked: Lockfile) -> None:
    elsewhere = replace(locked, tools={**locked.tools, "glibc": "2.17"})
    moved = check(elsewhere, engines=replace(fakes.ENGINES, simulate=_noisy_simulate))
    assert (moved.verdict, moved.stage) == ("INCONCLUSIVE", "trace")
    assert "glibc 2.17, here" in str(moved.differences[0])
    engines = replace(fakes.ENGINES, renderer=lambda scene, device: _NoisyShader(scene))
    assert check(elsewhere, engines=engines).verdict == "FAIL"


@pytest.mark.slow
def test_a_dataset_passes_without_its_recipe(built: Path) -> None:
    report = check_folder(built)
    assert (report.verdict, report.differences) == ("PASS", [])


@pytest.mark.slow
@pytest.mark.parametrize("modality", ["rgb", "depth", "instance", "semantic"])
def test_a_flipped_bit_in_a_picture_is_detected_and_drawn(built: Path, tmp_path: Path, modality: str) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    victim = root / "weather=w1,jitter=shaky" / "street" / modality / "000004.png"
    with Image.open(victim) as picture:
        pixels = np.array(picture)
    was = " ".join(map(str, np.atleast_1d(pixels[5, 7]).tolist()))
    pixels[5, 7] ^= 1
    now = " ".join(map(str, np.atleast_1d(pixels[5, 7]).tolist()))
    victim.unlink()  # a label file may be a hard link to another variant's
    Image.fromarray(pixels).save(victim)
    report = check_folder(root, pictures=tmp_path / "differences")
    assert (report.verdict, report.stage) == ("FAIL", "file")
    reported = f"{modality}/000004.png: 1 pixel differs: (7, 5) is {now} as recorded, {was} as rendered"
    (difference,) = report.differences  # reported once, and not also as a file with another digest
    assert reported in str(difference)
    assert (difference.recorded, difference.rendered) == (now, was)
    kinds = {Path(p).stem.rsplit("-", 1)[1] for p in report.pictures}
    assert kinds == {"recorded", "rendered", "difference"}
    with Image.open(next(p for p in report.pictures if p.endswith("difference.png"))) as picture:
        red = np.argwhere((np.asarray(picture) == (255, 40, 40)).all(axis=-1))
    assert red.tolist() == [[5, 7]]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x" * 300, "file/x"])
def test_a_difference_is_reported_though_its_picture_cannot_be_written(built: Path, tmp_path: Path, name: str) -> None:
    """Names of variants can be too long for the name of a picture; the report must not be lost."""
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    victim = root / "weather=w1,jitter=shaky" / "street" / "rgb" / "000004.png"
    victim.unlink()
    Image.new("RGB", (8, 6)).save(victim)
    (tmp_path / "file").touch()
    report = check_folder(root, pictures=tmp_path / name)
    assert (report.verdict, report.stage) == ("FAIL", "file")
    (line,) = report.pictures
    assert line.startswith("no picture could be written to")


@pytest.mark.parametrize(
    "other",
    [{"variant": "sun"}, {"variant": None}, {"sensor": "roof"}, {"frame": 6}, {"frame": None}, {"modality": "labels"}],
)
def test_no_picture_is_drawn_of_a_frame_that_the_plan_does_not_have(tmp_path: Path, other: dict[str, Any]) -> None:
    """A dataset is compared with a recipe that may have other variants and sensors; `verify` ended in an error."""
    frame = Difference("shading", "differs", None, "weather=w1,jitter=shaky", "street", 4, "rgb")
    drawn: dict[str, Any] = {"engines": fakes.ENGINES, "store": Store(tmp_path), "device": "cpu"}
    assert not draw_differences([replace(frame, **other)], PLAN, None, tmp_path / "out", **drawn)
    assert not (tmp_path / "out").exists()
    both = [replace(frame, **other), frame, frame]
    (picture,) = draw_differences(both, PLAN, None, tmp_path / "out", **drawn)
    assert Path(picture).exists()


@pytest.mark.slow
def test_any_damaged_missing_or_added_file_is_detected(built: Path, tmp_path: Path) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    text = (root / "annotations" / "kwcoco.json").read_text()
    (root / "annotations" / "kwcoco.json").write_text(text.replace("hero1", "hero7", 1))
    (root / "weather=w0,jitter=still" / "tracks.csv").unlink()
    (root / "extra.txt").write_text("?")
    messages = [str(d) for d in check_folder(root).differences]
    assert "file: annotations/kwcoco.json differs from its SHA-256 in the manifest" in messages
    assert "file: weather=w0,jitter=still/tracks.csv is missing or cannot be read" in messages
    assert "file: extra.txt is not in the manifest" in messages


@pytest.mark.slow
def test_equal_pixels_in_other_bytes_are_a_difference_of_encoding(built: Path, tmp_path: Path) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    victim = root / "weather=w0,jitter=still" / "street" / "rgb" / "000002.png"
    with Image.open(victim) as picture:
        picture.load()
        picture.save(victim, compress_level=9)
    stages = {d.stage for d in check_folder(root).differences}
    assert stages == {"encoding", "file"}


@pytest.mark.slow
def test_a_manifest_with_inconsistent_digests_is_reported(built: Path, tmp_path: Path) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    lockfile = datasets.read(root).lock
    digest = next(value for key, value in lockfile.frames.items() if key[2] == "rgb")
    text = (root / "manifest.json").read_text()
    (root / "manifest.json").write_text(text.replace(digest, digest[::-1]))
    report = check_folder(root)
    assert (report.verdict, report.stage) == ("FAIL", "lockfile")


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [
        "annotations/kwcoco.json",
        "annotations/coco/rgb.json",
        "mots/MOTS-train/weather=w0_jitter=still+street/gt/gt.txt",
        "mots/MOTS-train/weather=w0_jitter=still+street/seqinfo.ini",
        "mots/seqmaps/MOTS-train.txt",
        "weather=w0,jitter=still/tracks.csv",
        "weather=w0,jitter=still/events.csv",
        "weather=w0,jitter=still/street/labels.jsonl",
        "plans/weather=w0,jitter=still.json",
        "README.md",
    ],
)
def test_a_forged_text_is_detected_though_the_manifest_agrees(built: Path, tmp_path: Path, path: str) -> None:
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    text = (root / path).read_text()
    forged = re.sub(r"\d", lambda digit: str(9 - int(digit[0])), text, count=1)
    rewrite(root, path, forged.encode())
    try:
        report = check_folder(root)
    except InputError as error:  # a plan that differs from the manifest is refused on reading
        assert "plan" in str(error)
    else:
        assert report.verdict == "FAIL"


@pytest.mark.slow
def test_a_text_of_another_release_is_inconclusive(built: Path, tmp_path: Path) -> None:
    """The text of the card may change between releases, which does not make a dataset forged."""
    root = tmp_path / "tiny"
    shutil.copytree(built, root)
    rewrite(root, "README.md", (root / "README.md").read_bytes() + b"\nIn other words.\n")
    assert check_folder(root).verdict == "FAIL"
    with edited(root) as manifest:
        manifest["tools"]["dataset-recipe"] = "0.0.9"
    report = check_folder(root)
    assert (report.verdict, report.stage) == ("INCONCLUSIVE", "file")
    assert "made with dataset-recipe 0.0.9" in str(report.differences[0])


@pytest.mark.slow
def test_a_dataset_can_be_compared_with_another_lockfile(locked: Lockfile, built: Path) -> None:
    held = datasets.read(built)
    options = Options(nonce=1, count=1, workers=0)
    assert verify(PLAN, locked, options, quiet, files=FILES, dataset=held, engines=fakes.ENGINES).verdict == "PASS"
    row = next(k for k in held.lock.frames if k[2] == "depth")
    wrong = replace(held, lock=replace(held.lock, frames={**held.lock.frames, row: "0" * 64}))
    report = verify(PLAN, locked, options, quiet, files=FILES, dataset=wrong, engines=fakes.ENGINES)
    assert (report.verdict, report.stage) == ("FAIL", "observation")
    assert report.differences[0].message.startswith(f"{built}: ")
