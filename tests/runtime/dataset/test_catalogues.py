"""What a dataset says of itself for catalogues: Croissant, the citation file, the card, and the keys of `about`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.about import About
from recipe_compiler.ir.errors import InputError
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.catalogues.citation import citation
from recipe_runtime.dataset.catalogues.croissant import croissant
from recipe_runtime.dataset.reader import read, text_differences

from tests.runtime.fakes import ENGINES, dataset_plan

ABOUT = About(
    licence="CC-BY-4.0",
    authors=("Ada Lovelace", "Jürgen <b>"),
    citation="@misc{x,\n  title={T}}",
    url="https://example.org/x",
    version="1.2.0",
    uses="Nothing but tests.",
)
# https://neurips.cc/Conferences/2026/EvaluationsDatasetsHosting
REQUIRED = (
    *("rai:dataLimitations", "rai:dataBiases", "rai:personalSensitiveInformation", "rai:dataUseCases"),
    *("rai:dataSocialImpact", "rai:hasSyntheticData", "prov:wasDerivedFrom", "prov:wasGeneratedBy"),
)


def described(about: About = ABOUT) -> DatasetPlan:
    return dataset_plan(frames=2, weathers=1).model_copy(update={"about": about})


def made(plan: DatasetPlan, folder: Path) -> Path:
    return build(plan, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=ENGINES)).path


def test_croissant_has_what_neurips_requires() -> None:
    for plan in (described(About()), described()):
        found: dict[str, Any] = json.loads(croissant(plan, "tiny@sha256:0"))
        assert all(found[key] for key in REQUIRED)
        plans = {row["identifier"] for row in found["prov:wasGeneratedBy"]["prov:used"]}
        assert plans == {f"sha256:{variant.digest}" for variant in plan.variants}
        assert found["prov:wasDerivedFrom"][0]["identifier"] == f"sha256:{plan.digest}"
    assert found["rai:dataUseCases"] == "Nothing but tests."
    assert found["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert [row["name"] for row in found["creator"]] == [*ABOUT.authors]


@pytest.mark.slow
def test_what_a_recipe_states_changes_no_digest(tmp_path: Path) -> None:
    """Without it, annotation files, plans and card are as they were before these keys existed."""
    plain, stated = described(About()), described()
    assert plain.digest == stated.digest
    roots = [made(plan, tmp_path / name) for name, plan in (("plain", plain), ("stated", stated))]
    one, other = map(read, roots)
    assert one.lock.identity == other.lock.identity and (one.plan.about, other.plan.about) == (About(), ABOUT)
    assert "about" not in json.loads((roots[0] / layout.MANIFEST).read_text())
    named = {layout.CARD, layout.CROISSANT, layout.KWCOCO, layout.coco_file("rgb")}
    differing = {path for path in one.files if one.files[path] != other.files[path]}
    assert (differing, other.files.keys() - one.files.keys()) == (named, {layout.CITATION})
    coco = json.loads((roots[1] / layout.coco_file("rgb")).read_text())
    assert coco["licenses"][0]["url"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert coco["info"]["contributor"] == "Ada Lovelace, Jürgen <b>"
    card = (roots[1] / layout.CARD).read_text()
    assert "- Licence: CC-BY-4.0\n- Authors: Ada Lovelace, Jürgen \\<b\\>\n" in card
    assert "    @misc{x,\n      title={T}}\n" in card
    assert "Licence" not in (roots[0] / layout.CARD).read_text()


@pytest.mark.slow
def test_a_changed_description_is_found_and_built_again(tmp_path: Path) -> None:
    root = made(described(), tmp_path)
    assert not text_differences(read(root), {})
    for path in (layout.CROISSANT, layout.CITATION):
        body = (root / path).read_text()
        (root / path).write_text(body.replace("Ada", "Bob"))
        assert [place for place, _ in text_differences(read(root), {})] == [path]
        (root / path).write_text(body)
    for about in (ABOUT.model_copy(update={"licence": "MIT"}), About()):  # also if nothing is stated any more
        assert read(made(described(about), tmp_path)).plan.about == about


def test_a_manifest_with_another_description_is_refused(tmp_path: Path) -> None:
    root = made(described(), tmp_path)
    manifest = json.loads((root / layout.MANIFEST).read_text())
    for wrong in ({"licence": ""}, {"unknown": "x"}, {"url": "javascript:x"}, {"authors": "x"}, {"version": "1"}):
        (root / layout.MANIFEST).write_text(json.dumps({**manifest, "about": wrong}))
        with pytest.raises(InputError):
            read(root)


@given(st.text(max_size=20), st.text(max_size=20))
def test_the_citation_file_is_yaml_with_these_texts(description: str, name: str) -> None:
    try:
        about = About(authors=(name,), licence="https://example.org/terms")
    except ValidationError:
        return
    plan = described(about).model_copy(update={"description": description})
    found = yaml.safe_load(citation(plan, "tiny@sha256:0"))
    assert found["authors"] == [{"name": name}] and found.get("abstract", "") == description
    assert found["license-url"] == "https://example.org/terms" and "license" not in found


def test_the_keys_of_a_recipe(tmp_path: Path) -> None:
    recipe = """
recipe: a
about: {ABOUT}
base:
  clock: {fps: 10, frames: 1}
  town: plaza
  sensors: {street: {mount: {z: 2}, camera: {width: 64, height: 48}, capture: [rgb]}}
"""
    path = tmp_path / "a.yaml"
    path.write_text(recipe.replace("{ABOUT}", '{licence: MIT, authors: [A, B], version: "1.0.0"}'))
    assert compile_recipe(path).plan.about == About(licence="MIT", authors=("A", "B"), version="1.0.0")
    for wrong, message in (("{license: MIT}", "licence"), ("{authors: A}", "authors"), ("{url: x}", "url")):
        path.write_text(recipe.replace("{ABOUT}", wrong))
        with pytest.raises(InputError, match=message) as found:
            compile_recipe(path)
        assert found.value.problems[0].place is not None and found.value.problems[0].place.line == 3


@pytest.mark.readers
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("depth", ["carla", "npy"])
def test_mlcroissant_validates_it_and_reads_all_records(tmp_path: Path, depth: str) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    plan = dataset_plan(frames=3, weathers=1, forms={"depth": depth}).model_copy(update={"about": ABOUT})
    root = made(plan, tmp_path)
    found = mlcroissant.Dataset(str(root / layout.CROISSANT))
    issues = found.metadata.ctx.issues
    assert not issues.errors and [text for text in issues.warnings if "datePublished" not in text] == []
    assert found.metadata.data_use_cases == ["Nothing but tests."]
    records = {each.id: list(found.records(each.id)) for each in found.metadata.record_sets}
    pictures = sum(len(sensor.frames(3)) for variant in plan.variants for sensor in variant.rig.sensors)
    assert {name: len(rows) for name, rows in records.items()} == {
        "frames": pictures,
        "motion": 3 * sum(len(variant.scene.actors) for variant in plan.variants),
        "pictures": pictures,
    }
    for row in records["frames"]:
        folder = root / row["frames/variant"].decode() / row["frames/sensor"].decode()
        label = json.loads((folder / "labels.jsonl").read_text().splitlines()[row["frames/frame"]])
        assert [item["frames/objects/bbox"] for item in row["frames/objects"]] == [o["bbox"] for o in label["objects"]]
    assert all(row["pictures/image"].size == (64, 48) for row in records["pictures"])
