"""Rows of a lockfile or manifest on which no sampled frame depends are compared too, or reported as not compared."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan, ScenePlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.versions import STAGES, host_versions
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.transfer.bundle import Pack
from recipe_runtime.verify import sampling
from recipe_runtime.verify.compare import Side
from recipe_runtime.verify.diff import differences as compared
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.motion_comparison import matching_traces
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify, verify_files

from tests.runtime import fakes
from tests.runtime.fakes import quiet
from tests.runtime.forging import edited, rewrite


def three_scenes() -> DatasetPlan:
    """Return three variants, each with its own scene."""
    first = fakes.dataset_plan(frames=4, weathers=1).variants[0]
    variants = tuple(
        first.model_copy(update={"variant": f"v={n}", "scene": _starting_at(first.scene, n)}) for n in range(3)
    )
    return fakes.dataset_plan(frames=4, weathers=1, variants=variants)


def _starting_at(scene: ScenePlan, x: int) -> ScenePlan:
    start = scene.actors[0].start.model_copy(update={"x": 4.0 + x / 4})
    return scene.model_copy(update={"actors": (scene.actors[0].model_copy(update={"start": start}), *scene.actors[1:])})


PLAN = three_scenes()


@pytest.fixture(scope="module")
def locked() -> Lockfile:
    return lock(PLAN, "tiny.yaml", {}, workers=0, progress=quiet, engines=fakes.ENGINES)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES))
    return root / "tiny"


@pytest.fixture
def copy(built: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(built, tmp_path / "tiny"))


def check(forged: Lockfile, **more: Any) -> Report:
    """Compare one frame with a lockfile."""
    engines = more.pop("engines", fakes.ENGINES)
    return verify(PLAN, forged, Options(nonce=1, count=1, workers=0), quiet, engines=engines, **more)


def check_folder(root: Path) -> Report:
    """Compare one frame of a dataset."""
    held = datasets.read(root)
    options = Options(nonce=1, count=1, workers=0)
    return verify(held.plan, held.lock, options, quiet, dataset=held, engines=fakes.ENGINES)


def edit_manifest(root: Path, edit: Any) -> None:
    """Change a manifest and make its identity agree, as a forger would."""
    with edited(root) as manifest:
        edit(manifest)
        manifest["identity"] = datasets.lock_of(manifest).identity


def test_an_unchanged_dataset_passes_without_notes(built: Path) -> None:
    report = check_folder(built)
    assert (report.verdict, report.differences, report.notes) == ("PASS", [], [])


@pytest.mark.parametrize("variant", ["v=0", "v=1", "v=2"])
def test_forged_tracks_fail_though_no_frame_of_the_scene_is_sampled(copy: Path, variant: str) -> None:
    path, text = f"{variant}/tracks.csv", b"frame,forged\n0,1\n"
    rewrite(copy, path, text)
    report = check_folder(copy)
    assert report.verdict == "FAIL"
    assert any(d.path == path for d in report.differences)


def test_a_forged_trace_digest_fails_though_no_frame_of_the_scene_is_sampled(locked: Lockfile) -> None:
    for scene in locked.traces:
        assert check(replace(locked, traces={**locked.traces, scene: "0" * 64})).verdict == "FAIL"


@pytest.mark.parametrize("variant", ["v=0", "v=1", "v=2"])
def test_a_dataset_with_a_forged_trace_digest_does_not_pass(copy: Path, variant: str) -> None:
    """A manifest does not record the C library, so a difference in motion is only INCONCLUSIVE."""
    edit_manifest(copy, lambda manifest: manifest["variants"][variant].update(trace="0" * 64))
    assert check_folder(copy).verdict != "PASS"


def test_scenes_that_are_not_simulated_are_reported(locked: Lockfile, monkeypatch: pytest.MonkeyPatch) -> None:
    """Verification simulates a limited number of scenes, and states what it omitted."""
    monkeypatch.setattr(sampling, "MAX_SCENES", 2)
    report = check(locked)
    assert report.verdict == "PASS"
    assert report.notes == ["the motion of 1 of 3 scenes, and so their tracks.csv and events.csv, was not compared"]


@pytest.mark.slow
def test_forged_rows_of_bodies_in_a_datasets_own_lockfile_fail(locked: Lockfile, copy: Path) -> None:
    path, name = "tiny.recipe", "lockfiles/tiny.lock"
    bodies = {key: replace(motion, digest="ab" * 32) for key, motion in locked.bodies.items()}
    for written, stages in ((locked, set()), (replace(locked, bodies=bodies), {"trace"})):
        body = Pack("tiny.yaml", {"tiny.yaml": b"", name: written.dumps().encode()}).dumps()
        rewrite(copy, path, body)
        edit_manifest(copy, lambda manifest: manifest.update(recipe_file=path))
        found = [d for d in check_folder(copy).differences if d.message.startswith(f"{path}/{name}: ")]
        assert {d.stage for d in found if d.excuse is None} == stages


@pytest.mark.parametrize("fault", ["no actors", "one frame", "other parts", "no rotations", "long rotations"])
def test_a_locked_trace_that_does_not_fit_its_scene_fails(locked: Lockfile, fault: str) -> None:
    """Otherwise frames would be rendered from this host's motion, against the report."""
    scene = PLAN.variants[0].scene
    true = fakes.simulate(scene)
    fields = ("positions", "rotations", "linear", "angular")
    trace = {
        "no actors": replace(true, actors=(), parts=(), **{name: getattr(true, name)[:, :0] for name in fields}),
        "one frame": replace(true, **{name: getattr(true, name)[:1] for name in fields}),
        "other parts": replace(true, parts=tuple(f"{part}x" for part in true.parts)),
        "no rotations": replace(true, rotations=np.zeros_like(true.rotations)),
        "long rotations": replace(true, rotations=true.rotations * 2),
    }[fault]
    assert isinstance(trace, Trace)
    forged = replace(
        locked,
        traces={**locked.traces, scene.digest: trace.digest},
        tools={**locked.tools, "glibc": "2.99"},
        bodies={key: replace(motion, digest="0" * 64) for key, motion in locked.bodies.items()},
    )
    report = check(forged, traces={scene.digest: trace})
    assert (report.verdict, report.stage) == ("FAIL", "trace")
    messages = [difference.message for difference in report.differences]
    assert any("has other frames, actors or parts than the scene" in message for message in messages)
    assert not any("from the locked motion on" in message for message in messages)


def test_a_locked_trace_with_fewer_parts_than_the_meshes_does_not_fit(locked: Lockfile) -> None:
    """A Trace with each actor's base alone has the form of other engines' motion; the renderer refused it."""
    scene = PLAN.variants[0].scene
    traces = {scene.digest: fakes.simulate(scene)}
    assert matching_traces(PLAN, locked, traces, fakes.ENGINES) == ([], traces)
    (difference,), kept = matching_traces(PLAN, locked, traces, replace(fakes.ENGINES, actors=real_engines().actors))
    assert "has other frames, actors or parts than the scene" in difference.message and not kept


def test_a_host_without_simulation_does_not_use_an_unfit_trace(locked: Lockfile) -> None:
    def simulate(scene: ScenePlan) -> Trace:
        raise RunError("no simulation here")

    scene = PLAN.variants[0].scene
    trace = replace(fakes.simulate(scene), parts=("a/base", "b/base", "c/base"))
    forged = replace(locked, traces={**locked.traces, scene.digest: trace.digest})
    with pytest.raises(RunError):
        check(forged, traces={scene.digest: trace}, engines=replace(fakes.ENGINES, simulate=simulate))


def test_a_forged_plan_digest_of_a_variant_fails(copy: Path) -> None:
    edit_manifest(copy, lambda manifest: manifest["variants"]["v=1"].update(plan="1" * 64))
    held = datasets.read(copy)
    for report in (check_folder(copy), verify_files(held, Options(nonce=1), quiet)):
        assert (report.verdict, report.stage) == ("FAIL", "plan")
        assert "manifest.json: the plan digest of v=1" in report.differences[0].message


def test_a_dataset_with_fewer_outputs_than_its_plan_digest_says_fails(locked: Lockfile, copy: Path) -> None:
    """Its own outputs determine which files it must have, so they must be those of the plan that it claims."""

    def cut(manifest: dict[str, Any]) -> None:
        manifest["outputs"]["annotations"] = []
        for path in [path for path in manifest["files"] if path.startswith(("annotations/", "mots/"))]:
            del manifest["files"][path]

    edit_manifest(copy, cut)
    for folder in ("annotations", "mots"):
        shutil.rmtree(copy / folder, ignore_errors=True)
    held = datasets.read(copy)
    assert held.lock.identity == locked.identity
    for report in (check(locked, dataset=held), verify_files(held, Options(nonce=1), quiet)):
        assert (report.verdict, report.stage) == ("FAIL", "plan")
    lockfile = Side("lockfile", held.lock, None, finished=True)
    side = Side("folder", held.lock, held.plan, listed={}, finished=True)
    (found,) = compared(lockfile, side)
    assert str(found).startswith("lockfile: folder was damaged or edited")


def test_variants_of_a_lockfile_in_another_order_fail(locked: Lockfile) -> None:
    """The identity depends on their order, and a PASS shows the identity."""
    forged = replace(locked, variants=dict(reversed(locked.variants.items())))
    assert forged.identity != locked.identity
    report = check(forged)
    assert (report.verdict, report.stage) == ("FAIL", "plan")


def test_versions_of_a_dataset_are_noted_that_is_compared_with_a_lockfile(locked: Lockfile, copy: Path) -> None:
    edit_manifest(copy, lambda manifest: manifest["tools"].update(numpy="1.0.0"))
    report = check(locked, dataset=datasets.read(copy))
    assert len([note for note in report.notes if "numpy 1.0.0" in note]) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tools", "message"),
    [
        ({"evil": "9.9"}, "it lists 1 unknown tool (first: 'evil')"),
        ({**host_versions(), "evil": "9.9"}, "it lists 1 unknown tool (first: 'evil')"),
        ({**host_versions(), "numpy": "two"}, "it lists 1 malformed version (first: 'two' of 'numpy')"),
        ({**host_versions(), "numpy": "2\x1b[31m"}, "it lists 1 malformed version (first: '2\\x1b[31m' of 'numpy')"),
    ],
)
def test_rows_of_tools_have_known_names_and_versions(
    locked: Lockfile, copy: Path, tools: dict[str, str], message: str
) -> None:
    assert [d.message for d in check(replace(locked, tools=tools)).differences] == [message]
    edit_manifest(copy, lambda manifest: manifest.update(tools=tools))
    held = datasets.read(copy)
    reports = (
        check_folder(copy),
        verify_files(held, Options(nonce=1), quiet),
        check(locked, dataset=held),  # a recipe's lockfile and a dataset of another one
    )
    for report in reports:
        assert report.verdict == "FAIL"
        assert any(message in d.message for d in report.differences)


OURS = host_versions()
TOOLS = "the recorded versions of tools differ from those here: "


@pytest.mark.parametrize(
    ("stages", "tools", "note"),
    [
        (STAGES, {k: v for k, v in OURS.items() if k != "numpy"}, "versions of tools are not recorded: numpy"),
        (STAGES, {**OURS, "numpy": "1.0"}, f"{TOOLS}numpy 1.0 (here {OURS['numpy']})"),
        (  # which may list tools that this one does not know
            STAGES,
            {**OURS, "dataset-recipe": "99.0", "scipy": "1.0"},
            f"{TOOLS}dataset-recipe 99.0 (here {OURS['dataset-recipe']})",
        ),
        (
            {**STAGES, "observe": 2},
            OURS,
            "the recorded versions of stages differ from those of this release: observe 2 (here 1)",
        ),
    ],
)
def test_other_versions_with_equal_frames_are_noted(
    locked: Lockfile, stages: dict[str, int], tools: dict[str, str], note: str
) -> None:
    report = check(replace(locked, stages=stages, tools=tools))
    assert (report.verdict, report.notes) == ("PASS", [note])


@pytest.mark.parametrize("forge", [lambda rows: rows.update(rgb=["0" * 64] * 4), lambda rows: rows.pop("rgb")])
def test_forged_colours_of_a_variant_with_an_equal_plan_are_refused(tmp_path: Path, forge: Any) -> None:
    """Variants with equal plans have equal colours, and one set of rows in a lockfile: the last one's."""
    first = fakes.dataset_plan(frames=4, weathers=1).variants[0]
    twins = tuple(first.model_copy(update={"variant": name}) for name in ("a", "b"))
    plan = fakes.dataset_plan(frames=4, weathers=1, variants=twins)
    build(plan, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=fakes.ENGINES))
    assert check_folder(tmp_path / "tiny").verdict == "PASS"
    manifest = json.loads((tmp_path / "tiny/manifest.json").read_text())
    forge(manifest["variants"]["a"]["frames"]["street"])
    (tmp_path / "tiny/manifest.json").write_text(pretty(manifest))
    with pytest.raises(InputError, match="the digests of 'b' differ from those of 'a'"):
        datasets.read(tmp_path / "tiny")


@pytest.mark.parametrize("stages", [{}, {**STAGES, "paint": 1}])
def test_a_dataset_has_the_stages_of_its_lockfile(locked: Lockfile, copy: Path, stages: dict[str, int]) -> None:
    edit_manifest(copy, lambda manifest: manifest.update(stages=stages))
    report = check(locked, dataset=datasets.read(copy))
    assert (report.verdict, report.stage) == ("FAIL", "lockfile")
