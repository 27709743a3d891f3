"""Ground truth of patches: corners by another projection, masks by the picture, and the files of a build."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pycocotools.mask
import pytest
import recipe_runtime
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir import optics
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.patches import STATIC, PatchFace
from recipe_compiler.ir.plan import CameraPlan, Pose
from recipe_runtime.attacks.truth import FrameTruth
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.dataset import reader
from recipe_runtime.insertion import projection
from recipe_runtime.loading import opened
from recipe_runtime.verify.verify import Options, verify_files

from tests.compiler.modelling import picture, png

FACE = PatchFace(
    part=STATIC,
    corner=(5.0, 1.0, 2.0),
    right=(0.0, -1.0, 0.0),
    down=(0.0, 0.0, -1.0),
    width=2.0,
    height=1.5,
    reach=0.02,
)
LENSES = [(0.0, 0.0), (0.25, 0.0), (-0.1, 0.05), (0.1, 0.3)]


def pinhole(camera: CameraPlan, pose: NDArray[np.float64], point: tuple[float, ...]) -> NDArray[np.float64]:
    """Return a point's pixel and depth, computed with matrices."""
    focal = camera.width / 2 / np.tan(np.radians(camera.fov) / 2)
    local = np.linalg.inv(np.vstack([pose, [0, 0, 0, 1]])) @ [*point, 1.0]
    x, y, z = -local[1], -local[2], local[0]
    return np.array([camera.width / 2 + focal * x / z, camera.height / 2 + focal * y / z, z])


def distorted(camera: CameraPlan, x: float, y: float) -> tuple[float, float]:
    """Return the distorted position of a point, by bisection on the lens formula."""
    half = camera.width / 2
    dx, dy = (x - half) / half, (y - camera.height / 2) / half
    goal = float(np.hypot(dx, dy))
    low, high = 0.0, optics.corner(camera)
    for _ in range(80):
        r = (low + high) / 2
        low, high = (r, high) if r * optics.factor(camera, r) < goal else (low, r)
    scale = low / goal if goal else 1.0
    return half + dx * half * scale, camera.height / 2 + dy * half * scale


@pytest.mark.parametrize(("k", "kcube"), LENSES)
@given(st.floats(-20, 20), st.floats(-15, 15), st.floats(-30, 30), st.floats(-1, 1), st.floats(0.5, 2.5))
@settings(max_examples=20, deadline=None)
def test_corners_are_those_of_an_independent_projection(
    k: float, kcube: float, yaw: float, pitch: float, roll: float, y: float, z: float
) -> None:
    camera = CameraPlan(width=640, height=480, fov=90, lens_k=k, lens_kcube=kcube)
    pose = from_pose(Pose(x=0, y=y, z=z, yaw=yaw, pitch=pitch, roll=roll))
    h = projection.homography(FACE, camera, projection.view_from_world(pose))
    for (u, v), corner in zip(((0, 0), (1, 0), (1, 1), (0, 1)), FACE.corners, strict=True):
        x0, y0, depth = pinhole(camera, pose, corner)
        a, b, c = (float(value) for value in projection.apply_homography(h, np.array(u), np.array(v)))
        assert (a, b, c) == pytest.approx((x0, y0, depth), abs=1e-6)
        found = projection.distort(camera, a, b)
        if 0 < found[0] < camera.width and 0 < found[1] < camera.height:
            assert found == pytest.approx(distorted(camera, x0, y0), abs=0.01)
    back = projection.inverse(h)
    np.testing.assert_allclose(back @ h, np.eye(3), atol=1e-9)


pytestmark = pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # pycocotools' decode

RECIPE = """
recipe: patched
seed: 3
base:
  clock: {fps: 10, frames: 3}
  town: {name: downtown, blocks: [1, 1]}
  actors:
    car: {blueprint: vehicle.van.a, speed: 5, start: {x: -1.6, y: 1}, goal: {x: -1.6, y: -30}}
    hero: {blueprint: walker.pedestrian.0001, speed: 1, start: {x: -4.5, y: -0.5}, goal: {x: -4.5, y: -9}}
  patches:
    poster: {on: {town: wall.1, size: {width: 4, height: 2}}, texture: {image: a.png}}
    paint: {on: {actor: car}, texture: {color: "#ff00ff"}}
    hood: {on: {actor: car, surface: front, at: {z: 0.9}, size: {width: 1.2, height: 0.8}}, mode: green}
    shirt: {on: {actor: hero}, texture: {frames: film}}
  sensors:
    street:
      mount: {x: 1.5, y: -6, z: 1.6, yaw: 140}
      camera: {width: 160, height: 120, fov: 70}
      capture: [rgb, instance, depth]
    distorted:
      mount: {x: 1.5, y: -6, z: 1.6, yaw: 140}
      camera: {width: 96, height: 72, fov: 80, lens_k: 0.2}
      capture: [depth]
deltas:
  weather: {clear: {}, rainy: {weather: HardRainNoon}}
"""


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("patched")
    (folder / "a.png").write_bytes(png(picture()))
    (folder / "film").mkdir()
    for n in range(3):
        (folder / f"film/{n}.png").write_bytes(png(picture(4 + n, 3)))
    (folder / "recipe.yaml").write_text(RECIPE)
    return folder / "recipe.yaml"


@pytest.fixture(scope="module")
def compiled(recipe: Path) -> Compiled:
    return compile_recipe(recipe)


@pytest.fixture(scope="module")
def built(recipe: Path) -> Path:
    plan, engines = opened(recipe)
    build(plan, recipe.parent / "out", BuildOptions(engines=engines, cache=recipe.parent / "cache", workers=0))
    return recipe.parent / "out"


def truth_of(out: Path, variant: str, sensor: str, frame: int) -> FrameTruth:
    found: FrameTruth = json.loads((out / layout.patches_file(variant, sensor, frame)).read_text())
    return found


@pytest.mark.slow
def test_a_build_writes_the_truth_of_every_frame(built: Path, compiled: Compiled) -> None:
    """There is a file per frame, sensor and variant, listed in the manifest, and the dataset passes verification."""
    dataset = reader.read(built)
    for variant in compiled.plan.variants:
        for sensor in variant.rig.sensors:
            for frame in range(3):
                assert layout.patches_file(variant.variant, sensor.name, frame) in dataset.files
                truth = truth_of(built, variant.variant, sensor.name, frame)
                assert [p["name"] for p in truth["patches"]] == ["poster", "paint", "hood", "shirt"]
    clear, rainy = (truth_of(built, f"weather={w}", "street", 1) for w in ("clear", "rainy"))
    assert clear == rainy, "weather changes no truth"
    assert verify_files(dataset, Options(nonce=1), lambda *_: None).document()["verdict"] == "PASS"


@pytest.mark.slow
def test_a_variant_without_patches_has_none(tmp_path: Path) -> None:
    """The kernel that numbers patches reads the first patch, so it must not be launched without patches."""
    head, rest = RECIPE.split("  patches:\n")
    (tmp_path / "plain.yaml").write_text(head + "  sensors:\n" + rest.split("  sensors:\n")[1])
    with recipe_runtime.open(tmp_path / "plain.yaml", variant="weather=clear") as scene:
        assert scene.patches(1, "street")["patches"] == []


def test_masks_are_where_colours_change(recipe: Path) -> None:
    """Only the pixels of the mask change with a texture; occluders are not part of the mask."""
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        seen = scene.render(1, "street", "instance")
        truth = {p["name"]: p for p in scene.patches(1, "street")["patches"]}
        masks = {}
        for name, record in truth.items():
            assert record["counts"] is not None, name
            rows = {"size": [120, 160], "counts": record["counts"].encode()}
            masks[name] = pycocotools.mask.decode(rows).astype(bool)
            assert record["area"] == masks[name].sum() > 20
        instances = {actor.name: actor.tag * 1000 + actor.instance for actor in scene.plan.scene.actors}
        assert (seen[masks["poster"]] == 0).all()
        assert (seen[masks["paint"]] == instances["car"]).all() and (seen[masks["shirt"]] == instances["hero"]).all()
        assert not (masks["paint"] & masks["hood"]).any(), "the later patch lies over the earlier one"
        depth = scene.render(1, "street", "depth")[masks["poster"]]
        assert truth["poster"]["depth"] == pytest.approx(float(depth.astype(float).mean()), abs=1e-3)
        assert truth["poster"]["visible_fraction"] is not None and 0.3 < truth["poster"]["visible_fraction"] < 1


def test_a_records_numbers_agree(recipe: Path) -> None:
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        for sensor, width, height in (("street", 160, 120), ("distorted", 96, 72)):
            for record in scene.patches(0, sensor)["patches"]:
                corners, clipped, whole = record["corners"], record["corners_clipped"], record["corners_int"]
                if corners is None:
                    continue
                assert clipped is not None and whole is not None
                for (x, y), (a, b), (i, j) in zip(corners, clipped, whole, strict=True):
                    assert (a, b) == (min(max(x, 0), width), min(max(y, 0), height))
                    assert 0 <= i < width and 0 <= j < height and abs(i + 0.5 - a) <= 0.5 + 1e-6
                if record["homography"] is not None and sensor == "street":
                    h = np.array(record["homography"])
                    points = h @ np.array([[0, 1, 1, 0], [0, 0, 1, 1], [1, 1, 1, 1]])
                    np.testing.assert_allclose((points[:2] / points[2]).T, corners, atol=0.01)


def test_visible_pixels_lie_within_the_corners_with_and_without_distortion(recipe: Path) -> None:
    """`covered_pixels` and the renderer agree on an unoccluded patch, except for pixel centres exactly on its edge."""
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        for sensor in scene.plan.rig.sensors:
            truth = scene.patches(0, sensor.name)
            patch = scene.plan.appearance.patches[0]
            view = np.array(truth["calibration"]["world_to_camera"])[:3]
            covered = projection.covered_pixels(patch.faces[0], sensor.camera, view)
            rows = {"size": list(covered.shape), "counts": str(truth["patches"][0]["counts"]).encode()}
            shown = pycocotools.mask.decode(rows).astype(bool)
            assert (shown & ~covered).sum() <= 0.02 * shown.sum()
            assert truth["patches"][0]["amodal_area"] == max(int(covered.sum()), int(shown.sum()))


def test_large_pictures_are_projected_by_strips(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that the truth of a patch takes little memory beside a picture of 4096 x 4096."""
    face = PatchFace(
        part="static",
        corner=(3.0, 1.0, 0.4),
        right=(0.0, -1.0, 0.0),
        down=(0.28, 0.0, -0.96),
        width=2,
        height=1,
        reach=1,
    )
    camera = CameraPlan(width=150, height=110, fov=80.0, near=0.1, far=100.0, lens_k=-0.1, lens_kcube=0.02)
    view = projection.view_from_world(np.eye(3, 4))
    whole = projection.covered_pixels(face, camera, view)
    monkeypatch.setattr(projection, "_STRIP", 401)
    assert 0 < whole.sum() < whole.size
    np.testing.assert_array_equal(projection.covered_pixels(face, camera, view), whole)


@pytest.mark.slow
def test_a_reused_frame_keeps_its_truth_and_a_new_appearance_gets_its_own(recipe: Path, tmp_path: Path) -> None:
    """Files of an earlier dataset are reused by appearance, also for a sensor without pictures."""
    out, cache = tmp_path / "out", recipe.parent / "cache"
    text = recipe.read_text()
    plan, engines = opened(recipe)
    build(plan, out, BuildOptions(engines=engines, cache=cache, workers=0))
    before = {
        name: (out / layout.patches_file("weather=clear", name, 2)).read_bytes() for name in ("street", "distorted")
    }
    other = recipe.parent / "other.yaml"
    changed = '{clear: {}, red: {patches: {paint: {texture: {color: "#ff0000"}}}}}'
    other.write_text(text.replace("{clear: {}, rainy: {weather: HardRainNoon}}", changed))
    plan, engines = opened(other)
    done = build(plan, out, BuildOptions(engines=engines, cache=cache, workers=0, replace=True))
    assert done.taken_frames > 0
    for name, body in before.items():
        assert (out / layout.patches_file("weather=clear", name, 2)).read_bytes() == body
        colours = [p["texture"] for p in truth_of(out, "weather=red", name, 2)["patches"]]
        assert "#ff0000" in colours and "#ff00ff" not in colours
    assert verify_files(reader.read(out), Options(nonce=1), lambda *_: None).document()["verdict"] == "PASS"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"body": "nobody"}, "there is no 'nobody'"),
        ({"faces": [{**FACE.document(), "part": "chassis"}]}, "parts that 'wall.1' does not have"),
        ({"faces": [{**FACE.document(), "right": [0.0, -0.5, 0.0]}]}, "not a rectangle"),
        ({"faces": [{**FACE.document(), "region": [0.5, 0.0, 0.5, 1.0]}]}, "nothing of the texture"),
        ({"texture": {"image": None, "frames": [], "colour": None}}, "one of an image, a sequence and a colour"),
        ({"name": "paint"}, "two patches have one name"),
    ],
)
def test_a_forged_plan_is_refused(recipe: Path, change: dict[str, Any], words: str) -> None:
    """Plans of datasets are untrusted input."""
    document: Any = opened(recipe)[0].variants[0].document()
    document["appearance"]["patches"][0] |= change
    path = recipe.parent / "plan.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=re.escape(words)):
        reader.plan_alone(path)


def test_the_mask_is_the_geometric_one_without_occluders(recipe: Path) -> None:
    """Return the mask computed from depth: a pixel shows the patch if its depth is that of the patch's plane."""
    with recipe_runtime.open(recipe, variant="weather=clear") as scene:
        sensor = scene.plan.rig.sensors[0]
        patch, truth = scene.plan.appearance.patches[0], scene.patches(1, "street")
        view = np.array(truth["calibration"]["world_to_camera"])[:3]
        back = projection.inverse(projection.homography(patch.faces[0], sensor.camera, view))
        rows, columns = np.mgrid[0:120, 0:160] + 0.5
        plane = 1.0 / (back[2, 0] * columns + back[2, 1] * rows + back[2, 2])
        covered = projection.covered_pixels(patch.faces[0], sensor.camera, view)
        free = np.abs(scene.render(1, "street", "depth") - plane) < 0.02
        record = truth["patches"][0]
        mask = pycocotools.mask.decode({"size": [120, 160], "counts": str(record["counts"]).encode()}).astype(bool)
        assert (covered & ~free).sum() > 4, "something stands before it"
        assert (mask != (covered & free)).sum() <= 0.01 * mask.sum()
