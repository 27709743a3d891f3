"""The store returns exactly what was stored or nothing; a name always refers to a complete file."""

import os
import resource
from collections.abc import Callable
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.cache.store import Store, create_cache_folder, default_cache, is_cache_folder
from recipe_runtime.core.files import link_or_copy, write_atomic
from recipe_runtime.core.trace import Trace

from tests.runtime.fakes import scene_plan, simulate

KEY = "ab" * 32


def test_a_new_cache_is_tagged_and_marked(tmp_path: Path) -> None:
    """Backup programs recognise CACHEDIR.TAG by its first 43 bytes. The folder may be a link to another disk."""
    (tmp_path / "disk").mkdir()
    (tmp_path / "cache").symlink_to(tmp_path / "disk")
    Store(tmp_path / "cache").put("traces", KEY, b"")
    assert (tmp_path / "disk" / "CACHEDIR.TAG").read_bytes()[:43] == b"Signature: 8a477f597d28d172789f06886806bc55"
    assert (tmp_path / "disk" / "dataset-recipe-cache").read_bytes().startswith(b"recipe/cache/1\n")
    assert is_cache_folder(tmp_path / "cache")
    (tmp_path / "disk" / "dataset-recipe-cache").write_bytes(b"recipe/cache/2\n")
    with pytest.raises(InputError, match="it holds CACHEDIR"):
        is_cache_folder(tmp_path / "cache")


def test_two_processes_can_mark_a_folder_at_once(tmp_path: Path) -> None:
    """A marker that the other process has written in part does not make the folder refused."""
    (tmp_path / ".dataset-recipe-cache.17.0.tmp").write_bytes(b"recip")
    create_cache_folder(tmp_path)
    assert is_cache_folder(tmp_path)


def test_a_stored_entry_is_returned(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert store.get("pixels", KEY) is None
    store.put("pixels", KEY, b"line\nline\n")
    assert Store(tmp_path).get("pixels", KEY) == b"line\nline\n"


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b[:80] + b"?" + b[81:], lambda b: b"", lambda b: b"x" + b]
)
def test_a_damaged_entry_counts_as_absent(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    store = Store(tmp_path)
    store.put("pixels", KEY, b"x" * 50)
    path = store.path("pixels", KEY)
    path.write_bytes(damage(path.read_bytes()))
    assert store.get("pixels", KEY) is None


def test_a_scene_is_simulated_once_and_again_if_its_trace_is_damaged(tmp_path: Path) -> None:
    scene, store, calls = scene_plan(), Store(tmp_path), list[int]()

    def count() -> Trace:
        calls.append(1)
        return simulate(scene)

    first, second = store.trace(scene, count), store.trace(scene, count)
    assert (len(calls), second.digest) == (1, first.digest)
    (entry,) = tmp_path.glob("traces/*/*")
    entry.write_bytes(entry.read_bytes()[:-3])
    assert store.trace(scene, count).digest == first.digest
    assert len(calls) == 2


def test_an_entry_is_bound_to_its_kind_and_key(tmp_path: Path) -> None:
    """An entry copied over another is intact, but its first line names another kind or key."""
    store, other = Store(tmp_path), "ab" + "cd" * 31
    store.put("pixels", KEY, b"mine")
    for kind, key in (("pixels", other), ("traces", KEY)):
        path = store.path(kind, key)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(store.path("pixels", KEY).read_bytes())
        assert store.get(kind, key) is None
    assert store.get("pixels", KEY) == b"mine"


def test_the_store_accepts_only_its_own_kinds(tmp_path: Path) -> None:
    """Pruning uses the list of kinds, so an entry of another kind would never be removed."""
    with pytest.raises(ValueError, match="no kind 'things'"):
        Store(tmp_path).put("things", KEY, b"")


@pytest.mark.parametrize("ours", [True, False])
def test_a_full_disk_leaves_no_partial_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ours: bool) -> None:
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path if ours else tmp_path / "elsewhere"))
    remedy = "free some space, or set RECIPE_CACHE" if ours else "free some space or allow writing$"
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20, before[1]))
    try:
        with pytest.raises(RunError, match=f"File too large; {remedy}"):
            Store(tmp_path).put("pixels", KEY, b"x" * 1000)
        with pytest.raises(OSError, match="File too large") as caught:
            write_atomic(tmp_path / "picture.png", b"x" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.filename == str(tmp_path / "picture.png")
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == []


def test_a_file_has_the_mode_of_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_atomic(tmp_path / "a", b"")
    finally:
        os.umask(before)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o640


def test_an_environment_variable_sets_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path / "elsewhere"))
    assert default_cache() == tmp_path / "elsewhere"
    monkeypatch.delenv("RECIPE_CACHE")
    assert default_cache().name == "dataset-recipe"


@pytest.mark.parametrize("found", [None, "~/.cache/dataset-recipe"])
def test_a_user_without_a_home_folder_is_an_error(monkeypatch: pytest.MonkeyPatch, found: str | None) -> None:
    """Versions of platformdirs differ: one raises an error, others return `~`, which is then made where the user is."""

    def user_cache_dir(name: str) -> str:
        if found is None:
            raise RuntimeError("could not determine the home directory")
        return found

    monkeypatch.delenv("RECIPE_CACHE", raising=False)
    monkeypatch.setattr("platformdirs.user_cache_dir", user_cache_dir)
    with pytest.raises(InputError, match="no home folder for the cache; set RECIPE_CACHE"):
        default_cache()


@pytest.mark.parametrize("name", ["n" * 255, "\N{SNOWMAN}" * 85], ids=["ASCII", "UTF-8"])
def test_the_longest_name_of_a_file_can_be_written(tmp_path: Path, name: str) -> None:
    write_atomic(tmp_path / name, b"body")
    assert (tmp_path / name).read_bytes() == b"body"


def test_files_are_hard_linked_or_copied_where_links_are_impossible(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "a"
    write_atomic(source, b"labels")
    link_or_copy(source, tmp_path / "sub" / "b")
    link_or_copy(source, tmp_path / "sub" / "b")  # a second time, as in a resumed build
    assert (tmp_path / "sub" / "b").samefile(source)

    def no_links(*_: object) -> None:
        raise OSError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    link_or_copy(source, tmp_path / "sub" / "c")
    assert (tmp_path / "sub" / "c").read_bytes() == b"labels"
    assert not (tmp_path / "sub" / "c").samefile(source)
    assert sorted(os.listdir(tmp_path / "sub")) == ["b", "c"]  # noqa: PTH208


def test_an_unwritable_folder_is_an_error() -> None:
    with pytest.raises(FileNotFoundError):
        write_atomic(Path("/proc/no-such-file.txt"), b"x")
