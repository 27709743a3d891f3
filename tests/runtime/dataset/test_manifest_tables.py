"""Each path of a manifest is one that a dataset may have, in the table of its kind."""

from __future__ import annotations

import json
from typing import Any

import pytest
from recipe_runtime.dataset.manifest import MAX_PARTS, listed_files

ROW = {"size": 1, "sha256": "0" * 64}
FILES, PICTURES = {"README.md": ROW, "dry/street/rgb/000000.png": ROW}, {"preview/contact_sheet.png": ROW}


@pytest.mark.parametrize(("source", "target"), [("files", "pictures"), ("pictures", "files")])
def test_a_row_in_the_other_table_is_refused(source: str, target: str) -> None:
    """Frames cannot be listed as previews."""
    manifest: Any = json.loads(json.dumps({"files": FILES, "pictures": PICTURES}))
    assert listed_files(manifest).keys() == {*FILES, *PICTURES}
    path = max(manifest[source])
    manifest[target][path] = manifest[source].pop(path)
    with pytest.raises(ValueError, match=f"{path} does not belong in the table {target}"):
        listed_files(manifest)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/".join("a" * (MAX_PARTS + 1)), "is in 32 folders, and at most 31 are read"),
        ("a" * 256, "is not a path within a dataset"),
        ("README.md/a/b", "README.md is listed as a file, and README.md/a/b is in it"),
    ],
)
def test_a_path_that_no_dataset_has_is_refused(path: str, words: str) -> None:
    """Regression: 10,000 paths in a thousand folders, some KB of an archive, took 11 GB in `verify --integrity`."""
    manifest: Any = {"files": {**FILES, "/".join("a" * MAX_PARTS): ROW}, "pictures": PICTURES}
    listed_files(manifest)
    manifest["files"][path] = ROW
    with pytest.raises(ValueError, match=words):
        listed_files(manifest)
