"""A repair builds damaged files again in place, and changes neither the other files nor the identity."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.errors import RunError
from recipe_runtime.build.pipeline import BuildOptions, BuildResult, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import lock_of, read
from recipe_runtime.verify.verify import Options, verify_files

from tests.runtime.build.test_reuse import Calls, counting
from tests.runtime.fakes import dataset_plan, tree

PLAN = dataset_plan(frames=6, weathers=2)
STREET = "weather=w0,jitter=still/street"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return _build(tmp_path_factory.mktemp("original"))


@pytest.fixture
def made(original: BuildResult, tmp_path: Path) -> BuildResult:
    """Return a copy of a build and of its cache that preserves hard links."""
    subprocess.run(["cp", "-a", f"{original.path.parent}/.", tmp_path], check=True)
    return replace(original, path=tmp_path / original.path.name)


def _build(folder: Path, calls: Calls | None = None, *, repair: bool = False) -> BuildResult:
    engines = counting([] if calls is None else calls)
    return build(PLAN, folder / "tiny", BuildOptions(workers=0, cache=folder / "cache", engines=engines, repair=repair))


def _flip(path: Path) -> None:
    """Flip one bit in place, which damages all hard links of the file."""
    body = path.read_bytes()
    path.write_bytes(body[:-9] + bytes([body[-9] ^ 1]) + body[-8:])


def _is_intact(root: Path) -> bool:
    return verify_files(read(root), Options(nonce=1), lambda *_: None).verdict == "PASS"


def _inodes(root: Path) -> dict[str, int]:
    return {path: (root / path).stat().st_ino for path in tree(root)}


@pytest.mark.slow
def test_a_flipped_bit_is_detected_and_only_its_frame_is_rendered_again(made: BuildResult, tmp_path: Path) -> None:
    before, inodes, calls = tree(made.path), _inodes(made.path), Calls()
    _flip(made.path / STREET / "rgb/000003.png")
    assert not _build(tmp_path).built  # the sizes are unchanged
    assert not _is_intact(made.path)
    repaired = _build(tmp_path, calls, repair=True)
    assert [what for what, _ in calls] == ["observe", "shade", "shade"]  # frame 3, in the view's two weathers
    assert repaired.repaired == (f"{STREET}/rgb/000003.png differs from its SHA-256 in the manifest",)
    assert (repaired.identity, tree(repaired.path)) == (made.identity, before)
    assert _is_intact(made.path)
    kept = [path for path, inode in _inodes(made.path).items() if inode == inodes[path] and "/rgb/" in path]
    assert len(kept) == sum("/rgb/" in path for path in before) - 2


@pytest.mark.slow
def test_a_shared_label_file_is_repaired_in_every_variant(made: BuildResult, tmp_path: Path) -> None:
    """The variants share one file by hard links; one of them may also be a separate, damaged copy."""
    before = tree(made.path)
    shared = made.path / STREET / "depth/000002.png"
    assert shared.stat().st_nlink > 1
    _flip(shared)
    alone = made.path / "weather=w1,jitter=still/street/depth/000004.png"
    body = alone.read_bytes()
    alone.unlink()
    alone.write_bytes(body)
    _flip(alone)
    repaired = _build(tmp_path, repair=True)
    assert len(repaired.repaired) == shared.stat().st_nlink + 1
    assert tree(repaired.path) == before
    assert alone.stat().st_nlink == shared.stat().st_nlink > 1


@pytest.mark.slow
@pytest.mark.parametrize("key", ["plan", "scene"])
def test_a_dataset_whose_manifest_has_another_plan_of_a_variant_is_built_again(
    made: BuildResult, tmp_path: Path, key: str
) -> None:
    """A plan's digest is not part of the identity, so a manifest with any digest is consistent."""
    path = made.path / "manifest.json"
    before, manifest = path.read_bytes(), json.loads(path.read_text())
    manifest["variants"]["weather=w0,jitter=still"][key] = "1" * 64
    manifest["identity"] = lock_of(manifest).identity
    path.write_text(pretty(manifest))
    assert _build(tmp_path).built
    assert path.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [
        f"{STREET}/labels.jsonl",
        "weather=w0,jitter=still/tracks.csv",
        "plans/weather=w0,jitter=still.json",
        "annotations/kwcoco.json",
        "README.md",
        "preview/contact_sheet.png",
        "preview/index.html",
        "preview/data/view-0-0.js",
        "mots/seqmaps/MOTS-train.txt",
    ],
)
@pytest.mark.parametrize("gone", [False, True])
def test_every_other_kind_of_file_is_repaired(made: BuildResult, tmp_path: Path, path: str, gone: bool) -> None:
    before = tree(made.path)
    if gone:
        (made.path / path).unlink()
    else:
        _flip(made.path / path)
    assert any(path in line for line in _build(tmp_path, repair=True).repaired)
    assert tree(made.path) == before


@pytest.mark.slow
def test_links_and_pipes_in_place_of_a_file_are_replaced(made: BuildResult, tmp_path: Path) -> None:
    before, outside = tree(made.path), tmp_path / "outside.png"
    outside.write_bytes(before[f"{STREET}/rgb/000001.png"])
    for path in ("rgb/000001.png", "labels.jsonl"):
        (made.path / STREET / path).unlink()
    (made.path / STREET / "rgb/000001.png").symlink_to(outside)
    os.mkfifo(made.path / STREET / "labels.jsonl")
    assert len(_build(tmp_path, repair=True).repaired) == 2
    assert tree(made.path) == before and not (made.path / STREET / "rgb/000001.png").is_symlink()


def test_an_intact_dataset_is_unchanged(made: BuildResult, tmp_path: Path) -> None:
    inodes, calls = _inodes(made.path), Calls()
    result = _build(tmp_path, calls, repair=True)
    assert (result.built, result.repaired, calls, _inodes(made.path)) == (False, (), [], inodes)


@pytest.mark.slow
def test_a_damaged_trace_in_the_cache_is_not_used(made: BuildResult, tmp_path: Path) -> None:
    before = tree(made.path)
    for path in (tmp_path / "cache" / "traces").rglob("*"):
        if path.is_file():
            _flip(path)
    _flip(made.path / STREET / "rgb/000003.png")
    _build(tmp_path, repair=True)
    assert tree(made.path) == before


@pytest.mark.slow
def test_a_host_that_renders_other_bytes_cannot_repair(made: BuildResult, tmp_path: Path) -> None:
    """Otherwise the dataset would keep its identity and contain frames of two renderers."""
    manifest = json.loads((made.path / layout.MANIFEST).read_text())
    rows = manifest["variants"]["weather=w0,jitter=still"]["frames"]["street"]["rgb"]
    rows[3] = "0" * 64
    from recipe_runtime.dataset.manifest import lock_of

    manifest["identity"] = lock_of(manifest).identity
    (made.path / layout.MANIFEST).write_text(json.dumps(manifest))
    _flip(made.path / STREET / "rgb/000003.png")
    before = tree(made.path)
    with pytest.raises(RunError, match=r"its manifest says tiny@sha256:.*nothing was changed.*recipe verify"):
        _build(tmp_path, repair=True)
    assert tree(made.path) == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cache", "tiny"]


def test_a_foreign_file_is_not_removed(made: BuildResult, tmp_path: Path) -> None:
    (made.path / "notes.txt").write_text("mine")
    assert _build(tmp_path, repair=True).repaired == ("notes.txt is not in the manifest",)
    assert not (made.path / "notes.txt").exists()
    assert (tmp_path / "tiny.replaced" / "notes.txt").read_text() == "mine"


def test_a_dataset_that_cannot_be_read_is_built_again(made: BuildResult, tmp_path: Path) -> None:
    """All of its files are there, so the repair reported that nothing is damaged; `verify` cannot read it."""
    before = tree(made.path)
    manifest = json.loads((made.path / layout.MANIFEST).read_text())
    (made.path / layout.MANIFEST).write_text(pretty({**manifest, "recipe_file": layout.CARD}))
    assert _build(tmp_path, repair=True).built
    assert tree(made.path) == before
