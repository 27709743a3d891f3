"""`recipe diff` names the first cause of a difference, and reports what it could not compare."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from recipe_compiler.ir.lockfile import Lockfile
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.dataset.digests import bare
from recipe_runtime.verify.compare import Side
from recipe_runtime.verify.diff import differences, left_out
from recipe_runtime.verify.documents import walk
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verdict import Difference

from tests.runtime.fakes import ENGINES, dataset_plan, quiet


def _locked(plan: DatasetPlan, files: dict[str, str] | None = None) -> Lockfile:
    return lock(plan, "tiny.yaml", files or {"tiny.yaml": "aa"}, workers=0, progress=quiet, engines=ENGINES)


@pytest.fixture(scope="module")
def ours() -> Side:
    plan = dataset_plan(frames=6)
    return Side("ours", _locked(plan), plan)


def _with(side: Side, **changes: Any) -> Side:
    return Side("theirs", replace(side.lock, **changes), side.plan)


def test_nothing_differs_from_itself(ours: Side) -> None:
    assert differences(ours, ours) == []
    assert left_out(ours, ours) == []


def test_a_difference_shared_by_variants_is_reported_once(ours: Side) -> None:
    assert ours.plan is not None
    document = ours.plan.model_dump(mode="json")
    for variant in document["variants"]:
        variant["appearance"]["weather"]["fog_density"] = 40.0
    plan = DatasetPlan.model_validate_json(json.dumps(document))
    (found,) = differences(ours, Side("theirs", bare(plan, "", {}), plan))
    assert str(found) == (
        "plan: 4 variants (first: weather=w0,jitter=still): appearance.weather.fog_density: 0.0 and 40.0"
    )


def test_another_order_of_named_items_is_a_difference(ours: Side) -> None:
    """A later patch covers an earlier one, so the order of named items changes pixels; none was reported."""
    assert ours.plan is not None
    document = ours.plan.model_dump(mode="json")
    for variant in document["variants"]:
        variant["rig"]["sensors"].reverse()
    plan = DatasetPlan.model_validate_json(json.dumps(document))
    (found,) = differences(Side("ours", bare(ours.plan, "", {}), ours.plan), Side("theirs", bare(plan, "", {}), plan))
    assert found.message.endswith("rig.sensors: the entries are in another order")
    assert list(walk({"a": [{"name": "x"}, {"name": "y"}]}, {"a": [{"name": "y"}, {"name": "z"}]}, "")) == [
        ".a[x] is in the first only",
        ".a[z] is in the second only",
    ]


def test_plans_of_different_digests_always_differ(ours: Side, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ours.plan is not None
    monkeypatch.setattr("recipe_runtime.verify.documents.walk", lambda *_: iter(()))
    document = ours.plan.model_dump(mode="json")
    document["variants"][0]["scene"]["actors"][0]["speed"] += 1.0
    plan = DatasetPlan.model_validate_json(json.dumps(document))
    (found,) = differences(Side("ours", bare(ours.plan, "", {}), ours.plan), Side("theirs", bare(plan, "", {}), plan))
    assert found.message.startswith("the plans have different digests")


def test_the_first_body_that_diverges_is_named_with_its_frame(ours: Side) -> None:
    (scene,) = ours.lock.traces
    bodies = dict(ours.lock.bodies)
    for actor, frame in (("hero2", 2), ("van", 4)):
        motion = bodies[scene, actor]
        points = tuple("0" * 8 if k >= frame else p for k, p in enumerate(motion.checkpoints))
        bodies[scene, actor] = replace(motion, digest="0" * 64, checkpoints=points)
    found = differences(ours, _with(ours, bodies=bodies, traces={scene: "0" * 64}))
    assert found == [Difference("trace", "body hero2 diverges at frame 2; 2 bodies differ")]


def test_frames_are_counted_by_modality_with_labels_first(ours: Side) -> None:
    frames = dict(ours.lock.frames)
    for key in [k for k in frames if k[1] == "side" and (k[2], k[3]) in {("rgb", 1), ("rgb", 4), ("instance", 2)}]:
        frames[key] = "0" * 64
    found = differences(ours, _with(ours, frames=frames))
    assert [f.stage for f in found] == ["observation", "observation", "shading", "shading", "shading", "shading"]
    assert "side: instance of 1 of 6 frames differs (first: frame 2)" in found[0].message
    assert "side: rgb of 2 of 6 frames differs (first: frame 1)" in found[-1].message


def test_files_stages_and_tools_come_first(ours: Side) -> None:
    other = _with(
        ours,
        files={"tiny.yaml": "bb", "street.yaml": "cc"},
        tools={**ours.lock.tools, "numpy": "9"},
        stages={**ours.lock.stages, "shade": 9},
        plan="0" * 64,
    )
    numpy = ours.lock.tools["numpy"]
    assert [str(f) for f in differences(ours, other)] == [
        "recipe: tiny.yaml differs",
        "recipe: street.yaml is in theirs only",
        "tools: stage shade: 1 and 9",
        f"tools: numpy: {numpy} and 9",
    ]


def test_a_renamed_recipe_with_equal_bytes_does_not_differ(ours: Side) -> None:
    assert differences(ours, _with(ours, files={"other.yaml": "aa"})) == []
    (found,) = differences(ours, _with(ours, files={"other.yaml": "bb"}, plan="0" * 64))
    assert found.message == "tiny.yaml and other.yaml differ"


def test_another_text_with_an_equal_plan_is_a_note(ours: Side) -> None:
    """A changed comment, for example."""
    other = _with(ours, files={"tiny.yaml": "bb"})
    assert differences(ours, other) == []
    assert left_out(ours, other) == ["the text of ours and theirs differs; the plan does not"]


def test_missing_information_of_one_side_is_reported(ours: Side) -> None:
    assert ours.plan is not None
    recipe = Side("a.yaml", bare(ours.plan, "", {}), ours.plan)
    assert differences(ours, recipe) == []
    (note,) = left_out(ours, recipe)
    assert note == "motion and pixels were not compared: a.yaml holds none; `recipe lock` makes a lockfile"


def test_the_report_states_that_datasets_are_compared_by_manifest(ours: Side) -> None:
    """Otherwise `nothing differs` would suggest that the files had been read."""
    one, other = replace(ours, listed={"README.md": "aa"}), replace(ours, name="theirs", listed={"README.md": "aa"})
    assert differences(one, other) == []
    check = "`recipe verify` checks the files themselves"
    assert left_out(one, other) == [f"ours and theirs were compared by their manifests; {check}"]
    assert left_out(one, ours) == [f"ours was compared by its manifest; {check}"]


def test_differing_files_come_last_in_the_order_of_their_creation(ours: Side) -> None:
    """Without an earlier cause, each file is named, sources before derived files."""
    picture, labels = "weather=w0,jitter=still/side/rgb/000000.png", "weather=w0,jitter=still/side/labels.jsonl"
    made = [picture, labels, "annotations/kwcoco.json", "preview/contact_sheet.png", "README.md"]
    one = replace(ours, listed=dict.fromkeys(made, "aa"))
    other = replace(ours, name="theirs", listed=dict.fromkeys(sorted(made), "bb") | {"plans/x.json": "aa"})
    assert [str(f) for f in differences(one, other)] == [
        "file: plans/x.json is in theirs only",
        *(f"file: {path} has other bytes" for path in made),
    ]
    caused = differences(one, replace(other, lock=replace(ours.lock, tools={**ours.lock.tools, "zlib-ng": "9"})))
    assert [f.stage for f in caused] == ["tools", "file"]
    assert caused[-1].message == "6 of 6 files differ, the first: plans/x.json is in theirs only"


def test_variants_and_outputs_of_one_side_are_reported_in_sentences(ours: Side) -> None:
    assert ours.plan is not None
    plan = DatasetPlan(
        recipe=ours.plan.recipe, description="", variants=ours.plan.variants[:2], annotations=(), forms={"depth": "npy"}
    )
    asked = ", ".join(ours.plan.annotations)
    assert [str(f) for f in differences(ours, Side("theirs", bare(plan, "", {}), plan))] == [
        *(f"plan: variant {variant.variant} is in ours only" for variant in ours.plan.variants[2:]),
        f"plan: output.annotations: {asked} in ours, none in theirs",
        "plan: output.depth: carla in ours, npy in theirs",
    ]


def test_two_plans_of_different_variants_are_compared_by_content(ours: Side) -> None:
    """Regression: two expanded plans were always reported as variants of one side only."""
    assert ours.plan is not None
    plans = [
        DatasetPlan(recipe="a", description="", variants=(variant,), annotations=())
        for variant in ours.plan.variants[:2]
    ]
    names = [plan.variants[0].variant for plan in plans]
    first, *others = differences(*(Side(f"{n}.json", bare(plan, "", {}), plan) for n, plan in enumerate(plans)))
    assert first.message == f"0.json is variant {names[0]}, and 1.json is variant {names[1]}"
    assert others and all(" and " in found.message for found in others), others


def test_values_are_written_as_in_a_recipe() -> None:
    ours = {"on": None, "spans": [[1, 2], "dry"], "actors": [{"name": "hero"}, {"name": "van", "speed": 2.0}]}
    theirs = {"on": "hero", "spans": [{"low": 1}, "wet"], "actors": [{"name": "van", "speed": 3.0}]}
    assert list(walk(ours, theirs, "rig")) == [
        "rig.on: nothing and hero",
        'rig.spans[0]: [1, 2] and {"low": 1}',
        "rig.spans[1]: dry and wet",
        "rig.actors[hero] is in the first only",
        "rig.actors[van].speed: 2.0 and 3.0",
    ]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lock: {"frames": {}}, "frame rows are in ours only"),
        (lambda lock: {"traces": {}}, "1 trace row is in ours only"),
        (lambda lock: {"frames": {}, "traces": {}}, "1 trace row is in ours only"),
        (lambda lock: {"frames": dict(list(lock.frames.items())[1:])}, "1 frame row is in ours only"),
        (lambda lock: {"frames": {**lock.frames, ("0", "x", "rgb", 0): "0"}}, "1 frame row is in theirs only"),
        (lambda lock: {"bodies": dict(list(lock.bodies.items())[1:])}, "1 body row is in ours only"),
        (lambda lock: {"stages": {}}, "stage rows are in ours only"),
        (lambda lock: {"recipe": "other"}, "ours is of the recipe 'tiny', theirs of 'other'"),
        (lambda lock: {"sealed": False}, "theirs was damaged or edited"),
        (lambda lock: {"plan": "0" * 64}, "the identities differ"),
        (
            lambda lock: {"bodies": {key: replace(row, digest="0" * 64) for key, row in lock.bodies.items()}},
            "3 body rows differ although the trace rows agree",
        ),
    ],
)
def test_lockfiles_with_missing_rows_differ(ours: Side, change: Any, says: str) -> None:
    """Exit code 0 means equal, so rows of one side only, another name and a broken seal must be differences."""
    side = replace(_with(ours, **change(ours.lock)), finished=True)
    assert any(says in str(finding) for finding in differences(ours, side))
    assert differences(side, ours)


def test_a_dataset_with_another_digest_of_a_plan_differs(ours: Side) -> None:
    assert ours.plan is not None
    digests = {variant.variant: variant.digest for variant in ours.plan.variants}
    assert not differences(replace(ours, plan_digests=digests), ours)
    forged = replace(ours, plan_digests=digests | {ours.plan.variants[1].variant: "0" * 64})
    for found in (differences(forged, ours), differences(ours, forged)):
        assert "has another plan digest for variant" in str(found[0])
