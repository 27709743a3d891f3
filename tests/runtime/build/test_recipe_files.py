"""A dataset contains its recipe and the files that the recipe uses, and nothing else of the recipe's folder."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.reader import damaged_files
from recipe_runtime.transfer import bundle
from recipe_runtime.transfer.bundle import Pack
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.recipe_comparison import recipe_differences, unpacked_assets
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify, verify_files

from tests.runtime.fakes import ENGINES, dataset_plan, quiet, tree
from tests.runtime.forging import edited, rewrite

CASE = Path(__file__).parents[2] / "cases" / "good" / "assets"
COMPILED = compile_recipe(CASE / "recipe.yaml")
FILES = {path: (CASE / path).read_bytes() for path in COMPILED.files}

PACK, LOCK = "assets.recipe", "lockfiles/assets.lock"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    locked = lock(COMPILED.plan, "../../x.yaml", COMPILED.files, workers=0, progress=quiet, engines=ENGINES)
    sources = RecipeFiles("recipe.yaml", FILES, locked)
    made = build(
        COMPILED.plan,
        folder / "assets",
        BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES, recipe_files=sources),
    )
    assert made.identity == locked.identity
    return made.path


@pytest.fixture
def copied(original: Path, tmp_path: Path) -> Path:
    """Return a copy of the dataset, as its recipient has it."""
    return shutil.copytree(original, tmp_path / "copied")


def checked(root: Path) -> Report:
    held = datasets.read(root)
    with TemporaryDirectory() as folder:
        engines = replace(ENGINES, assets=unpacked_assets(held, Path(folder)))
        return verify(held.plan, held.lock, Options(1, count=2, workers=0), quiet, dataset=held, engines=engines)


def forge(root: Path, files: dict[str, bytes]) -> None:
    """Replace files of the recipe in a dataset, and the row of its pack in the manifest."""
    old = bundle.read(root / PACK)
    rewrite(root, PACK, Pack(old.recipe, {**old.files, **files}).dumps())


def packed_lock(root: Path) -> lockfile.Lockfile:
    return lockfile.loads(bundle.read(root / PACK).files[LOCK].decode(), "assets.lock")


def test_the_recipe_and_the_files_that_it_uses_are_in_the_dataset(original: Path) -> None:
    pack = bundle.read(original / PACK)
    files = dict(pack.files)
    known = lockfile.loads(files.pop(LOCK).decode(), "assets.lock")
    assert (pack.recipe, files) == ("recipe.yaml", FILES)
    assert {"recipe.yaml", "common.yaml"} < set(files) and any(path.endswith(".glb") for path in files)
    manifest = json.loads((original / "manifest.json").read_text())
    assert manifest["recipe_file"] == PACK and PACK in manifest["files"]
    assert known.sealed and known.source == "../recipe.yaml" and known.files == COMPILED.files
    commands = f"    recipe verify .\n    recipe build {PACK} --output ../assets-again\n"
    assert commands in (original / "README.md").read_text()


@pytest.mark.slow
def test_a_copy_compiles_to_the_same_plan_and_passes(copied: Path) -> None:
    with bundle.unpacked(copied / PACK) as recipe:
        assert compile_recipe(recipe).plan == COMPILED.plan
    report = checked(copied)
    assert (report.verdict, report.differences) == ("PASS", [])
    assert verify_files(datasets.read(copied), Options(1), quiet).verdict == "PASS"


def test_a_copy_has_the_assets_of_its_plan(copied: Path, tmp_path: Path) -> None:
    assets = unpacked_assets(datasets.read(copied), tmp_path)
    assert COMPILED.places and set(COMPILED.places) <= set(assets.places)
    assert assets.missing(COMPILED.plan.variants) is None


@pytest.mark.slow
@pytest.mark.parametrize("at", [0, 200, -1])
def test_a_changed_pack_is_detected(copied: Path, at: int) -> None:
    body = bytearray((copied / PACK).read_bytes())
    body[at] ^= 1
    (copied / PACK).write_bytes(body)
    report = checked(copied)
    assert report.verdict == "FAIL"
    assert {(d.stage, d.path) for d in report.differences} > {("recipe", PACK), ("file", PACK)}


@pytest.mark.slow
def test_a_recipe_with_another_plan_is_detected_though_the_manifest_lists_it(copied: Path) -> None:
    forge(copied, {"recipe.yaml": FILES["recipe.yaml"].replace(b"z: 1.6", b"z: 1.7")})
    (found,) = (d for d in checked(copied).differences if d.stage == "recipe")
    assert found.message.startswith(f"{PACK} is not the recipe of poster=shown,wedge=there")


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"recipe.yaml": FILES["recipe.yaml"] + b"output: {depth: npy}\n"}, "requests different outputs"),
        ({"recipe.yaml": b"recipe: ["}, f"{PACK} cannot be compiled: recipe.yaml:1"),
        ({"run_me.sh": b"#!/bin/sh\n"}, "holds 'run_me.sh', which its recipe does not use"),
    ],
)
def test_another_recipe_in_the_pack_is_detected(copied: Path, files: dict[str, bytes], message: str) -> None:
    forge(copied, files)
    found, *_ = recipe_differences(datasets.read(copied))
    assert message in found.message and (found.excuse, found.path) == (None, PACK)


def test_a_recipe_that_differs_only_in_a_comment_passes(copied: Path) -> None:
    body, known = FILES["recipe.yaml"] + b"# a comment\n", packed_lock(copied)
    files = {**known.files, "recipe.yaml": hashlib.sha256(body).hexdigest()}
    forge(copied, {"recipe.yaml": body, LOCK: replace(known, files=files).dumps().encode()})
    assert recipe_differences(datasets.read(copied)) == []


@pytest.mark.slow
def test_the_lockfile_of_another_dataset_is_detected(copied: Path) -> None:
    known = packed_lock(copied)
    other = replace(known, frames=dict.fromkeys(known.frames, "0" * 64))
    forge(copied, {LOCK: other.dumps().encode()})
    (found,) = checked(copied).differences
    assert (found.stage, found.path) == ("lockfile", PACK)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("tools", "it lists 1 unknown tool (first: 'evil')"),
        ("stages", "it has 1 surplus stage row"),
        ("files", "its rows of files are not those of the recipe in the dataset"),
        ("source", "its rows of files are not those of the recipe in the dataset"),
    ],
)
def test_forged_lockfile_rows_outside_the_identity_are_detected(copied: Path, kind: str, message: str) -> None:
    known = packed_lock(copied)
    change: dict[str, Any] = {
        "tools": {**known.tools, "evil": "9"},
        "stages": {**known.stages, "evil": 9},
        "files": {**known.files, "x.yaml": "c" * 64},
        "source": "../other.yaml",
    }
    forge(copied, {LOCK: replace(known, **{kind: change[kind]}).dumps().encode()})
    report = checked(copied)
    assert report.verdict == "FAIL"
    assert [(d.path, d.excuse) for d in report.differences] == [(PACK, None)]
    assert f"{PACK}/{LOCK}: " in report.differences[0].message and message in report.differences[0].message


@pytest.mark.slow
def test_a_recipe_with_another_description_than_a_dataset_without_recipe_fails(copied: Path) -> None:
    """The description is in the card and the annotations, but in no digest of a lockfile."""
    (copied / PACK).unlink()
    manifest = json.loads((copied / "manifest.json").read_text())
    del manifest["recipe_file"], manifest["files"][PACK]
    for description, stages in ((COMPILED.plan.description, set()), ("licensed for any use", {"recipe"})):
        (copied / "manifest.json").write_text(json.dumps({**manifest, "description": description}))
        held = datasets.read(copied)
        report = verify(COMPILED.plan, held.lock, Options(1, count=1, workers=0), quiet, dataset=held, engines=ENGINES)
        assert {d.stage for d in report.differences if d.stage == "recipe" and d.excuse is None} == stages


def test_a_link_in_place_of_the_recipe_is_not_followed(copied: Path, tmp_path: Path) -> None:
    (copied / PACK).rename(tmp_path / "elsewhere")
    (copied / PACK).symlink_to(tmp_path / "elsewhere")
    held = datasets.read(copied)
    assert recipe_differences(held) == []
    assert [path for path, line in damaged_files(held, quiet) if "is a link" in line] == [PACK]


@pytest.mark.parametrize("place", ["manifest.json", "../assets.recipe", "missing.recipe", 7, [PACK]])
def test_a_manifest_whose_recipe_is_another_file_is_damaged(copied: Path, place: object) -> None:
    manifest = json.loads((copied / "manifest.json").read_text())
    (copied / "manifest.json").write_text(json.dumps({**manifest, "recipe_file": place}))
    with pytest.raises(InputError, match="damaged"):
        datasets.read(copied)


def test_a_manifest_without_the_recipe_is_detected(copied: Path) -> None:
    with edited(copied) as manifest:
        del manifest["recipe_file"]
    assert PACK in {path for path, _ in damaged_files(datasets.read(copied), quiet)}


@pytest.mark.slow
def test_a_repair_restores_the_recipe_and_no_intact_file(copied: Path, tmp_path: Path) -> None:
    sources = RecipeFiles("recipe.yaml", FILES, packed_lock(copied))
    options = BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES, recipe_files=sources, repair=True)
    before = tree(copied)
    assert build(COMPILED.plan, copied, options).repaired == ()
    (copied / PACK).write_text("another")
    assert len(build(COMPILED.plan, copied, options).repaired) == 1
    assert tree(copied) == before


def test_a_lockfile_of_another_dataset_is_not_included(tmp_path: Path) -> None:
    plan = dataset_plan(frames=2, weathers=1)
    other = replace(lock(plan, "x.yaml", {}, workers=0, progress=quiet, engines=ENGINES), plan="0" * 64)
    sources = RecipeFiles("tiny.yaml", {"tiny.yaml": b"recipe: tiny\n"}, other)
    options = BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES, recipe_files=sources)
    made = build(plan, tmp_path / "tiny", options)
    assert set(bundle.read(made.path / "tiny.recipe").files) == {"tiny.yaml"}


@pytest.mark.parametrize("path", ["../up.yaml", "/etc/passwd", "a//b.yaml", "back\\slash.yaml", "line\nbreak.yaml"])
def test_a_path_outside_the_folder_is_refused(path: str) -> None:
    with pytest.raises(InputError, match="cannot be a file of a pack"):
        RecipeFiles("tiny.yaml", {"tiny.yaml": b"", path: b""})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"recipe": "imagenet"}, "the dataset is named 'imagenet'"),
        ({"description": "PASS"}, "different description"),
        ({"variants": COMPILED.plan.variants[::-1]}, "different variants than the dataset, or a different order"),
    ],
)
def test_name_description_and_order_of_variants_must_be_those_of_the_recipe(
    copied: Path, change: dict[str, Any], message: str
) -> None:
    """They are in no variant's digest, but in the identity line and the card."""
    held = datasets.read(copied)
    assert recipe_differences(held) == []
    if "variants" in change and len(COMPILED.plan.variants) < 2:
        change = {"variants": ()}
    forged = replace(held, plan=held.plan.model_copy(update=change))
    assert any(message in difference.message and not difference.excuse for difference in recipe_differences(forged))
