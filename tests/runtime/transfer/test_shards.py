"""WebDataset shards contain a dataset's own files, the library reads them, and equal datasets give equal shards."""

from __future__ import annotations

import gc
import hashlib
import io
import json
import os
import shutil
import sys
import tarfile
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import webdataset
from PIL import Image
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import Dataset, read
from recipe_runtime.transfer import export_folder, shards
from recipe_runtime.transfer.export_folder import MARKER
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
        layout.frame_file(variant.variant, sensor.name, modality, frame, built.plan.depth)
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
def test_two_exports_at_once_and_a_folder_in_the_way(built: Dataset, tmp_path: Path) -> None:
    met: list[int] = []

    def meet(stage: str, done: int, total: int) -> None:
        if not met:
            met.append(done)
            with pytest.raises(RunError, match="another export is writing"):
                exported(built, tmp_path / "out")

    shards.webdataset(built, tmp_path / "out", meet, SMALL)
    assert met and not list(tmp_path.glob(".out*"))
    (tmp_path / ".other.export").mkdir()
    (tmp_path / ".other.export" / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="is not the work folder of an export"):
        exported(built, tmp_path / "other")


@pytest.mark.parametrize("work", ["link", "tar"])
def test_a_folder_that_no_export_made_is_not_removed(built: Dataset, tmp_path: Path, work: str) -> None:
    """This includes a symbolic link, and a folder whose files are named like shards."""
    folder = tmp_path / ("elsewhere" if work == "link" else ".out.export")
    folder.mkdir()
    (folder / "backup.tar").write_text("precious")
    if work == "link":
        (tmp_path / ".out.export").symlink_to(folder)
    with pytest.raises(InputError, match="is not the work folder of an export"):
        exported(built, tmp_path / "out")
    assert (folder / "backup.tar").read_text() == "precious"


@pytest.mark.slow
def test_the_work_folder_of_a_killed_export_is_removed(built: Dataset, tmp_path: Path) -> None:
    def die(stage: str, done: int, total: int) -> None:
        left.append([(p.name, p.read_bytes()) for p in sorted((tmp_path / ".out.export").iterdir())])

    left: list[list[tuple[str, bytes]]] = []
    made = shards.webdataset(built, tmp_path / "out", die, SMALL)
    (tmp_path / ".again.export").mkdir()
    for name, body in left[-1]:
        (tmp_path / ".again.export" / name).write_bytes(body)
    assert shards.webdataset(built, tmp_path / "again", lambda *_: None, SMALL) == made
    assert not list(tmp_path.glob(".again*"))


def _is_killed(change: int, export: Callable[[], object]) -> bool:
    """Export in a child process that is killed at the n-th change of a folder, from the move of the old export on."""
    child = os.fork()
    if child == 0:
        left = [change, 0]

        def audit(event: str, arguments: tuple[object, ...]) -> None:
            left[1] |= str(arguments[0]).endswith(".out.replaced")
            if left[1] and event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir"):
                left[0] -= 1
                if left[0] == 0:
                    os._exit(9)

        sys.addaudithook(audit)
        try:
            export()
            os._exit(0)
        finally:
            os._exit(1)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, 9)
    return code == 9


def test_a_killed_replacement_leaves_the_old_or_the_new_export(built: Dataset, tmp_path: Path) -> None:
    """The process is killed before each change of a folder; the next export finds one of the two, complete."""
    out, size = tmp_path / "out", 1 << 30
    shards.webdataset(built, out, lambda *_: None, size)
    shutil.copytree(out, tmp_path / "old")
    old, change = tree(out), 0
    found: list[str | None] = []
    while not found or found[-1] is not None:
        change += 1
        shutil.rmtree(out)
        shutil.copytree(tmp_path / "old", out)
        was_killed = _is_killed(change, partial(shards.webdataset, built, out, lambda *_: None, size + 1, replace=True))
        try:
            shards.webdataset(built, out, lambda *_: None, size + 1)
        except InputError as error:
            assert "exists already, and is another export" in str(error) and tree(out) == old
            shards.webdataset(built, out, lambda *_: None, size + 1, replace=True)
            found.append("old")
        else:
            found.append("new" if was_killed else None)
        assert tree(out).keys() == old.keys() and not list(tmp_path.glob(".out*"))
        assert json.loads((out / shards.INDEX).read_text())["shard_bytes"] == size + 1
    assert set(found) == {"old", "new", None} and len(found) > 8


def test_files_added_during_an_export_are_not_removed(built: Dataset, tmp_path: Path) -> None:
    out = tmp_path / "out"
    exported(built, out)

    def add_notes(stage: str, done: int, total: int) -> None:
        (out / "notes.txt").write_text("mine")

    with pytest.raises(InputError, match="was changed during the export"):
        shards.webdataset(built, out, add_notes, replace=True)
    assert (out / "notes.txt").read_text() == "mine" and (out / shards.INDEX).exists()
    assert not list(tmp_path.glob(".out*"))


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_made_by_another_program_at_the_end_of_an_export_is_kept(
    built: Dataset, tmp_path: Path, there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: the old export was deleted, with what the other program had written into it."""
    out = tmp_path / "out"
    if there:
        exported(built, out)
        (tmp_path / ".out.replaced").mkdir()
    rename = Path.rename

    def renamed(path: Path, target: Path) -> Path:
        if target == out:
            out.mkdir()
            (out / "model.pt").write_text("mine")
        return rename(path, target)

    with monkeypatch.context() as patch, pytest.raises(InputError, match="out was made by another program"):
        patch.setattr(Path, "rename", renamed)
        shards.webdataset(built, out, lambda *_: None, 100_000, replace=True)
    assert (out / "model.pt").read_text() == "mine"
    assert there == (tmp_path / ".out.replaced" / "export" / shards.INDEX).exists()
    if there:
        with pytest.raises(InputError, match=r"made by another program.*move it away and \S+export back"):
            exported(built, out)
        shutil.rmtree(out)
        exported(built, out)
    assert not list(tmp_path.glob(".out*"))


def test_an_export_that_arrives_during_an_export_is_not_replaced(built: Dataset, tmp_path: Path) -> None:
    """Regression: only its file names were compared, which are those of every export of the dataset."""
    out, arrived = tmp_path / "out", tmp_path / "arrived"
    exported(built, out)
    exported(built, arrived)
    before = tree(arrived)

    def swap(stage: str, done: int, total: int) -> None:
        if arrived.exists():
            shutil.rmtree(out)
            arrived.rename(out)

    with pytest.raises(InputError, match="was changed during the export"):
        shards.webdataset(built, out, swap, 100_000, replace=True)
    assert tree(out) == before


def test_the_work_folder_of_the_next_export_is_not_removed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with export_folder.work_folder(out, lambda _: True) as work:
        (work / "shard").write_text("first")
        export_folder.publish(work, out, None)
        work.mkdir()
        (work / "shard").write_text("second")
    assert (out / "shard").read_text() == "first"
    assert (work / "shard").read_text() == "second"


def test_a_work_folder_whose_removal_was_interrupted_is_used_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The marker was removed in the order of the host's listing; the next export refused the rest of the folder."""

    def interrupt(path: Path) -> None:
        raise KeyboardInterrupt(path)

    def export(body: Callable[[Path], object]) -> None:
        with export_folder.work_folder(tmp_path / "out", lambda _: True) as work:
            body(work)

    with pytest.raises(KeyboardInterrupt), monkeypatch.context() as patched:
        patched.setattr(export_folder, "remove_tree", interrupt)
        export(lambda work: (work / "shard").write_text("first"))
    assert {path.name for path in (tmp_path / ".out.export").iterdir()} == {MARKER, "shard"}
    export(lambda work: None)
    assert not list(tmp_path.iterdir())


def test_a_foreign_folder_in_place_of_a_replaced_export_is_refused(built: Dataset, tmp_path: Path) -> None:
    (tmp_path / ".out.replaced" / "export").mkdir(parents=True)
    (tmp_path / ".out.replaced" / "export" / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="is not the folder of a replaced export"):
        exported(built, tmp_path / "out")
    assert (tmp_path / ".out.replaced" / "export" / "thesis.tex").read_text() == "precious"


@pytest.mark.slow
@pytest.mark.parametrize("forgery", ["bytes", "folder", "name", "type", "link", "device", "text", "many"])
def test_a_forged_export_is_not_accepted_and_its_links_not_followed(
    built: Dataset, tmp_path: Path, forgery: str
) -> None:
    out, precious = tmp_path / "out", tmp_path / "precious"
    first = exported(built, out)[0]
    index = json.loads((out / shards.INDEX).read_text())
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
        (out / shards.INDEX).unlink()
        (out / shards.INDEX).symlink_to("/dev/zero")
    elif forgery in ("text", "many"):
        index["shards"][0]["samples"] = "3" if forgery == "text" else 10**30
        (out / shards.INDEX).write_text(json.dumps(index))
    else:
        index["shards"] = [{**index["shards"][0], "file": "../precious"}] if forgery == "name" else 7
        (out / shards.INDEX).write_text(json.dumps(index))
    with pytest.raises(InputError, match="exists already"):
        exported(built, out)
    if forgery == "link":
        shards.webdataset(built, out, lambda *_: None, SMALL, replace=True)
    elif forgery == "folder":
        with pytest.raises(InputError, match="has files that do not belong to an export"):
            shards.webdataset(built, out, lambda *_: None, SMALL, replace=True)
        assert (first / "thesis.tex").read_text() == "precious"
    assert precious.read_text() == "precious"


@pytest.mark.parametrize("export", [shards.webdataset, partial(export_layout, form="kitti")])
@pytest.mark.parametrize(
    ("head", "row", "tail"),
    [
        ('{"shards":[', "[],", "[]]}"),
        ('{"files":{', '"%08x":["",0],', '"":[]}}'),
    ],
)
def test_a_forged_index_takes_little_memory(
    built: Dataset, tmp_path: Path, export: Callable[..., object], head: str, row: str, tail: str
) -> None:
    """16 MiB of empty lists would take 400 MB, and 420 MB of short texts took 5.1 GB.

    A longer index than a dataset's export can have is not read.
    """
    rows = (16 << 20) // len(row.encode()) - 8
    text = "".join(row % number for number in range(rows)) if "%" in row else row * rows
    for size in ((16 << 20) - 4, 1 << 28):
        with (tmp_path / "index.json").open("wb") as file:
            file.write((head + text + tail).encode())
            file.truncate(size)
        tracemalloc.start()
        try:
            with pytest.raises(InputError, match="has files that do not belong to an export"):
                export(dataset=built, out=tmp_path, progress=lambda *_: None, replace=True)
            assert tracemalloc.get_traced_memory()[1] < 40 << 20
        finally:
            tracemalloc.stop()


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
    (out / shards.INDEX).write_text(json.dumps(index))

    def unexpected(path: Path) -> str:
        assert path.stat().st_size < size
        return ""

    monkeypatch.setattr("recipe_runtime.core.files.file_sha256", unexpected)
    monkeypatch.setattr("recipe_runtime.transfer.shards.file_sha256", unexpected)
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


def test_a_marker_that_is_a_link_is_not_followed(built: Dataset, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("precious")
    os.utime(tmp_path / "mine", (1, 1))
    (tmp_path / ".out.export").mkdir()
    (tmp_path / ".out.export" / MARKER).symlink_to(tmp_path / "mine")
    with pytest.raises(InputError, match="is not the work folder of an export"):
        exported(built, tmp_path / "out")
    assert (tmp_path / "mine").stat().st_mtime == 1


@pytest.mark.slow
def test_equal_datasets_give_equal_shards(built: Dataset, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere" / "copy"
    shutil.copytree(built.root, copy)
    one, other = exported(built, tmp_path / "one"), exported(read(copy), tmp_path / "other")
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in other]
    index = json.loads((tmp_path / "one" / shards.INDEX).read_text())
    assert index["dataset"] == built.lock.identity
    assert [r["sha256"] for r in index["shards"]] == [hashlib.sha256(p.read_bytes()).hexdigest() for p in one]


@pytest.mark.slow
def test_an_existing_export_is_unchanged(built: Dataset, tmp_path: Path) -> None:
    made = exported(built, tmp_path / "out")
    times = [p.stat().st_mtime_ns for p in made]
    assert [p.stat().st_mtime_ns for p in exported(built, tmp_path / "out")] == times
    with pytest.raises(InputError, match="exists already, and is another export"):
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
    victim = copy / layout.frame_file(name, "street", "rgb", 3, built.plan.depth)
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
