"""Props, from the recipe to frames: their poses, their collisions, and the errors when their files are missing."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recipe_runtime
import trimesh
from numpy.typing import NDArray
from pydantic import ValidationError
from recipe_compiler.compile import Compiled, compile_recipe
from recipe_compiler.ir.errors import InputError, RunError
from recipe_compiler.ir.plan import Clock, DatasetPlan, Pose, PropPlan, ScenePlan
from recipe_compiler.library import towns
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.trace import METRE
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.plan_checks import check_bounds
from recipe_runtime.frames.engines import Engines, real_engines
from recipe_runtime.meshes import props as props_module
from recipe_runtime.meshes.props import prop_bodies
from recipe_runtime.transfer.bundle import Pack, unpacked
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.verify import Options, verify

from tests.runtime import fakes
from tests.runtime.simulation.in_process import simulate
from tests.runtime.simulation.test_simulation import HERO1, TOWN

GOOD = Path(__file__).parents[2] / "cases/good/assets/recipe.yaml"
SHIPPED = Path(__file__).parents[3] / "recipes/assets/props.yaml"


def quiet(stage: str, done: int, total: int) -> None:
    pass


def rotation(pose: Pose) -> NDArray[np.float64]:
    """Return a pose's rotation by independent matrices: roll, pitch and yaw about fixed axes, in this order."""
    roll, pitch, yaw = np.radians([pose.roll, pose.pitch, pose.yaw])
    turned: NDArray[np.float64] = trimesh.transformations.euler_matrix(roll, pitch, yaw, "sxyz")[:3, :3]
    return turned


def test_a_mesh_is_at_the_pose_of_the_plan() -> None:
    compiled = compile_recipe(GOOD)
    scene = compiled.plan.variants[0].scene
    (prop,) = (p for p in scene.props if p.name == "prop.part")
    mesh = dict(next(prop_bodies([prop], Assets(compiled.places))).parts)["static"]
    local = trimesh.load_mesh(GOOD.parent / "files/tetrahedron.stl", process=False).vertices * 0.001
    pose = prop.pose
    expected = local @ rotation(pose).T + [pose.x, pose.y, pose.z]
    found = {tuple(row) for row in np.round(mesh.vertices.astype(float), 4).tolist()}
    assert found == {tuple(row) for row in (np.round(expected, 4) + 0.0).tolist()}
    assert float(mesh.vertices[:, 2].min()) == pytest.approx(
        towns.build("downtown", 0, {"blocks": [1, 1]}).ground(4, -1), abs=1e-5
    )


def test_a_board_faces_its_yaw_with_its_image_upright() -> None:
    pose = Pose(x=1.0, y=2.0, z=3.0, yaw=90.0)
    prop = PropPlan(name="prop.b", mesh=None, pose=pose, tag=20, low=(-0.01, -2.0, 0.0), high=(0.01, 2.0, 1.0))
    mesh = dict(next(prop_bodies([prop], Assets())).parts)["static"]
    face = mesh.triangles[mesh.surface == [s.slot for s in mesh.surfaces].index("face")]
    assert np.allclose(mesh.normals[face.reshape(-1)], [0, 1, 0], atol=1e-6)
    corner = {tuple(mesh.uvs[v].tolist()): mesh.vertices[v] for v in face.reshape(-1)}
    assert np.allclose(corner[0.0, 0.0], [3.0, 2.01, 4.0], atol=1e-6)  # its top left, seen from the front
    assert np.allclose(corner[1.0, 1.0], [-1.0, 2.01, 3.0], atol=1e-6)
    edges = mesh.vertices[mesh.triangles]
    outwards = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    assert ((outwards * mesh.normals[mesh.triangles[:, 0]]).sum(axis=1) > 0).all()
    assert float(np.abs(outwards).sum()) / 2 == pytest.approx(2 * (4.0 * 1.0 + 0.02 * 5.0), abs=1e-4)


@pytest.mark.slow
def test_a_pedestrian_does_not_walk_through_a_prop() -> None:
    low, high = (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0)
    crate = PropPlan(name="prop.c", mesh=None, pose=Pose(x=-4.0, y=0.0, z=0.15), tag=20, low=low, high=high)
    ends = {}
    for props in ((), (crate,)):
        clock = Clock(fps=30, frames=260, physics=240)
        trace = simulate(ScenePlan(clock=clock, town=TOWN.plan, actors=(HERO1,), props=props))
        way = trace.positions[:, trace.base_part("hero1")] / METRE
        inside = (np.abs(way[:, 0] + 4.0) < 0.5) & (np.abs(way[:, 1]) < 0.5)
        ends[len(props)] = float(way[-1, 1]), int(inside.sum())
    assert ends[0][0] < -4.0 and ends[0][1] > 0
    assert ends[1][1] == 0


def _engines(assets: Assets) -> Engines:
    """Return the fake engines with a folder of assets."""
    plain = fakes.ENGINES
    return Engines(plain.simulate, plain.actors, plain.renderer, assets)


def _with_props() -> tuple[Compiled, DatasetPlan]:
    """Return the recipe with props, and a small plan that has them."""
    compiled = compile_recipe(GOOD)
    scene = fakes.scene_plan(4).model_copy(update={"props": compiled.plan.variants[0].scene.props})
    plan = fakes.dataset_plan(4, 1)
    variants = tuple(v.model_copy(update={"scene": scene}) for v in plan.variants)
    return compiled, plan.model_copy(update={"variants": variants})


def _mesh_prop() -> tuple[Assets, PropPlan]:
    """Return the assets of the recipe, and its prop with a mesh."""
    compiled = compile_recipe(GOOD)
    return Assets(compiled.places), next(p for p in compiled.plan.variants[0].scene.props if p.mesh is not None)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Compiled, DatasetPlan, Path]:
    compiled, plan = _with_props()
    folder, engines = tmp_path_factory.mktemp("props"), _engines(Assets(compiled.places))
    build(plan, folder / "set", BuildOptions(workers=0, cache=folder / "cache", engines=engines))
    return compiled, plan, folder / "set"


@pytest.mark.slow
def test_verification_without_the_assets_is_inconclusive(built: tuple[Compiled, DatasetPlan, Path]) -> None:
    compiled, _, out = built
    held, options = datasets.read(out), Options(nonce=1, count=3, workers=0)
    known = _engines(Assets(compiled.places))
    with_assets = verify(held.plan, held.lock, options, quiet, dataset=held, engines=known)
    without = verify(held.plan, held.lock, options, quiet, dataset=held, engines=_engines(Assets()))
    assert (with_assets.verdict, with_assets.bound.checked) == ("PASS", 3)
    assert (without.verdict, without.stage, without.bound.checked) == ("INCONCLUSIVE", "observation", 0)
    (difference,) = without.differences
    assert "sha256:" in str(difference) and "is not available; name the recipe" in str(difference)


@pytest.mark.slow
def test_verification_with_a_damaged_asset_is_inconclusive(
    built: tuple[Compiled, DatasetPlan, Path], tmp_path: Path
) -> None:
    """It ended with an error, and reported no difference of other files of the dataset."""
    compiled, _, out = built
    (tmp_path / "damaged").write_bytes(b"v 0 0 0\n")
    damaged = _engines(Assets(dict.fromkeys(compiled.places, tmp_path / "damaged")))
    held, options = datasets.read(out), Options(nonce=1, count=3, workers=0)
    report = verify(held.plan, held.lock, options, quiet, dataset=held, engines=damaged)
    assert (report.verdict, report.bound.checked) == ("INCONCLUSIVE", 0)
    assert "is no longer the file" in str(report.differences)


@pytest.mark.slow
def test_a_dataset_lists_its_assets(built: tuple[Compiled, DatasetPlan, Path]) -> None:
    _, plan, out = built
    reported = json.dumps([json.loads(p.read_text()) for p in sorted((out / "plans").glob("*.json"))])
    assert all(prop.mesh.sha256 in reported for prop in plan.variants[0].scene.props if prop.mesh)
    assert str(GOOD.parent) not in reported


def test_a_changed_asset_file_is_not_used(tmp_path: Path) -> None:
    _, prop = _mesh_prop()
    assert prop.mesh is not None
    other = tmp_path / "other.obj"
    for content, words in ((b"v 0 0 0\n", "is no longer the file"), (b"x" * 100_000, "is no longer the file")):
        other.write_bytes(content)
        with pytest.raises(RunError, match=words):
            list(prop_bodies([prop], Assets({prop.mesh.sha256: other})))
    other.unlink()
    with pytest.raises(RunError, match="cannot be read: No such file"):
        list(prop_bodies([prop], Assets({prop.mesh.sha256: other})))
    with pytest.raises(RunError, match="is not available; name the recipe"):
        list(prop_bodies([prop], Assets()))


def test_workers_get_the_folder_of_the_assets() -> None:
    engines = real_engines(Assets(compile_recipe(GOOD).places))
    assert pickle.loads(pickle.dumps(engines)).assets == engines.assets


def test_a_pack_contains_the_assets(tmp_path: Path) -> None:
    compiled = compile_recipe(GOOD)
    pack = Pack(GOOD.name, {path: (GOOD.parent / path).read_bytes() for path in compiled.files})
    (tmp_path / "assets.recipe").write_bytes(pack.dumps())
    with unpacked(tmp_path / "assets.recipe") as recipe:
        again = compile_recipe(recipe)
        assert again.plan.digest == compiled.plan.digest
        assert Assets(again.places).missing(again.plan.variants) is None


def test_the_lockfile_has_a_row_for_every_asset() -> None:
    compiled, plan = _with_props()
    engines = _engines(Assets(compiled.places))
    made = lock(plan, "recipe.yaml", compiled.files, workers=0, progress=quiet, engines=engines)
    rows = made.dumps().splitlines()
    for asset in compiled.assets:
        assert f"file {asset.path} {asset.file.sha256}" in rows


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pose": {"x": 1e9}}, r"scene\.props\.1\.pose\.x"),
        ({"scale": 0.0}, r"scene\.props\.1\.scale"),
        ({"mesh": None, "low": (0, 0, 0), "high": (0, 0, 0)}, "a board without a size"),
        ({"mesh": {"sha256": "0" * 64, "bytes": 1 << 40, "kind": "obj"}}, r"scene\.props\.1\.mesh\.bytes"),
    ],
)
def test_an_untrusted_plan_is_bounded(changes: dict[str, Any], words: str) -> None:
    _, plan = _with_props()
    variant = plan.variants[0].model_dump(mode="json")
    variant["scene"]["props"][1] |= changes
    with pytest.raises(ValidationError, match=words):
        plan.variants[0].model_validate(variant)


def test_the_triangles_of_an_untrusted_plan_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan from a dataset may show one mesh of the dataset's recipe any number of times."""
    assets, prop = _mesh_prop()
    monkeypatch.setattr(props_module, "MAX_PROP_TRIANGLES", 3 * assets.mesh(prop).triangles)
    with pytest.raises(InputError, match="triangles of props up to here exceed the limit of"):
        list(prop_bodies([prop] * 9, assets))
    assert len(list(prop_bodies([prop] * 3, assets))) == 3


def test_an_untrusted_plan_shows_at_most_as_many_images_of_a_file_as_a_mesh_has_materials() -> None:
    _, plan = _with_props()
    file = {"sha256": "0" * 64, "bytes": 100, "kind": "glb"}
    for number, fits in ((64, True), (65, False)):
        variant = plan.variants[0].model_dump(mode="json")
        textures = {"a": {f"s{n}": {"file": file, "number": n} for n in range(64)}}
        textures["b"] = {"s": {"file": file, "number": number - 1}}
        variant["appearance"]["textures"] = textures
        changed = plan.model_copy(update={"variants": (plan.variants[0].model_validate(variant),)})
        with nullcontext() if fits else pytest.raises(InputError, match=r"65 images of the file sha256:0+ are over 64"):
            check_bounds(changed)


@pytest.mark.parametrize("sha256", ["../../etc/passwd", "0" * 63, "Z" * 64])
def test_an_untrusted_plan_can_name_files_only_by_digest(sha256: str) -> None:
    _, plan = _with_props()
    variant = plan.variants[0].model_dump(mode="json")
    variant["scene"]["props"][1]["mesh"]["sha256"] = sha256
    with pytest.raises(ValueError, match="sha256"):
        plan.variants[0].model_validate(variant)


_RENDER = """
import hashlib, sys, recipe_runtime
street = recipe_runtime.open(sys.argv[1], variant="poster=on_mesh,wedge=there")
print(hashlib.sha256(street.render(1).tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_a_frame_with_props_has_the_same_bytes_in_any_process() -> None:
    """In this process, and in one with another hash seed and without FMA."""

    street = recipe_runtime.open(GOOD, variant="poster=on_mesh,wedge=there")
    here = hashlib.sha256(street.render(1).tobytes()).hexdigest()
    tunables = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-FMA4"
    environment = {"PYTHONHASHSEED": "7", "GLIBC_TUNABLES": tunables, "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3"}
    command = [sys.executable, "-c", _RENDER, str(GOOD)]
    run = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == here
    bare = recipe_runtime.open(GOOD, variant="poster=shown,wedge=gone")
    assert (street.render(1) != bare.render(1)).any(axis=2).sum() > 20


@pytest.mark.slow
def test_labels_include_shipped_props_and_do_not_depend_on_images() -> None:
    """The board is 9.99 m in front of a camera of 60 degrees; the pinhole formula gives its centre."""
    street = recipe_runtime.open(SHIPPED, variant="weather=noon,poster=sunset")
    labels = {modality: street.render(0, modality=modality) for modality in ("depth", "instance", "semantic")}
    focal = 320.0 * 3.0**0.5
    column, row = int(320.0 - 0.2 / 9.99 * focal), int(200.0 + (1.6 - 0.75) / 9.99 * focal)
    assert labels["semantic"][row, column] == 8  # TrafficSigns
    assert labels["instance"][row, column] == 0
    assert labels["depth"][row, column] == pytest.approx(9.99, abs=1e-4)
    bare = recipe_runtime.open(SHIPPED, variant="weather=noon,poster=none")
    assert all((bare.render(0, modality=m) == pixels).all() for m, pixels in labels.items())
    differ = (bare.render(0) != street.render(0)).any(axis=2)
    assert differ[row, column] and differ.mean() < 0.1
