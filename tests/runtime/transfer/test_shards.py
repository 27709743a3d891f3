"""WebDataset shards contain a dataset's own files, the library reads them, and equal datasets give equal shards."""

from __future__ import annotations

import gc
import hashlib
import io
import json
import os
import shutil
import tarfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import webdataset
from PIL import Image
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer import shards
from recipe_runtime.transfer.export_folder import INDEX
from recipe_runtime.transfer.layouts import export_layout

from tests.runtime.fakes import ENGINES, dataset_plan, tree

SMALL = 40_000  # bytes: a few samples per shard


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("built")
    return read(
        build(dataset_plan(), folder / "small", BuildOptions(engines=ENGINES, workers=0, cache=folder / "cache")).path
    )


def exported(dataset: Dataset, out: Path, shard_bytes: int = SMALL) -> list[Path]:
    index = shards.webdataset(dataset, out, lambda *_: None, shard_bytes)
    return [out / row["file"] for row in index["shards"]]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore:unclosed:ResourceWarning")
def test_webdataset_reads_every_frame(built: Dataset, tmp_path: Path) -> None:
    """Keys, pictures decoded by Pillow, and records of every frame come from the library's pipeline, in order."""
    made = exported(built, tmp_path / "out")
    assert len(made) > 3
    samples = list(webdataset.WebDataset([str(p) for p in made], shardshuffle=False).decode("rgb8"))
    gc.collect()  # the library leaves shards open; its warning must not fail another test
    wanted = [
        (variant, sensor, frame)
        for variant in built.plan.variants
        for sensor in variant.rig.sensors
        for frame in range(variant.scene.clock.frames)
    ]
    assert len(samples) == len(wanted)
    for sample, (variant, sensor, frame) in zip(samples, wanted, strict=True):
        place = f"{layout.folder(variant.variant)}/{sensor.name}"
        assert sample["__key__"] == f"{place}/{frame:06d}"
        reported = sample["json"]
        assert (reported["variant"], reported["sensor"], reported["frame"]) == (variant.variant, sensor.name, frame)
        lines = (built.root / layout.labels_file(variant.variant, sensor.name)).read_text().splitlines()
        labels = json.loads(lines[frame])
        assert {key: reported[key] for key in labels} == labels
        with Image.open(built.root / place / "rgb" / f"{frame:06d}.png") as picture:
            np.testing.assert_array_equal(sample["rgb.png"], np.asarray(picture))


def test_a_picture_with_too_many_bytes_for_its_pixels_is_not_read(built: Dataset, tmp_path: Path) -> None:
    path = next(path for path in built.files if path.endswith(".png") and "/rgb/" in path)
    root = tmp_path / "copy"
    shutil.copytree(built.root, root)
    (root / path).unlink()
    with (root / path).open("wb") as file:
        file.truncate(1 << 33)
    large = replace(built, root=root, files={**built.files, path: (1 << 33, "0" * 64)})
    with pytest.raises(InputError, match=r"has 8,589,934,592 bytes, and a picture of this sensor has at most"):
        shards.webdataset(large, tmp_path / "out", lambda *_: None)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_shards_contain_the_datasets_files(built: Dataset, tmp_path: Path) -> None:
    held = set()
    for shard in exported(built, tmp_path / "out"):
        assert shard.stat().st_size <= SMALL
        with tarfile.open(shard) as tar:
            for entry in tar:
                assert (entry.mtime, entry.uid, entry.gid, entry.uname, entry.gname) == (0, 0, 0, "", "")
                place, _, name = entry.name.rpartition("/")
                frame, modality, ending = [*name.split("."), ""][:3]
                if ending:
                    body = tar.extractfile(entry)
                    assert body is not None
                    assert body.read() == (built.root / place / modality / f"{frame}.{ending}").read_bytes()
                    held.add(f"{place}/{modality}/{frame}.{ending}")
    assert held == {
        layout.frame_file(variant.variant, sensor.name, modality, frame, built.plan.forms)
        for variant in built.plan.variants
        for sensor in variant.rig.sensors
        for modality in sensor.capture
        for frame in range(variant.scene.clock.frames)
    }


def test_a_name_that_leads_out_of_the_folder_is_refused(built: Dataset, tmp_path: Path) -> None:
    """The recipe's name, which is part of the shards' names, comes from an untrusted manifest."""
    copy, victim = tmp_path / "a" / "b" / "copy", tmp_path / "thesis-000000.tar"
    shutil.copytree(built.root, copy)
    victim.write_bytes(b"precious")
    manifest = (copy / layout.MANIFEST).read_text()
    (copy / layout.MANIFEST).write_text(manifest.replace('"recipe": "tiny"', '"recipe": "../../../../thesis"'))
    with pytest.raises(InputError, match="cannot be a folder's name"):
        exported(read(copy), tmp_path / "a" / "b" / "out")
    assert victim.read_bytes() == b"precious"


@pytest.mark.slow
@pytest.mark.parametrize("forgery", ["bytes", "folder", "name", "type", "link", "device", "text", "many"])
def test_a_forged_export_is_not_accepted_and_its_links_not_followed(
    built: Dataset, tmp_path: Path, forgery: str
) -> None:
    out, precious = tmp_path / "out", tmp_path / "precious"
    first = exported(built, out)[0]
    index = json.loads((out / INDEX).read_text())
    precious.write_text("precious")
    if forgery == "bytes":
        first.write_bytes(bytes(first.stat().st_size))
    elif forgery == "folder":
        first.unlink()
        first.mkdir()
        (first / "thesis.tex").write_text("precious")
    elif forgery == "link":
        first.unlink()
        first.symlink_to(precious)
    elif forgery == "device":
        (out / INDEX).unlink()
        (out / INDEX).symlink_to("/dev/zero")
    elif forgery in ("text", "many"):
        index["shards"][0]["samples"] = "3" if forgery == "text" else 10**30
        (out / INDEX).write_text(json.dumps(index))
    else:
        index["shards"] = [{**index["shards"][0], "file": "../precious"}] if forgery == "name" else 7
        (out / INDEX).write_text(json.dumps(index))
    with pytest.raises(InputError, match="exists already, and is not this export"):
        exported(built, out)
    shards.webdataset(built, out, lambda *_: None, SMALL, replace=True)
    if forgery == "folder":
        assert (tmp_path / "out.replaced" / first.name / "thesis.tex").read_text() == "precious"
    assert precious.read_text() == "precious"


@pytest.mark.slow
def test_a_replaced_export_is_kept_if_it_has_files_of_the_user(built: Dataset, tmp_path: Path) -> None:
    """A stopped export leaves nothing."""
    out, notices = tmp_path / "out", list[str]()
    out.mkdir()  # an empty folder is accepted
    exported(built, out)
    with pytest.raises(KeyboardInterrupt):
        shards.webdataset(built, out, _interrupt, SMALL * 2, replace=True)
    shards.webdataset(built, out, lambda *_: None, SMALL * 2, replace=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    (out / "notes.txt").write_text("mine")
    shards.webdataset(built, out, lambda *_: None, SMALL, replace=True, notice=notices.append)
    assert (tmp_path / "out.replaced" / "notes.txt").read_text() == "mine" and len(notices) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "out.replaced"]


def _interrupt(stage: str, done: int, total: int) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("text", ["[]", '{"files": 7}', '{"files": {"a": [-1, ""]}}', " " * (17 << 20) + "{}"])
def test_a_damaged_or_large_index_is_not_that_of_an_export(built: Dataset, tmp_path: Path, text: str) -> None:
    (tmp_path / "index.json").write_text(text)
    with pytest.raises(InputError, match="exists already, and is not this export"):
        exported(built, tmp_path)


@pytest.mark.parametrize("form", ["webdataset", "kitti"])
def test_few_bytes_of_a_forged_export_are_hashed(
    built: Dataset, tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sparse file of 1 TiB that an index lists would be hashed for 45 minutes. It takes no space in an archive."""
    out = tmp_path / "out"
    export = shards.webdataset if form == "webdataset" else partial(export_layout, form="kitti")
    index = json.loads(json.dumps(export(dataset=built, out=out, progress=lambda *_: None)))
    rows = index["shards"] if form == "webdataset" else index["files"]
    name = rows[0]["file"] if form == "webdataset" else next(iter(rows))
    size = 1 << 33
    os.truncate(out / name, size)
    if form == "webdataset":
        rows[0]["size"] = size
    else:
        rows[name][0] = size
    (out / INDEX).write_text(json.dumps(index))

    def unexpected(path: Path) -> str:
        assert path.stat().st_size < size
        return ""

    monkeypatch.setattr("recipe_runtime.core.files.file_sha256", unexpected)
    with pytest.raises(InputError, match="exists already"):
        export(dataset=built, out=out, progress=lambda *_: None)


def test_the_current_folder_is_not_replaced(built: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The shell would stay in the removed folder."""
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    for out in (Path(), Path("../empty")):
        with pytest.raises(InputError, match="is the current folder"):
            exported(built, out)
    assert not list((tmp_path / "empty").iterdir())


@pytest.mark.slow
def test_a_path_through_the_replaced_export_is_valid(
    built: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the old export is renamed, `exp/..` leads nowhere, and relative paths from a folder in it do not either."""
    out = tmp_path / "exp"
    export_layout(built, out, "mots", lambda *_: None)
    old = tree(out)
    monkeypatch.chdir(out / "seqmaps")
    with pytest.raises(InputError, match="is the current folder or contains it"):
        export_layout(built, Path("../../exp"), "kitti", lambda *_: None, replace=True)
    assert tree(out) == old and [path.name for path in tmp_path.iterdir()] == ["exp"]
    monkeypatch.chdir(tmp_path)
    export_layout(built, Path("exp/../exp"), "kitti", lambda *_: None, replace=True)
    assert (out / "training").is_dir() and [path.name for path in tmp_path.iterdir()] == ["exp"]


@pytest.mark.slow
def test_equal_datasets_give_equal_shards(built: Dataset, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere" / "copy"
    shutil.copytree(built.root, copy)
    one, other = exported(built, tmp_path / "one"), exported(read(copy), tmp_path / "other")
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in other]
    index = json.loads((tmp_path / "one" / INDEX).read_text())
    assert index["dataset"] == built.lock.identity
    assert [r["sha256"] for r in index["shards"]] == [hashlib.sha256(p.read_bytes()).hexdigest() for p in one]


@pytest.mark.slow
def test_an_existing_export_is_unchanged(built: Dataset, tmp_path: Path) -> None:
    made = exported(built, tmp_path / "out")
    times = [p.stat().st_mtime_ns for p in made]
    assert [p.stat().st_mtime_ns for p in exported(built, tmp_path / "out")] == times
    with pytest.raises(InputError, match="exists already, and is not this export"):
        exported(built, tmp_path / "out", SMALL * 2)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/notes.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        exported(built, tmp_path / "mine")


@pytest.mark.parametrize("damage", ["bytes", "missing", "link", "labels"])
def test_a_damaged_dataset_is_not_exported(built: Dataset, tmp_path: Path, damage: str) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(built.root, copy)
    dataset, name = read(copy), built.plan.variants[0].variant
    victim = copy / layout.frame_file(name, "street", "rgb", 3, built.plan.forms)
    if damage == "labels":
        victim = copy / layout.labels_file(name, "street")
        victim.write_bytes(victim.read_bytes().replace(b"hero1", b"hero9"))
    elif damage == "bytes":
        body = io.BytesIO()
        Image.new("RGB", (64, 48)).save(body, "PNG")
        victim.unlink()  # it may be a hard link
        victim.write_bytes(body.getvalue())
    else:
        victim.unlink()
        if damage == "link":
            victim.symlink_to("/etc/hostname")
    with pytest.raises(InputError, match="repair the dataset, then export it"):
        exported(dataset, tmp_path / "out")
    assert not list(tmp_path.glob("*out*")) and not list(tmp_path.glob(".*out*"))
