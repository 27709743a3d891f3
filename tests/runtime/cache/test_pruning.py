"""The cache can be listed and pruned; a folder without the marker is never changed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.cache import pruning
from recipe_runtime.cache.pruning import auto_prune, bytes_of, entries, lease, prune, sizes
from recipe_runtime.cache.store import Store, create_cache_folder
from recipe_runtime.render.device import setup

from tests.runtime.fakes import ENGINES, dataset_plan, tree


def _filled(root: Path) -> Store:
    """Create three traces (the second used last), a kernel and a foreign file."""
    store = Store(root)
    for number, key in enumerate(("aa" * 32, "bb" * 32, "cc" * 32)):
        store.put("traces", key, b"x" * 1000)
        os.utime(store.path("traces", key), (100.0 + number, 100.0 + number))
    assert store.get("traces", "bb" * 32) is not None
    module = root / "kernels" / "0.1.0-x86_64" / "1.19.0" / "wp_shade"
    module.mkdir(parents=True)
    (module / "wp_shade.o").write_bytes(b"k" * 500)
    os.utime(root / "kernels" / "0.1.0-x86_64", (50.0, 50.0))
    return store


def test_sizes_are_reported_by_kind(tmp_path: Path) -> None:
    _filled(tmp_path)
    reported = sizes(entries([tmp_path]))
    assert reported["kernels"] == (1, 500)
    assert reported["traces"][0] == 3


def test_the_least_recently_used_entry_is_removed_first(tmp_path: Path) -> None:
    store = _filled(tmp_path)
    one = store.path("traces", "bb" * 32).stat().st_size
    removed = prune([tmp_path], 2 * one)
    assert [e.kind for e in removed] == ["kernels", "traces"]
    assert [store.get("traces", k * 32) is not None for k in ("aa", "bb", "cc")] == [False, True, True]


def test_pruning_to_zero_removes_all_but_the_marker(tmp_path: Path) -> None:
    """Also temporary files of killed processes, and not what a link leads to."""
    store = _filled(tmp_path / "cache")
    (store.path("traces", "aa" * 32).parent / ".aa.17.0.tmp").write_bytes(b"half")
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.tex").write_bytes(b"theirs")
    (tmp_path / "cache" / "traces" / "ab").symlink_to(tmp_path / "theirs")
    (tmp_path / "cache" / "kernels" / "0.2.0-x86_64").symlink_to(tmp_path / "theirs")
    (tmp_path / "cache" / "notes.txt").write_text("mine")
    prune([tmp_path / "cache"], 0)
    assert entries([tmp_path / "cache"]) == []
    left = sorted(path.name for path in (tmp_path / "cache").rglob("*") if path.is_file())
    assert left == ["CACHEDIR.TAG", "dataset-recipe-cache", "notes.txt"]
    assert tree(tmp_path / "theirs") == {"thesis.tex": b"theirs"}


def _put(root: Path) -> None:
    Store(root).put("traces", "ab" * 32, b"")


def _leased(root: Path) -> None:
    with lease(root):
        pass


def _built(root: Path) -> None:
    build(dataset_plan(frames=2, weathers=1), root.parent / "out" / "tiny", BuildOptions(workers=0, engines=ENGINES))


USES: dict[str, Callable[[Path], object]] = {
    "create": create_cache_folder,
    "list": lambda root: entries([root]),
    "prune": lambda root: prune([root], 0),
    "put": _put,
    "lease": _leased,
    "kernels": lambda root: setup._cache_folder(),
    "build": _built,
}


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("path", ["data/ab/" + "ab" * 32, "traces/ab/" + "ab" * 32, "README"])
def test_a_folder_with_other_files_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, use: str
) -> None:
    """Regression: a backup's `data/ab/...` was removed when RECIPE_CACHE named its folder."""
    root = tmp_path / "backup"
    monkeypatch.setenv("RECIPE_CACHE", str(root))
    monkeypatch.delenv("RECIPE_KERNEL_CACHE", raising=False)
    (root / path).parent.mkdir(parents=True)
    (root / path).write_bytes(b"theirs")
    with pytest.raises(InputError, match=r"^RECIPE_CACHE /.*/backup: it holds .*; set RECIPE_CACHE to an empty folder"):
        USES[use](root)
    assert auto_prune([root], 0) == []
    assert tree(tmp_path) == {f"backup/{path}": b"theirs"}


def test_an_absent_or_empty_folder_is_an_empty_cache(tmp_path: Path) -> None:
    assert entries([tmp_path, tmp_path / "gone"]) == prune([tmp_path, tmp_path / "gone"], 0) == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("text", "count"), [("0", 0), ("500M", 500 << 20), ("1.5 GiB", 3 << 29), ("2kB", 2048)])
def test_sizes_may_have_units(text: str, count: int) -> None:
    assert bytes_of(text) == count


@pytest.mark.parametrize("text", ["", "much", "-1G", "1X", "1e9"])
def test_an_invalid_size_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="is not a size"):
        bytes_of(text)


def test_entries_that_a_running_build_has_read_are_not_pruned(tmp_path: Path) -> None:
    store = _filled(tmp_path)
    old = store.path("traces", "aa" * 32)
    with lease(tmp_path):
        assert store.get("traces", "cc" * 32) is not None
        removed = auto_prune([tmp_path], 0)
        assert old in [e.path for e in removed]
        assert store.get("traces", "cc" * 32) is not None
    assert auto_prune([tmp_path], None) == []
    auto_prune([tmp_path], 0)
    assert entries([tmp_path]) == []


@pytest.mark.slow
def test_a_lease_ends_with_its_process_and_the_first_of_several_applies(tmp_path: Path) -> None:
    store = _filled(tmp_path)
    hold = "import sys; from pathlib import Path; from recipe_runtime.cache.pruning import lease\n"
    hold += f"with lease(Path({str(tmp_path)!r})): print(flush=True); sys.stdin.read()"
    other = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert other.stdin is not None and other.stdout is not None
    other.stdout.readline()
    assert store.get("traces", "aa" * 32) is not None
    with lease(tmp_path):
        assert len(prune([tmp_path], 0)) == 3
    other.kill()
    other.wait()
    other.stdin.close()
    other.stdout.close()
    assert [entry.path.name for entry in prune([tmp_path], 0)] == ["aa" * 32]


def test_an_entry_read_during_pruning_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = _filled(tmp_path)
    stale = entries([tmp_path])
    with lease(tmp_path):
        monkeypatch.setattr(pruning, "entries", lambda roots: stale)
        assert store.get("traces", "aa" * 32) is not None  # after the listing
        auto_prune([tmp_path], 0)
        assert store.get("traces", "aa" * 32) is not None


@pytest.mark.slow
def test_after_a_build_the_cache_is_within_its_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = _filled(tmp_path / "cache")
    monkeypatch.setenv("RECIPE_CACHE_LIMIT", "0")
    result = build(
        dataset_plan(), tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES)
    )
    assert result.built
    assert entries([store.root]) == []
    monkeypatch.setenv("RECIPE_CACHE_LIMIT", "lots")
    with pytest.raises(InputError, match="RECIPE_CACHE_LIMIT: 'lots' is not a size"):
        build(dataset_plan(), tmp_path / "other", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
