"""Each file of a manifest must be in the table of its kind, so that frames cannot be listed as previews."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.manifest import FORMAT, listed_files
from recipe_runtime.dataset.manifest_reader import MAX_PARTS

ROW = {"size": 1, "sha256": "0" * 64}
FILES, PICTURES = {"README.md": ROW, "dry/street/rgb/000000.png": ROW}, {"preview/contact_sheet.png": ROW}


@pytest.mark.parametrize(("source", "target"), [("files", "pictures"), ("pictures", "files")])
def test_a_row_in_the_other_table_is_refused(source: str, target: str) -> None:
    manifest: Any = json.loads(json.dumps({"files": FILES, "pictures": PICTURES}))
    assert listed_files(manifest).keys() == {*FILES, *PICTURES}
    path = max(manifest[source])
    manifest[target][path] = manifest[source].pop(path)
    with pytest.raises(ValueError, match=f"{path} does not belong in the table {target}"):
        listed_files(manifest)


@pytest.mark.parametrize("table", ["files", "pictures"])
def test_paths_in_a_thousand_folders_are_refused(tmp_path: Path, table: str) -> None:
    """Regression: 10,000 such rows, some KB of an archive, took 11 GB of memory in `recipe verify --integrity`."""
    deep, deeper = ("/".join("a" * number) for number in (MAX_PARTS, MAX_PARTS + 1))
    for path, refused in ((deep, False), (deeper, True)):
        (tmp_path / "manifest.json").write_text(json.dumps({"format": FORMAT, table: {path: ROW}}))
        with pytest.raises(ValueError) as caught:  # the other tables are missing
            manifest_reader.read(tmp_path)
        assert ("is in 32 folders, and at most 31 are read" in str(caught.value)) is refused
