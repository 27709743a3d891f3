"""The data of a dataset's page are those of its files, and a page with any other script is found."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import damaged_files, read
from recipe_runtime.report.page import data_file, faults, is_data, site

from tests.runtime.fakes import dataset_plan
from tests.runtime.transfer.conftest import made

STILL = "weather=w0,jitter=still"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(dataset_plan(frames=40), tmp_path_factory.mktemp("page") / "tiny").root


@pytest.fixture
def copy(root: Path, tmp_path: Path) -> Path:
    shutil.copytree(root, tmp_path / "tiny")
    return tmp_path / "tiny"


def data(root: Path, key: str) -> Any:
    """Return the JSON of a data file, as a script would get it."""
    text = (root / layout.PAGE_DATA / f"{key}.js").read_text()
    inner = text.removeprefix(f'recipe.add("{key}", \'').removesuffix("');\n")
    return json.loads(inner.replace("\\\\", "\0").replace("\\'", "'").replace("\0", "\\"))


def test_every_frame_is_in_one_chunk_with_its_labels(root: Path) -> None:
    index = data(root, "index")
    variant = next(v for v in index["variants"] if v["name"] == STILL)
    number = variant["views"][0]
    frames = [*data(root, f"view-{number}-0"), *data(root, f"view-{number}-32")]
    lines = [json.loads(line) for line in (root / STILL / "street" / "labels.jsonl").read_text().splitlines()]
    assert [frame["frame"] for frame in frames] == list(range(40))
    for frame, line in zip(frames, lines, strict=True):
        assert [o["counts"] for o in frame["objects"]] == [o["counts"] for o in line["objects"]]
        assert [o["bbox"] for o in frame["objects"]] == [o["bbox"] for o in line["objects"]]
    assert data(root, f"view-{number}")["counts"] == [len(line["objects"]) for line in lines]


def test_variants_share_the_data_of_a_view(root: Path) -> None:
    """Two weathers have equal labels: the page has them once."""
    index = data(root, "index")
    views = {v["name"]: v["views"] for v in index["variants"]}
    assert views["weather=w0,jitter=still"] == views["weather=w1,jitter=still"]
    assert len(list((root / layout.PAGE_DATA).glob("view-*-0.js"))) == len(index["views"]) == 3


def test_histograms_count_all_annotations_once_for_each_variant(root: Path) -> None:
    """Independent: from labels.jsonl of every variant."""
    objects = [
        item
        for path in root.glob("*/*/labels.jsonl")
        for line in path.read_text().splitlines()
        for item in json.loads(line)["objects"]
    ]
    found = data(root, "index")["statistics"]
    assert found["annotations"] == len(objects) > 0
    bounds = found["bins"]["distance"]
    expected = [0] * len(bounds)
    for item in objects:
        expected[max(n for n, low in enumerate(bounds) if low <= item["distance"])] += 1
    counts = [row["histograms"]["distance"] for row in found["classes"].values()]
    assert [sum(column) for column in zip(*counts, strict=True)] == expected


def test_a_built_dataset_lists_every_file_of_its_page(root: Path) -> None:
    assert damaged_files(read(root), lambda *_: None) == []
    assert faults(root) == []
    assert {path for path in site() if not (root / path).is_file()} == set()


def test_a_page_with_another_script_is_not_safe(copy: Path) -> None:
    """A hostile author of a dataset cannot put a script into a page that `recipe view` opens."""
    page = copy / layout.PAGE
    page.write_bytes(page.read_bytes().replace(b"</body>", b"<script src=evil.js></script></body>"))
    assert [fault for fault in faults(copy) if fault.startswith(layout.PAGE)]
    script = copy / layout.PAGE_DATA / "index.js"
    script.write_bytes(script.read_bytes() + b"alert(1);\n")
    assert [fault for fault in faults(copy) if fault.startswith(f"{layout.PAGE_DATA}/index.js")]


def test_a_link_in_a_page_is_not_followed(copy: Path, tmp_path: Path) -> None:
    index = copy / layout.PAGE_DATA / "index.js"
    shutil.move(index, tmp_path / "index.js")
    index.symlink_to(tmp_path / "index.js")
    assert faults(copy) == [f"{layout.PAGE_DATA}/index.js is not data of a page"]


@pytest.mark.parametrize(
    "script",
    [
        b"recipe.add(\"a\", ''+alert(1)+'');\n",
        b"recipe.add(\"a\", '\\\\'+alert(1)+'\\\\');\n",
        b"recipe.add(\"a\", '1');alert(1);\n",
        b"recipe.add(\"a\", '1\r');\n",
        b"recipe.add(\"a\", '\\u0027+alert(1)');\n",
        "recipe.add(\"a\", '\u2028');\n".encode(),
        b"alert(1)",
    ],
)
def test_code_is_no_data(script: bytes) -> None:
    assert not is_data(script)


@given(st.text())
def test_any_text_is_data_and_comes_back(text: str) -> None:
    ((_, (body,)),) = [(data_file("a", {text: [text]}))]
    assert is_data(body)
    inner = body.decode("ascii").removeprefix('recipe.add("a", \'').removesuffix("');\n")
    assert json.loads(inner.replace("\\\\", "\0").replace("\\'", "'").replace("\0", "\\")) == {text: [text]}


@pytest.mark.skipif(shutil.which("node") is None, reason="there is no node here")
def test_scripts_parse() -> None:
    for path, body in site().items():
        if path.endswith(".js"):
            ran = subprocess.run(["node", "--check", "-"], input=body, capture_output=True, timeout=60)
            assert ran.returncode == 0, (path, ran.stderr)
