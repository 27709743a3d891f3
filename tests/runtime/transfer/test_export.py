"""The folder of an export: what is taken for a complete one, and what is replaced."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer.export import INDEX, export

from tests.runtime.fakes import quiet, tree

SMALL = {"shard-size": "40000"}  # a few samples in a shard


def test_a_picture_with_too_many_bytes_for_its_pixels_is_not_read(tiny: Dataset, tmp_path: Path) -> None:
    path = next(path for path in tiny.files if path.endswith(".png") and "/rgb/" in path)
    root = tmp_path / "copy"
    shutil.copytree(tiny.root, root)
    (root / path).unlink()
    with (root / path).open("wb") as file:
        file.truncate(1 << 33)
    large = replace(tiny, root=root, files={**tiny.files, path: (1 << 33, "0" * 64)})
    with pytest.raises(InputError, match=r"has 8,589,934,592 bytes, and a picture of this sensor has at most"):
        export(large, tmp_path / "out", "mots", quiet)
    assert not (tmp_path / "out").exists()


def test_a_name_that_leads_out_of_the_folder_is_refused(tiny: Dataset, tmp_path: Path) -> None:
    """The recipe's name, which is part of the shards' names, comes from an untrusted manifest."""
    copy, victim = tmp_path / "a" / "b" / "copy", tmp_path / "thesis-000000.tar"
    shutil.copytree(tiny.root, copy)
    victim.write_bytes(b"precious")
    manifest = (copy / layout.MANIFEST).read_text()
    (copy / layout.MANIFEST).write_text(manifest.replace('"recipe": "tiny"', '"recipe": "../../../../thesis"'))
    with pytest.raises(InputError, match="cannot be a folder's name"):
        export(read(copy), tmp_path / "a" / "b" / "out", "webdataset", quiet)
    assert victim.read_bytes() == b"precious"


def _changed(**changes: object) -> Callable[[Path, Path], object]:
    def forge(index: Path, shard: Path) -> None:
        found = json.loads(index.read_text())
        row = {**found["shards"][0], **changes}
        index.write_text(json.dumps({**found, "shards": [row, *found["shards"][1:]]}))

    return forge


def _folder(index: Path, shard: Path) -> None:
    shard.unlink()
    shard.mkdir()
    (shard / "thesis.tex").write_text("precious")


def _link(index: Path, shard: Path) -> None:
    shard.unlink()
    shard.symlink_to(index.parents[1] / "precious")


def _device(index: Path, shard: Path) -> None:
    index.unlink()
    index.symlink_to("/dev/zero")


FORGERIES = {
    "path": _changed(file="../precious"),
    "text": _changed(samples="3"),
    "negative": _changed(size=-1),
    "large": lambda index, shard: index.write_text(" " * (17 << 20) + "{}"),
    "folder": _folder,
    "link": _link,
    "device": _device,
}


@pytest.mark.slow
@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_forged_export_is_not_accepted_and_its_links_not_followed(
    tiny: Dataset, tmp_path: Path, forgery: str
) -> None:
    out = tmp_path / "out"
    first = out / export(tiny, out, "webdataset", quiet, options=SMALL).rows[0]["file"]
    (tmp_path / "precious").write_text("precious")
    FORGERIES[forgery](out / INDEX, first)
    with pytest.raises(InputError, match="exists already, and is not this export"):
        export(tiny, out, "webdataset", quiet, options=SMALL)
    export(tiny, out, "webdataset", quiet, options=SMALL, replace=True)
    assert (tmp_path / "precious").read_text() == "precious"
    assert forgery != "folder" or (tmp_path / "out.replaced" / first.name / "thesis.tex").read_text() == "precious"


@pytest.mark.slow
def test_an_interrupted_export_leaves_the_one_that_it_would_replace(tiny: Dataset, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()  # an empty folder is accepted
    export(tiny, out, "mots", quiet)
    old = tree(out)

    def interrupt(stage: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(tiny, out, "kitti", interrupt, replace=True)
    assert tree(out) == old and [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_path_through_the_replaced_export_is_valid(
    tiny: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the old export is renamed, `exp/..` leads nowhere."""
    monkeypatch.chdir(tmp_path)
    export(tiny, Path("exp"), "mots", quiet)
    (tmp_path / "exp" / "notes.txt").write_text("mine")
    notices: list[str] = []
    export(tiny, Path("exp/../exp"), "kitti", quiet, replace=True, notice=notices.append)
    assert (tmp_path / "exp" / "training").is_dir() and len(notices) == 1
    assert (tmp_path / "exp.replaced" / "notes.txt").read_text() == "mine"
