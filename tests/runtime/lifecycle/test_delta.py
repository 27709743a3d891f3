"""A delta has only what the earlier dataset lacks, and merging gives the other dataset to the byte; forgeries fail."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.dataset import reader
from recipe_runtime.lifecycle.delta import apply_delta, is_delta, write_delta

from tests.cli.runner import run_here
from tests.runtime import fakes
from tests.runtime.fakes import quiet


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return two datasets: of one weather, and of two."""
    root = tmp_path_factory.mktemp("pair")
    made = []
    for weathers in (1, 2):
        options = BuildOptions(workers=0, cache=root / f"cache{weathers}", engines=fakes.ENGINES)
        made.append(build(fakes.dataset_plan(frames=4, weathers=weathers), root / f"d{weathers}", options).path)
    return made[0], made[1]


@pytest.fixture
def delta(pair: tuple[Path, Path], tmp_path: Path) -> Path:
    write_delta(reader.read(pair[0]), reader.read(pair[1]), tmp_path / "delta", quiet)
    return tmp_path / "delta"


def content(root: Path) -> dict[str, str]:
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in root.rglob("*")
        if path.is_file()
    }


def test_merging_gives_the_other_dataset(pair: tuple[Path, Path], delta: Path, tmp_path: Path) -> None:
    before = content(pair[0])
    made = apply_delta(reader.read(pair[0]), delta, tmp_path / "made", quiet)
    assert content(tmp_path / "made") == content(pair[1])
    assert made.lock.identity == reader.read(pair[1]).lock.identity
    assert content(pair[0]) == before and is_delta(delta) and not is_delta(pair[0])


def test_a_delta_has_each_new_content_once(pair: tuple[Path, Path], delta: Path) -> None:
    first, second = (set(content(root).values()) for root in pair)
    there = {path.name for path in (delta / "files").iterdir()}
    assert there == second - first
    assert 0 < len(there) < len(second)


def test_the_delta_to_itself_is_the_manifest(pair: tuple[Path, Path], tmp_path: Path) -> None:
    held = reader.read(pair[0])
    assert list(write_delta(held, held, tmp_path / "same", quiet)["files"]) == [content(pair[0])["manifest.json"]]
    apply_delta(held, tmp_path / "same", tmp_path / "made", quiet)
    assert content(tmp_path / "made") == content(pair[0])


def forge(delta: Path, **changes: Any) -> None:
    document = json.loads((delta / "delta.json").read_text())
    (delta / "delta.json").write_text(json.dumps({**document, **changes}))


def test_a_delta_to_another_dataset_is_refused(pair: tuple[Path, Path], delta: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a delta to"):
        apply_delta(reader.read(pair[1]), delta, tmp_path / "made", quiet)


@pytest.mark.parametrize("damage", ["missing", "changed", "link", "manifest", "index", "extra", "identity"])
def test_a_damaged_or_forged_delta_leaves_nothing(
    pair: tuple[Path, Path], delta: Path, tmp_path: Path, damage: str
) -> None:
    document = json.loads((delta / "delta.json").read_text())
    picture = next(delta / "files" / name for name in document["files"] if name != document["manifest"])
    manifest = delta / "files" / document["manifest"]
    if damage == "missing":
        picture.unlink()
    elif damage == "changed":
        body = picture.read_bytes()
        picture.unlink()
        picture.write_bytes(body[:-1] + b"x")
    elif damage == "link":
        target = shutil.move(picture, tmp_path / "elsewhere")
        picture.symlink_to(target)
    elif damage == "manifest":  # a manifest whose paths lead out of the folder, with a matching digest
        text = manifest.read_text().replace(
            '"files": {', '"files": {"../out": {"size": 1, "sha256": "' + "0" * 64 + '"},'
        )
        name = hashlib.sha256(text.encode()).hexdigest()
        (delta / "files" / name).write_text(text)
        forge(delta, manifest=name, files={**document["files"], name: len(text.encode())})
    elif damage == "index":
        (delta / "delta.json").write_text("[")
    elif damage == "extra":
        forge(delta, other=1)
    else:
        forge(delta, after="other@sha256:" + "0" * 64)
    with pytest.raises(InputError):
        apply_delta(reader.read(pair[0]), delta, tmp_path / "made", quiet)
    assert not (tmp_path / "made").exists() and not (tmp_path / "out").exists()
    assert not list(tmp_path.glob(".made*"))


def test_the_commands(pair: tuple[Path, Path], tmp_path: Path) -> None:
    first, second = pair
    done = run_here("diff", first, second, "-o", "delta", cwd=tmp_path)
    assert done.returncode == 0 and "files," in done.stdout, done.stderr
    assert run_here("diff", first, second, "-o", "delta", cwd=tmp_path).returncode == 2  # it exists
    assert run_here("merge", first, "delta", cwd=tmp_path).returncode == 2  # without --output
    done = run_here("merge", first, "delta", "-o", "made", "--json", cwd=tmp_path)
    assert done.returncode == 0 and json.loads(done.stdout)["identity"] == reader.read(second).lock.identity
    assert content(tmp_path / "made") == content(second)
    refused = run_here("merge", first, second, "-o", "other", cwd=tmp_path)
    assert refused.returncode == 2 and "is not a delta dataset" in refused.stderr
    assert run_here("diff", first, tmp_path / "delta", "-o", "x", cwd=tmp_path).returncode == 2
