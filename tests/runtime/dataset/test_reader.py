"""A dataset's folder is untrusted: every error is one line, and links out of the folder are never followed."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import pycocotools.mask
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.canonical import canonical_bytes, digest
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import Point, ScenePlan, SensorPlan
from recipe_runtime.annotate.mots import runs_fill
from recipe_runtime.annotate.records import label_digest
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.core.layout import expected_files, is_of_page
from recipe_runtime.core.trace import Trace
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.manifest import is_whole, lock_of
from recipe_runtime.dataset.manifest_types import Manifest
from recipe_runtime.dataset.plan_checks import check_bounds
from recipe_runtime.dataset.text_files import instances_of, labels_of
from recipe_runtime.dataset.tracks import tracks_csv

from tests.runtime import fakes
from tests.runtime.forging import rewrite

PLAN = fakes.dataset_plan(frames=4)
STREET = "weather=w0,jitter=still/street"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("built")
    return build(PLAN, root / "tiny", BuildOptions(workers=0, cache=root / "cache", engines=fakes.ENGINES)).path


@pytest.fixture
def copy(built: Path, tmp_path: Path) -> Path:
    shutil.copytree(built, tmp_path / "tiny")
    return tmp_path / "tiny"


def manifest_of(root: Path) -> Manifest:
    manifest: Manifest = json.loads((root / "manifest.json").read_text())
    return manifest


def damage(root: Path) -> list[str]:
    return [line for _, line in datasets.damaged_files(datasets.read(root), lambda *_: None)]


def differences(root: Path) -> list[str]:
    traces = {
        scene.digest: fakes.simulate(scene) for scene in {v.scene.digest: v.scene for v in PLAN.variants}.values()
    }
    return [line for _, line in datasets.text_differences(datasets.read(root), traces)]


def test_a_built_dataset_is_intact(built: Path) -> None:
    assert damage(built) == differences(built) == []
    paths = {p.relative_to(built).as_posix() for p in built.rglob("*") if p.is_file()}
    assert {path for path in paths if not is_of_page(path)} == expected_files(PLAN)
    assert paths - expected_files(PLAN) <= {*manifest_of(built)["pictures"]}
    assert is_whole(manifest_of(built), PLAN, built)


def test_motion_files_are_stored_and_compared_once_for_a_scene(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recipe may have thousands of weathers of one long scene; its motion must not be written for each again."""
    scenes = {variant.scene.digest for variant in PLAN.variants}
    for name in ("tracks.csv", "events.csv"):
        inodes = {path.stat().st_ino for path in built.glob(f"*/{name}")}
        assert len(scenes) <= len(inodes) < len(PLAN.variants)
    made = list[str]()

    def tracks(scene: ScenePlan, trace: Trace) -> Iterator[bytes]:
        made.append(scene.digest)
        return tracks_csv(scene, trace)

    monkeypatch.setattr(datasets, "tracks_csv", tracks)
    assert differences(built) == []
    assert sorted(made) == sorted(scenes)


@pytest.mark.slow
def test_large_labels_are_read_frame_by_frame(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Labels of all videos must not be in memory at once, or an untrusted dataset could exhaust it."""
    opened, original = list[str](), datasets.labels

    def labels(dataset: Any, variant: Any, sensor: Any) -> Any:
        opened.append(sensor.name)
        return original(dataset, variant, sensor)

    monkeypatch.setattr(datasets, "labels", labels)
    assert differences(copy) == []
    videos = len(opened)
    monkeypatch.setattr(datasets, "_MAX_KEPT", 0)
    assert differences(copy) == []
    assert len(opened) >= 4 * videos  # for the check, then for tracks and annotations of kwcoco, coco and README
    path = copy / "annotations" / "kwcoco.json"
    body = path.read_bytes()
    path.unlink()
    path.write_bytes(body.replace(b'"area":', b'"area": '))
    assert [line.partition(" ")[0] for line in differences(copy)] == ["annotations/kwcoco.json"]


def renamed(root: Path, old: str, new: str) -> None:
    """Rename a variant or sensor everywhere in the folder, in plan and manifest."""
    manifest = json.loads((root / "manifest.json").read_text().replace(json.dumps(old), json.dumps(new)))
    for name in manifest["order"]:
        path = f"plans/{name.replace('.', '_')}.json"
        source = root / path if (root / path).is_file() else root / f"plans/{old}.json"
        body = source.read_text().replace(json.dumps(old), json.dumps(new)).encode()
        target = root / "plans" / path.removeprefix("plans/")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(body)
        manifest["files"][path] = {"size": len(body), "sha256": "0" * 64}
    (root / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize("old", ["weather=w0,jitter=still", "street"])
@pytest.mark.parametrize("name", ["../up", "/absolute", "a/b"])
def test_no_name_leads_out_of_the_folder(copy: Path, tmp_path: Path, old: str, name: str) -> None:
    name = str(tmp_path / "outside") if name == "/absolute" else name
    renamed(copy, old, name)
    with pytest.raises(
        InputError, match=r"cannot be a folder's name|is not a path within|is not among its files|another folder"
    ):
        datasets.read(copy)


@pytest.mark.parametrize("path", ["/etc/passwd", "../secret", "a/../../b", "a//b", ""])
def test_no_path_in_the_manifest_leads_out_of_the_folder(copy: Path, path: str) -> None:
    manifest = manifest_of(copy)
    manifest["files"][path] = {"size": 1, "sha256": "0" * 64}
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="is not a path within a dataset"):
        datasets.read(copy)


DAMAGES: list[Callable[[dict[str, Any]], Any]] = [
    lambda m: m.update(order=[1, 2]),
    lambda m: m["order"].reverse() or m["variants"].clear(),
    lambda m: m.update(order=[], variants={}),
    lambda m: m["variants"][m["order"][0]].update(frames=[1, 2]),
    lambda m: m["files"]["README.md"].update(size=-1),
]


@pytest.mark.parametrize("harm", DAMAGES)
def test_a_damaged_manifest_is_an_error_of_one_line(copy: Path, harm: Callable[[dict[str, Any]], Any]) -> None:
    manifest = manifest_of(copy)
    harm(cast(dict[str, Any], manifest))
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="is damaged") as caught:
        datasets.read(copy)
    assert len(str(caught.value).splitlines()) == 1
    # building again, without moving it, refuses a folder without a manifest that can be read
    assert caught.value.problems[0].help == "move the folder away, and build the dataset again"


@pytest.mark.parametrize("is_other", [False, True])
def test_a_plan_of_another_version_is_not_called_damaged_only(copy: Path, is_other: bool) -> None:
    """As of a dataset from before a weather parameter was added."""
    manifest: Any = manifest_of(copy)
    if is_other:
        manifest["stages"]["plan"] += 1
    path = copy / f"plans/{manifest['order'][0]}.json"
    plan = json.loads(path.read_text())
    del plan["appearance"]["weather"]["wetness"]
    (copy / "manifest.json").write_text(json.dumps(manifest))
    path.write_text(json.dumps(plan))
    why = "made by other versions of stages or tools; " * is_other
    with pytest.raises(InputError, match=rf"or of another version \(plans/.*: {why}Object missing") as caught:
        datasets.read(copy)
    assert str(caught.value.problems[0].help).endswith("build the dataset again")


def test_a_manifest_in_another_order_than_the_plan_is_refused(copy: Path) -> None:
    first, second = (copy / f"plans/{name}.json" for name in manifest_of(copy)["order"][:2])
    first.write_bytes(second.read_bytes())
    with pytest.raises(InputError, match="is the plan of"):
        datasets.read(copy)


def street(**values: Any) -> SensorPlan:
    sensor = fakes.sensor_plan()
    camera = sensor.camera.model_copy(update={k: v for k, v in values.items() if k in type(sensor.camera).model_fields})
    return sensor.model_copy(update={"camera": camera, **{k: v for k, v in values.items() if k in ("on", "poses")}})


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (street(lens_k=0.9, fov=170), "its lens needs a view wider than"),
        (street(on="nobody"), "on 'nobody'"),
        (street(poses=()), "poses are neither"),
    ],
)
def test_a_sensor_out_of_bounds_is_refused(sensor: SensorPlan, message: str) -> None:
    variant = PLAN.variants[0]
    rig = variant.rig.model_copy(update={"sensors": (sensor,)})
    with pytest.raises(InputError, match=message):
        check_bounds(PLAN.model_copy(update={"variants": (variant.model_copy(update={"rig": rig}),)}))


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("rig", "sensors", 0, "camera", "width"), 100_000),
        (("rig", "sensors", 0, "camera", "near"), 5_000.0),  # beyond the far plane
        (("rig", "sensors", 0, "camera", "lens_k"), 50.0),
        (("appearance", "responses", "street", "supersample"), 5),
        (("appearance", "responses", "street", "shutter_speed"), 0.0),
        (("scene", "clock", "fps"), 0),
        (("scene", "clock", "fps"), 7),  # no divisor of the physics rate
        (("scene", "clock", "frames"), 10**9),
    ],
)
def test_a_value_out_of_its_range_is_refused(tmp_path: Path, place: tuple[str | int, ...], value: float) -> None:
    document: Any = PLAN.variants[0].document()
    here = document
    for step in place[:-1]:
        here = here[step]
    assert place[-1] in here
    here[place[-1]] = value
    (tmp_path / "plan.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"cannot be read as a plan: [a-z.]+[.:].*"):
        datasets.plan_alone(tmp_path / "plan.json")


@pytest.mark.slow
def test_routes_and_warm_ups_out_of_bounds_are_refused() -> None:
    variant = PLAN.variants[0]
    ends = tuple(Point(x=1e5 * (-1) ** k, y=0.0) for k in range(100))
    actors = tuple(a.model_copy(update={"route": ends}) for a in variant.scene.actors)
    clock = variant.scene.clock.model_copy(update={"warmup": 600.0})
    for changes, message in (
        ({"actors": actors}, "km long, and at most"),
        ({"clock": clock}, "steps of simulation are over"),
    ):
        scenes = [variant.scene.model_copy(update=changes) for _ in range(1000 if "clock" in changes else 1)]
        towns = [variant.scene.town.model_copy(update={"name": f"t{n}"}) for n in range(len(scenes))]
        parts = zip(scenes, towns, strict=True)
        several = tuple(
            variant.model_copy(update={"variant": f"v{n}", "scene": scene.model_copy(update={"town": town})})
            for n, (scene, town) in enumerate(parts)
        )
        with pytest.raises(InputError, match=message):
            check_bounds(PLAN.model_copy(update={"variants": several}))


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b'[{"counts": 5}]\n',
        b"[" * 100_000,
        b"\xff\n",
        b'["\\ud800"]\n',
    ],
)
def test_malformed_labels_are_reported(copy: Path, line: bytes) -> None:
    path = f"{STREET}/labels.jsonl"
    rest = (copy / path).read_bytes().split(b"\n", 1)[1]
    rewrite(copy, path, line + rest)
    (message,) = differences(copy)
    assert message.startswith(f"{path}: line 1: ")
    assert len(message) < 300


def test_surplus_labels_are_reported(copy: Path) -> None:
    path = f"{STREET}/labels.jsonl"
    rewrite(copy, path, (copy / path).read_bytes() + b"[]\n")
    assert differences(copy) == [f"{path}: it has more lines than frames"]


@pytest.mark.parametrize("path", [f"{STREET}/rgb/000002.png", "annotations/kwcoco.json", f"{STREET}/labels.jsonl"])
def test_a_removed_file_is_reported_though_the_manifest_matches(copy: Path, path: str) -> None:
    (copy / path).unlink()
    manifest = manifest_of(copy)
    del manifest["files"][path]
    (copy / "manifest.json").write_text(json.dumps(manifest))
    assert damage(copy) == [f"{path} is missing and not in the manifest"]


def test_an_added_file_is_reported_though_the_manifest_matches(copy: Path) -> None:
    (copy / f"{STREET}/rgb/000004.png").write_bytes(b"one frame more")
    rewrite(copy, f"{STREET}/rgb/000004.png", b"one frame more")
    assert damage(copy) == [f"{STREET}/rgb/000004.png is in the manifest but is not a file of this plan"]


def test_removed_digests_are_reported(copy: Path) -> None:
    manifest = manifest_of(copy)
    for variant in manifest["variants"].values():
        variant["frames"]["street"]["rgb"].pop()
        variant["frames"]["side"]["depth"] = ["0" * 64]
    (copy / "manifest.json").write_text(json.dumps(manifest))
    assert damage(copy) == [
        "manifest.json: 4 frames of the plan have no digest, the first: street, rgb, frame 3",
        "manifest.json: 2 digests are of no frame of the plan, the first: side, depth, frame 0",
    ]


def test_links_pipes_and_empty_folders_are_reported_and_never_opened(copy: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes((copy / "README.md").read_bytes())
    (copy / "README.md").unlink()
    (copy / "README.md").symlink_to(secret)
    os.mkfifo(copy / "pipe")
    (copy / "annotations" / "kwcoco.json").unlink()
    os.mkfifo(copy / "annotations" / "kwcoco.json")
    (copy / "up").symlink_to("..")
    (copy / "empty").mkdir()
    (copy / "mots" / "instances").rename(tmp_path / "instances")
    (copy / "mots" / "instances").symlink_to(tmp_path / "instances")
    found = damage(copy)
    for message in (
        "README.md is a link, not a file",
        "pipe is not in the manifest, and is a device",
        "annotations/kwcoco.json is a device, not a file",
        "up is not in the manifest, and is a link",
        "empty/ is a folder without a file of this plan",
        "mots/instances is not in the manifest, and is a link",
    ):
        assert message in found
    assert differences(copy) == [
        f"{path} is missing or cannot be read" for path in ("annotations/kwcoco.json", "README.md")
    ]


def test_a_manifest_that_is_inconsistent_or_of_other_tools_is_not_intact(copy: Path) -> None:
    edited, older = manifest_of(copy), manifest_of(copy)
    edited["variants"]["weather=w0,jitter=still"]["frames"]["street"]["rgb"][0] = "0" * 64
    older["tools"]["zlib-ng"] = "0.1"
    assert not is_whole(edited, PLAN, copy)
    assert not is_whole(older, PLAN, copy)
    no_digests, no_files = manifest_of(copy), manifest_of(copy)
    for modality in no_digests["variants"]["weather=w0,jitter=still"]["frames"]["street"].values():
        modality.clear()
    for variant in no_digests["variants"].values():
        variant["frames"] = no_digests["variants"]["weather=w0,jitter=still"]["frames"]
    no_digests["identity"] = lock_of(no_digests).identity
    del no_files["files"][f"{STREET}/rgb/000001.png"]
    assert not is_whole(no_digests, PLAN, copy)
    assert not is_whole(no_files, PLAN, copy)
    picture = copy / STREET / "rgb" / "000000.png"
    target = copy / STREET / "rgb" / "000001.png"
    picture.unlink()
    picture.symlink_to(target)
    assert not is_whole(manifest_of(copy), PLAN, copy)


def test_only_valid_run_length_codes_reach_pycocotools(built: Path) -> None:
    found = 0
    for line in (built / STREET / "labels.jsonl").read_text().splitlines():
        for record in json.loads(line)["objects"]:
            assert runs_fill(record["counts"], 48 * 64)
            assert not runs_fill(record["counts"], 48 * 64 - 1)
            assert not runs_fill(record["counts"][:-1], 48 * 64)
            found += 1
    assert found > 4
    for code, pixels in (("", 1), ("o" * 40, 1), ("\x7f", 1), ("0", 1), ("01o", 0)):
        assert not runs_fill(code, pixels)


@pytest.mark.slow
@settings(deadline=None)
@given(st.lists(st.integers(0, 3), min_size=42, max_size=42), st.integers(41, 43), st.data())
def test_run_length_codes_of_pycocotools_are_accepted(pixels: list[int], size: int, data: st.DataObject) -> None:
    mask = np.asfortranarray((np.array(pixels).reshape(6, 7) > 1).astype(np.uint8))
    code = pycocotools.mask.encode(mask)["counts"].decode()
    assert runs_fill(code, size) == (size == 42)
    assert not runs_fill(code + data.draw(st.sampled_from("1P")), 42)


def test_a_manifest_that_is_a_pipe_or_a_link_is_refused(copy: Path) -> None:
    (copy / "manifest.json").rename(copy / "elsewhere.json")
    (copy / "manifest.json").symlink_to("elsewhere.json")
    with pytest.raises(InputError, match="is not a dataset"):
        datasets.read(copy)
    (copy / "manifest.json").unlink()
    os.mkfifo(copy / "manifest.json")
    with pytest.raises(InputError, match="is not a dataset"):
        datasets.read(copy)


def test_control_characters_are_escaped_and_deep_folders_not_entered(copy: Path) -> None:
    (copy / "\x1b[2J").write_bytes(b"")
    (copy / os.fsdecode(b"\xff")).write_bytes(b"")
    deep = copy / "deep"
    for _ in range(600):
        deep = deep / "d"
    deep.mkdir(parents=True)
    assert damage(copy) == [
        r"'\x1b[2J' is not in the manifest",
        "deep/ is a folder without a file of this plan",
        r"'\udcff' is not in the manifest",
    ]


def test_labels_with_other_fields_or_too_many_values_are_refused(built: Path) -> None:
    """A manifest can list the digest of any line, so its content is bounded by the scene and the picture."""
    dataset = datasets.read(built)
    variant = dataset.plan.variants[0]
    sensor, actors = variant.rig.sensors[0], instances_of(variant.scene)
    line = (built / layout.labels_file(variant.variant, sensor.name)).read_bytes().splitlines(keepends=True)[0]
    labels = json.loads(line)
    assert labels_of(line, 0, label_digest(labels), sensor, actors) == labels
    first, calibration = labels["objects"][0], labels["calibration"]
    forgeries: tuple[Any, ...] = (
        [{**first, "velocity": [0.0] * 4}],
        [{**first, "box3d": {**first["box3d"], "more": 1}}],
        [{**first, "bbox": [1e308, 0, 1, 1]}],
        [{**first, "actor": "ghost"}],
        [{**first, "instance": first["instance"] + 1}],
        [first, first],
        [{**first, "counts": first["counts"] + "0" * 100_000}],
    )
    frames: list[Any] = [
        {**labels, "more": 1},
        {**labels, "frame": 1},
        {**labels, "calibration": {**calibration, "K": [[1.0] * 3] * 4}},
        [],
    ]
    for forged in [*({**labels, "objects": objects} for objects in forgeries), *frames]:
        body = canonical_bytes(forged) + b"\n"
        with pytest.raises(ValueError, match=r"no label has|actors|more runs|another frame|digest stands|canonical"):
            labels_of(body, 0, digest("labels/2", forged), sensor, actors)


def test_a_missing_folder_suggests_the_nearest_name(built: Path, tmp_path: Path) -> None:
    for wrong, what in ((built.parent, "is not a dataset"), (built.with_name("tinny"), "there is no such folder")):
        with pytest.raises(InputError, match=f"{what}.*; did you mean {built}"):
            datasets.read(wrong)
    with pytest.raises(InputError, match="there is no such folder; name a folder that `recipe build` made"):
        datasets.read(tmp_path / "zebra")


def test_an_unreadable_dataset_is_not_reported_as_damaged(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Building it again, the remedy for damage, would not help."""

    def refuse(root: Path) -> Manifest:
        raise PermissionError(13, "Permission denied", str(root))

    monkeypatch.setattr(manifest_reader, "read", refuse)
    with pytest.raises(InputError, match="cannot be read: Permission denied; allow this user to read the folder"):
        datasets.read(copy)


FORGERIES: list[Callable[[dict[str, Any]], Any]] = [
    lambda row: row.update(trace="0" * 64),
    lambda row: row["frames"]["street"]["labels"].__setitem__(1, "0" * 64),
    lambda row: row["frames"]["street"].pop("depth"),
    lambda row: row["frames"].update(other={"rgb": ["0" * 64]}),
    lambda row: row.update(intervals={"other": 7}),
]


@pytest.mark.parametrize("forge", FORGERIES)
def test_rows_that_variants_share_must_be_equal(copy: Path, forge: Callable[[dict[str, Any]], None]) -> None:
    """Regression: only the last variant of a scene counted, so false digests in all others passed verification."""
    manifest: Any = manifest_of(copy)
    assert len(manifest["order"]) > 1
    forge(manifest["variants"][manifest["order"][0]])
    (copy / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match=r"which has the same scene|no sensor of its plan"):
        datasets.read(copy)
