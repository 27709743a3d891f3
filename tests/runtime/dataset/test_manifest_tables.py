"""Each file of a manifest must be in the table of its kind, so that frames cannot be listed as previews."""

from __future__ import annotations

import json
from typing import Any

import pytest
from recipe_runtime.dataset.manifest import listed_files

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
