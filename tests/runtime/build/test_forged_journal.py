"""A build does not resume from a forged work folder: its seal needs the key in this user's cache."""

from __future__ import annotations

import json
import stat
import tracemalloc
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import RunError
from recipe_runtime.build.pipeline import BuildResult, build, kept_frames
from recipe_runtime.build.workspace import Workspace
from recipe_runtime.cache.journal_key import KEY, journal_key, read_key

from tests.runtime.fakes import BROKEN, ENGINES, dataset_plan, tree

PLAN = dataset_plan(frames=8)


def made(folder: Path, cache: Path) -> BuildResult:
    return build(PLAN, folder / "tiny", workers=0, cache=cache, engines=ENGINES, shard_frames=2)


def stopped(folder: Path, cache: Path) -> None:
    with pytest.raises(RunError):
        build(PLAN, folder / "tiny", workers=0, cache=cache, engines=BROKEN, shard_frames=2)


@pytest.mark.slow
def test_a_stopped_build_resumes_only_with_the_cache_that_sealed_it(tmp_path: Path) -> None:
    """Plan, code and the files' digests are right, but the records were sealed by another user."""
    truth = tree(made(tmp_path / "truth", tmp_path / "cache").path)
    stopped(tmp_path / "own", tmp_path / "cache")
    stopped(tmp_path / "forged", tmp_path / "strangers")
    assert kept_frames(PLAN, tmp_path / "own/tiny", tmp_path / "cache") > 0
    assert kept_frames(PLAN, tmp_path / "forged/tiny", tmp_path / "cache") == 0
    own, forged = (made(tmp_path / name, tmp_path / "cache") for name in ("own", "forged"))
    assert own.resumed > 0
    assert forged.resumed == 0
    assert tree(own.path) == tree(forged.path) == truth


@pytest.mark.slow
def test_a_record_with_a_wrong_seal_is_not_used(tmp_path: Path) -> None:
    """An attacker who knows the job's seal can neither forge a record nor swap those of two shards."""
    stopped(tmp_path, tmp_path / "cache")
    records = sorted((tmp_path / ".tiny.partial/shards").iterdir())
    assert len(records) > 1
    records[0].write_bytes(records[1].read_bytes())
    records[1].write_bytes(b"0" * 64 + b"\n[]")
    assert made(tmp_path, tmp_path / "cache").resumed == len(records) - 2


@pytest.mark.slow
def test_a_record_without_its_seal_is_not_parsed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: 256 MiB of nested lists were parsed, in many times that memory, before the seal was checked."""
    stopped(tmp_path, tmp_path / "cache")
    parsed, original = list[bytes](), json.loads

    def loads(text: bytes) -> object:
        parsed.append(text)
        return original(text)

    monkeypatch.setattr(json, "loads", loads)
    for path in sorted((tmp_path / ".tiny.partial/shards").iterdir()):
        path.write_bytes(b"0" * 64 + b"\n" + b"[" * 100)
    assert made(tmp_path, tmp_path / "cache").resumed == 0
    assert b"[" * 100 not in parsed


def test_a_job_of_gigabytes_is_not_read(tmp_path: Path) -> None:
    """Regression: a sparse `job.json` of 3 GB in a downloaded work folder took 6 GB of memory."""
    partial = tmp_path / ".tiny.partial"
    partial.mkdir()
    with (partial / "job.json").open("wb") as file:
        file.truncate(3 << 30)
    tracemalloc.start()
    try:
        with Workspace(tmp_path / "tiny", None):
            assert tracemalloc.get_traced_memory()[1] < 1 << 26
    finally:
        tracemalloc.stop()


def test_the_key_is_created_once_and_readable_only_by_the_user(tmp_path: Path) -> None:
    key = journal_key(tmp_path)
    assert len(key) == 32
    assert journal_key(tmp_path) == read_key(tmp_path) == key
    assert stat.S_IMODE((tmp_path / KEY).stat().st_mode) == 0o600


def test_without_a_writable_cache_each_key_is_new(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert journal_key(tmp_path / "file") != journal_key(tmp_path / "file")
    assert read_key(tmp_path / "file") is None
