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


def test_folders_far_beyond_the_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 124,000 files in 31 folders each, which no other file is in, took 4.8 GB of memory."""
    monkeypatch.setattr(manifest_reader, "_MAX_EMPTY", 40)
    shared = {f"{'a/' * 20}{number}/b": ROW for number in range(100)}
    for files, refused in ((shared, False), ({f"{number}/{path}": ROW for number, path in enumerate(shared)}, True)):
        (tmp_path / "manifest.json").write_text(json.dumps({"format": FORMAT, "files": files}))
        with pytest.raises(ValueError) as caught:  # the other tables are missing
            manifest_reader.read(tmp_path)
        assert ("it lists 44 folders for 2 files" in str(caught.value)) is refused


@pytest.mark.parametrize("row", ['"frames": {"a": {}, "b": {}, "c": {}}', '"intervals": {"a": 2, "b": 2, "c": 2}'])
def test_sensors_without_digests_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, row: str) -> None:
    """Regression: 20 million sensors without a digest, a manifest of 256 MiB, took 3.2 GB of memory."""
    (tmp_path / "manifest.json").write_text('{"format": "recipe/manifest/1", "variants": {"v": {' + row + "}}}")
    for most, said in ((3, "the variant 'v' lacks something"), (2, "it lists more than 2 sensors")):
        monkeypatch.setattr(manifest_reader, "MAX_ROWS", most)
        with pytest.raises(ValueError, match=said):
            manifest_reader.read(tmp_path)
