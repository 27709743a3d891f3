"""The message on a JSON file of a dataset that differs names the file and the field."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from recipe_compiler.ir.lockfile import skeleton
from recipe_runtime.dataset.reader import Dataset
from recipe_runtime.verify.file_comparison import FileComparison

from tests.runtime.fakes import dataset_plan

PATH = "weather=w0,jitter=still/street/patches/000003.json"
TRUTH = {"frame": 3, "patches": [{"name": "poster", "area": 118, "corners": [[1.5, 2.0], [9.0, 2.0]]}]}
FORGED = {"frame": 3, "patches": [{"name": "poster", "area": 120, "corners": [[1.5, 2.0], [9.0, 2.5]]}]}


def _message(folder: Path, recorded: bytes, written: object = TRUTH) -> str:
    for name, body in (("there", recorded), ("made", json.dumps(written).encode())):
        (folder / name / PATH).parent.mkdir(parents=True)
        (folder / name / PATH).write_bytes(body)
    plan = dataset_plan()
    lock = skeleton(plan, "tiny.yaml", {}, {}, {})
    dataset = Dataset(folder / "there", plan, lock, {}, "there")
    (found,) = FileComparison(plan, lock, dataset, folder / "made", {}).differences()
    assert (found.stage, found.path, found.excuse) == ("file", PATH, None)
    return found.message


def test_forged_ground_truth_is_reported_with_its_fields(tmp_path: Path) -> None:
    assert _message(tmp_path, json.dumps(FORGED).encode()) == (
        f"{PATH}: as recorded and as rendered it differs in patches[poster].area: 120 and 118, and in 1 more field"
    )


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (json.dumps(TRUTH, indent=2).encode(), "equal values in another form"),
        (b"\x89PNG", "it is not the ground truth of patches: "),
        (b"[" * 400, "it is not the ground truth of patches: "),
        (b" " * 10_000, "it is not the ground truth of patches: "),
        (b'{"frame": 3, "patches": [{"name": ["poster"]}]}', "patches[['poster']] is in the first only"),
        (b"[]", "it is not the ground truth of patches: Expected `object`"),
    ],
)
def test_any_content_gives_a_message(tmp_path: Path, body: bytes, words: str) -> None:
    assert words in _message(tmp_path, body)
