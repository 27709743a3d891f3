"""The store gives back what was put in, or nothing; names stand for whole files."""

import os
import resource
from pathlib import Path

import pytest
from recipe_compiler.errors import RunError
from recipe_runtime import store as store_module
from recipe_runtime.store import Store, default_cache, link_or_copy, write_atomic

from tests.runtime.fakes import scene_plan, simulate

KEY = "ab" * 32


def test_what_was_put_is_got(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.get("things", KEY) is None
    store.put("things", KEY, b"line\nline\n")
    assert Store(tmp_path).get("things", KEY) == b"line\nline\n"


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b[:80] + b"?" + b[81:], lambda b: b"", lambda b: b"x" + b]
)
def test_a_damaged_entry_counts_as_absent(tmp_path: Path, damage: object) -> None:
    store = Store(tmp_path)
    store.put("things", KEY, b"x" * 50)
    path = store.path("things", KEY)
    path.write_bytes(damage(path.read_bytes()))
    assert store.get("things", KEY) is None


def test_a_scene_is_simulated_once_and_again_when_damaged(tmp_path: Path) -> None:
    scene, store, calls = scene_plan(), Store(tmp_path), []

    def count() -> object:
        calls.append(1)
        return simulate(scene)

    first, second = store.trace(scene, count), store.trace(scene, count)  # type: ignore[arg-type]
    assert (len(calls), second.digest) == (1, first.digest)
    (entry,) = (p for p in tmp_path.rglob("*") if p.is_file())
    entry.write_bytes(entry.read_bytes()[:-3])
    assert store.trace(scene, count).digest == first.digest  # type: ignore[arg-type]
    assert len(calls) == 2


@pytest.mark.parametrize("ours", [True, False])
def test_a_full_disk_leaves_neither_file_nor_scrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ours: bool) -> None:
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path if ours else tmp_path / "elsewhere"))
    remedy = "free some space, or set RECIPE_CACHE" if ours else "free some space or allow writing$"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(RunError, match=f"File too large; {remedy}"):
            Store(tmp_path).put("things", KEY, b"x" * 1000)
        with pytest.raises(OSError, match="File too large") as caught:
            write_atomic(tmp_path / "picture.png", b"x" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.filename == str(tmp_path / "picture.png")
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == []


def test_another_hosts_process_of_our_number_is_left_alone(tmp_path: Path) -> None:
    """Two containers that share a folder may well share a process number."""
    theirs = tmp_path / f".a.{os.getpid()}.0.tmp"
    theirs.write_bytes(b"half a fi")
    write_atomic(tmp_path / "a", b"whole")
    link_or_copy(tmp_path / "a", tmp_path / "b")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {
        theirs.name: b"half a fi",
        "a": b"whole",
        "b": b"whole",
    }


def test_a_file_has_the_users_own_mode(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomic(tmp_path / "a", b"")
    finally:
        os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_the_environment_names_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "elsewhere"))
    assert default_cache() == tmp_path / "elsewhere"
    monkeypatch.delenv("RECIPE_CACHE")
    assert default_cache().name == "dataset-recipe"


def test_a_link_shares_the_file_and_a_copy_is_made_where_there_are_no_links(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "a"
    write_atomic(source, b"labels")
    link_or_copy(source, tmp_path / "sub" / "b")
    link_or_copy(source, tmp_path / "sub" / "b")  # again, as a resumed build does
    assert (tmp_path / "sub" / "b").samefile(source)

    def no_links(*_: object) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(store_module.os, "link", no_links)
    link_or_copy(source, tmp_path / "sub" / "c")
    assert (tmp_path / "sub" / "c").read_bytes() == b"labels"
    assert not (tmp_path / "sub" / "c").samefile(source)
    assert sorted(os.listdir(tmp_path / "sub")) == ["b", "c"]  # noqa: PTH208
