"""A dataset contains its recipe and the files that the recipe uses, and nothing else of the recipe's folder."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.build.recipe_files import RecipeFiles, asset_places
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.dataset import reader as datasets
from recipe_runtime.dataset.manifest import MAX_PARTS
from recipe_runtime.dataset.reader import damaged_files
from recipe_runtime.verify.locking import lock
from recipe_runtime.verify.recipe_comparison import recipe_differences
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify, verify_files

from tests.runtime.fakes import ENGINES, dataset_plan, tree

CASE = Path(__file__).parents[2] / "cases" / "good" / "assets"
COMPILED = compile_recipe(CASE / "recipe.yaml")
FILES = {path: (CASE / path).read_bytes() for path in COMPILED.files}


def quiet(stage: str, done: int, total: int) -> None:
    pass


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
    engines = replace(ENGINES, assets=Assets(asset_places(held)))
    return verify(held.plan, held.lock, Options(1, count=2, workers=0), quiet, dataset=held, engines=engines)


def forge(root: Path, path: str, body: bytes) -> None:
    """Replace a file of a dataset and its row in the manifest."""
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_bytes(body)
    manifest = json.loads((root / "manifest.json").read_text())
    manifest["files"][path] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
    (root / "manifest.json").write_text(json.dumps(manifest))


def test_the_recipe_and_the_files_that_it_uses_are_in_the_dataset(original: Path) -> None:
    held = {path.removeprefix("recipe/"): body for path, body in tree(original).items() if path.startswith("recipe/")}
    lock_there = held.pop("lockfiles/assets.lock")
    assert held == FILES
    assert {"recipe.yaml", "common.yaml"} < set(held) and any(path.endswith(".glb") for path in held)
    manifest = json.loads((original / "manifest.json").read_text())
    assert manifest["recipe_file"] == "recipe/recipe.yaml"
    assert manifest["files"]["recipe/recipe.yaml"]["sha256"] == COMPILED.files["recipe.yaml"]
    known = lockfile.loads(lock_there.decode(), "assets.lock")
    assert known.sealed and known.source == "../recipe.yaml" and known.files == COMPILED.files
    commands = "    recipe verify .\n    recipe build recipe/recipe.yaml --output ../assets-again\n"
    assert commands in (original / "README.md").read_text()


@pytest.mark.slow
def test_a_copy_compiles_to_the_same_plan_and_passes(copied: Path) -> None:
    assert compile_recipe(copied / "recipe" / "recipe.yaml").plan == COMPILED.plan
    report = checked(copied)
    assert (report.verdict, report.differences) == ("PASS", [])
    assert verify_files(datasets.read(copied), Options(1), quiet).verdict == "PASS"


def test_a_copy_has_the_assets_of_its_plan(copied: Path) -> None:
    places = asset_places(datasets.read(copied))
    for variant in COMPILED.plan.variants:
        assert set(variant.files) <= set(places)
    assert all(hashlib.sha256(places[digest].read_bytes()).hexdigest() == digest for digest in COMPILED.places)


@pytest.mark.slow
@pytest.mark.parametrize("path", ["recipe/recipe.yaml", "recipe/common.yaml", "recipe/lockfiles/assets.lock"])
def test_a_changed_file_of_the_recipe_is_detected(copied: Path, path: str) -> None:
    with (copied / path).open("ab") as file:
        file.write(b"\n# changed\n")
    report = checked(copied)
    assert report.verdict == "FAIL"
    assert path in {d.path for d in report.differences}


@pytest.mark.slow
def test_a_recipe_with_another_plan_is_detected_though_the_manifest_lists_it(copied: Path) -> None:
    forge(copied, "recipe/recipe.yaml", FILES["recipe.yaml"].replace(b"z: 1.6", b"z: 1.7"))
    (found,) = (d for d in checked(copied).differences if d.stage == "recipe")
    assert found.message.startswith("recipe/recipe.yaml is not the recipe of poster=shown,wedge=there")


def test_a_recipe_with_other_outputs_is_detected(copied: Path) -> None:
    forge(copied, "recipe/recipe.yaml", FILES["recipe.yaml"] + b"output: {depth: npy}\n")
    assert "requests different outputs" in recipe_differences(datasets.read(copied))[0].message


def test_an_invalid_recipe_is_detected(copied: Path) -> None:
    forge(copied, "recipe/recipe.yaml", b"recipe: [")
    (found,) = recipe_differences(datasets.read(copied))
    assert found.excuse is None
    assert found.message.startswith("recipe/recipe.yaml cannot be compiled: recipe/recipe.yaml:1")


def test_a_recipe_that_differs_only_in_a_comment_passes(copied: Path) -> None:
    body, path = FILES["recipe.yaml"] + b"# a comment\n", "recipe/lockfiles/assets.lock"
    forge(copied, "recipe/recipe.yaml", body)
    known = lockfile.read(copied / path)
    files = {**known.files, "recipe.yaml": hashlib.sha256(body).hexdigest()}
    forge(copied, path, replace(known, files=files).dumps().encode())
    assert recipe_differences(datasets.read(copied)) == []


@pytest.mark.slow
def test_an_unused_file_in_the_recipes_folder_is_detected(copied: Path) -> None:
    forge(copied, "recipe/run_me.sh", b"#!/bin/sh\n")
    assert [d.path for d in checked(copied).differences] == ["recipe/run_me.sh"]


@pytest.mark.slow
def test_the_lockfile_of_another_dataset_is_detected(copied: Path) -> None:
    path = copied / "recipe/lockfiles/assets.lock"
    known = lockfile.read(path)
    other = replace(known, frames=dict.fromkeys(known.frames, "0" * 64))
    forge(copied, "recipe/lockfiles/assets.lock", other.dumps().encode())
    (found,) = (d for d in checked(copied).differences)
    assert (found.stage, found.path) == ("lockfile", "recipe/lockfiles/assets.lock")


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
    path = "recipe/lockfiles/assets.lock"
    known = lockfile.read(copied / path)
    change: dict[str, Any] = {
        "tools": {**known.tools, "evil": "9"},
        "stages": {**known.stages, "evil": 9},
        "files": {**known.files, "x.yaml": "c" * 64},
        "source": "../other.yaml",
    }
    forge(copied, path, replace(known, **{kind: change[kind]}).dumps().encode())
    report = checked(copied)
    assert report.verdict == "FAIL"
    assert [(d.path, d.excuse) for d in report.differences] == [(path, None)]
    assert f"{path}: " in report.differences[0].message and message in report.differences[0].message


@pytest.mark.slow
def test_a_recipe_with_another_description_than_a_dataset_without_recipe_fails(copied: Path) -> None:
    """The description is in the card and the annotations, but in no digest of a lockfile."""
    shutil.rmtree(copied / "recipe")
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["files"] = {path: row for path, row in manifest["files"].items() if not path.startswith("recipe/")}
    del manifest["recipe_file"]
    for description, stages in ((COMPILED.plan.description, set()), ("licensed for any use", {"recipe"})):
        (copied / "manifest.json").write_text(json.dumps({**manifest, "description": description}))
        held = datasets.read(copied)
        report = verify(COMPILED.plan, held.lock, Options(1, count=1, workers=0), quiet, dataset=held, engines=ENGINES)
        assert {d.stage for d in report.differences if d.stage == "recipe" and d.excuse is None} == stages


def test_a_link_in_place_of_the_recipe_is_not_followed(copied: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.yaml").write_text("password: hunter2\n")
    (copied / "recipe/recipe.yaml").unlink()
    (copied / "recipe/recipe.yaml").symlink_to(tmp_path / "secret.yaml")
    report = checked(copied)
    assert any("is a link" in d.message for d in report.differences)
    assert "hunter2" not in str(report.document()) and "password" not in str(report.document())


@pytest.mark.parametrize("place", ["manifest.json", "../recipe/x.yaml", "recipe/missing.yaml", 7, ["recipe"]])
def test_a_manifest_whose_recipe_is_no_listed_file_is_damaged(copied: Path, place: object) -> None:
    manifest = json.loads((copied / "manifest.json").read_text())
    (copied / "manifest.json").write_text(json.dumps({**manifest, "recipe_file": place}))
    with pytest.raises(InputError, match="damaged"):
        datasets.read(copied)


def test_a_manifest_without_the_recipe_is_detected(copied: Path) -> None:
    manifest = json.loads((copied / "manifest.json").read_text())
    del manifest["recipe_file"]
    (copied / "manifest.json").write_text(json.dumps(manifest))
    assert "recipe/recipe.yaml" in {path for path, _ in damaged_files(datasets.read(copied), quiet)}


@pytest.mark.slow
def test_a_repair_restores_the_recipe_and_no_intact_file(copied: Path, tmp_path: Path) -> None:
    def repair() -> BuildResult:
        sources = RecipeFiles("recipe.yaml", FILES, lockfile.read(copied / "recipe/lockfiles/assets.lock"))
        cache = tmp_path / "cache"
        return build(
            COMPILED.plan,
            copied,
            BuildOptions(workers=0, cache=cache, engines=ENGINES, recipe_files=sources, repair=True),
        )

    before = tree(copied)
    assert repair().repaired == ()
    (copied / "recipe/common.yaml").write_text("recipe: another\n")
    assert len(repair().repaired) == 1
    assert tree(copied) == before


def test_a_lockfile_of_another_dataset_is_not_included(tmp_path: Path) -> None:
    plan = dataset_plan(frames=2, weathers=1)
    other = replace(lock(plan, "x.yaml", {}, workers=0, progress=quiet, engines=ENGINES), plan="0" * 64)
    sources = RecipeFiles("tiny.yaml", {"tiny.yaml": b"recipe: tiny\n"}, other)
    made = build(
        plan,
        tmp_path / "tiny",
        BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES, recipe_files=sources),
    )
    assert [path for path in tree(made.path) if path.startswith("recipe/")] == ["recipe/tiny.yaml"]


@pytest.mark.parametrize("path", ["../up.yaml", "/etc/passwd", "a//b.yaml", "back\\slash.yaml", "line\nbreak.yaml"])
def test_a_path_outside_the_folder_is_refused(path: str) -> None:
    with pytest.raises(InputError, match="cannot be a file of a dataset"):
        RecipeFiles("tiny.yaml", {"tiny.yaml": b"", path: b""})


def test_a_path_that_no_reader_accepts_is_refused() -> None:
    deep = "/".join("a" * MAX_PARTS)
    RecipeFiles("tiny.yaml", {"tiny.yaml": b"", deep[2:]: b""})
    with pytest.raises(InputError, match="is in more than 30 folders"):
        RecipeFiles("tiny.yaml", {"tiny.yaml": b"", deep: b""})


def test_too_many_bytes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recipe_runtime.build.recipe_files.MAX_BYTES", 10)
    with pytest.raises(InputError, match="have 11 bytes, over 10"):
        RecipeFiles("tiny.yaml", {"tiny.yaml": b"01234567890"})


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
