"""The export for Hugging Face: rows with all pictures of a frame."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image
from recipe_compiler.ir.about import About
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.build.recipe_files import RecipeFiles
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer.export import export

from tests.runtime.fakes import ENGINES, dataset_plan, quiet
from tests.runtime.transfer.conftest import made


def rows_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "train/metadata.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_a_row_has_all_pictures_and_objects_of_a_frame(tiny: Dataset, tmp_path: Path) -> None:
    export(tiny, tmp_path / "out", "hf", quiet)
    rows = rows_of(tmp_path / "out")
    assert len(rows) == 96 and len({tuple(row) for row in rows}) == 1
    for row in rows:
        sensor = {sensor.name: sensor for sensor in tiny.plan.variants[0].rig.sensors}[row["sensor"]]
        pictures = {key.removesuffix("_file_name"): row[key] for key in row if key.endswith("_file_name")}
        assert {name for name, path in pictures.items() if path} == {*sensor.capture}
        for path in filter(None, pictures.values()):
            assert (tmp_path / "out/train" / path).read_bytes() == (tiny.root / path).read_bytes()
        label = (tiny.root / row["variant"] / row["sensor"] / "labels.jsonl").read_text().splitlines()[row["frame"]]
        expected = json.loads(label)["objects"]
        assert {len(column) for column in row["objects"].values()} == {len(expected)}
        for key in ("bbox", "area", "instance", "actor", "distance", "counts"):
            assert row["objects"][key] == [item[key] for item in expected]


@pytest.mark.slow
def test_the_card_states_licence_and_recipe(tmp_path: Path) -> None:
    plan = dataset_plan(frames=1, weathers=1).model_copy(
        update={"about": About(licence="CC-BY-4.0", authors=("A: b",))}
    )
    files = RecipeFiles("a.yaml", {"a.yaml": b"recipe: tiny\n"})
    options = BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES, recipe_files=files)
    dataset = read(build(plan, tmp_path / "tiny", options).path)
    export(dataset, tmp_path / "out", "hf", quiet)
    card = (tmp_path / "out/README.md").read_text()
    head = yaml.safe_load(card.split("---\n")[1])
    assert (head["license"], head["size_categories"]) == ("cc-by-4.0", ["n<1K"])
    assert "- Authors: A: b" in card and f"    {dataset.lock.identity}\n" in card
    assert "    recipe build tiny.recipe\n" in card
    assert (tmp_path / "out/tiny.recipe").read_bytes() == (dataset.root / "tiny.recipe").read_bytes()
    (dataset.root / "tiny.recipe").write_bytes(b"other")
    with pytest.raises(InputError, match=re.escape("tiny.recipe differs from its SHA-256")):
        export(dataset, tmp_path / "again", "hf", quiet)


@pytest.mark.parametrize(
    ("licence", "expected"),
    [
        ("", {}),
        ("Own terms", {"license": "other", "license_name": "Own terms"}),
        (
            "https://example.org/t",
            {"license": "other", "license_name": "https://example.org/t", "license_link": "https://example.org/t"},
        ),
    ],
)
def test_other_licences(tmp_path: Path, licence: str, expected: dict[str, str]) -> None:
    plan = dataset_plan(frames=1, weathers=1).model_copy(update={"about": About(licence=licence)})
    export(made(plan, tmp_path / "tiny"), tmp_path / "out", "hf", quiet)
    head = yaml.safe_load((tmp_path / "out/README.md").read_text().split("---\n")[1])
    assert {key: value for key, value in head.items() if key.startswith("license")} == expected


@pytest.mark.readers
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("depth", ["carla", "npy"])
def test_datasets_loads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, depth: str) -> None:
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    dataset = made(dataset_plan(frames=3, weathers=1, forms={"depth": depth}), tmp_path / "tiny")
    export(dataset, tmp_path / "out", "hf", quiet, options={"categories": "coco"})
    found = datasets.load_dataset(str(tmp_path / "out"), cache_dir=str(tmp_path / "cache"))["train"]
    assert found.num_rows == len(rows_of(tmp_path / "out"))
    for row, line in zip(found, rows_of(tmp_path / "out"), strict=True):
        assert row["objects"] == line["objects"] and {*row["objects"]["category"]} <= {"person", "truck"}
        body = (dataset.root / line["instance_file_name"]).read_bytes()
        with Image.open(io.BytesIO(body)) as image:
            assert np.array_equal(np.asarray(row["instance"]), np.asarray(image))
        if depth == "npy":
            assert row["depth_npy"] == line["depth_npy"]
