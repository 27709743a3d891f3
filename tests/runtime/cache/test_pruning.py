"""The cache can be listed and pruned; foreign files are never changed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import build
from recipe_runtime.cache import pruning
from recipe_runtime.cache.cache_folder import create_cache_folder
from recipe_runtime.cache.leases import lease, oldest_lease_in
from recipe_runtime.cache.pruning import auto_prune, bytes_of, entries, prune, sizes
from recipe_runtime.cache.store import Store

from tests.runtime.fakes import ENGINES, dataset_plan


def _filled(root: Path) -> Store:
    """Create three traces (the second used last), a kernel and a foreign file."""
    store = Store(root)
    for number, key in enumerate(("aa" * 32, "bb" * 32, "cc" * 32)):
        store.put("traces", key, b"x" * 1000)
        os.utime(store.path("traces", key), (100.0 + number, 100.0 + number))
    assert store.get("traces", "bb" * 32) is not None
    module = root / "kernels" / "0.1.0-x86_64" / "1.19.0" / "wp_render.shade_0123abc"
    module.mkdir(parents=True)
    kernel = module / "wp_render.shade_0123abc.cpu27609690.o"
    kernel.write_bytes(b"k" * 500)
    for path in (kernel, module, module.parent.parent):
        os.utime(path, (50.0, 50.0))
    (root / "notes.txt").write_text("mine")
    (root / "traces" / "README").write_text("mine")
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


def test_pruning_to_zero_keeps_foreign_files(tmp_path: Path) -> None:
    _filled(tmp_path)
    prune([tmp_path], 0)
    assert entries([tmp_path]) == []
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == [
        "CACHEDIR.TAG",
        "README",
        "dataset-recipe-cache",
        "notes.txt",
    ]


def test_a_link_out_of_the_cache_is_not_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside" / "aa"
    outside.mkdir(parents=True)
    (outside / ("a" * 64)).write_text("mine")
    create_cache_folder(tmp_path / "cache")
    (tmp_path / "cache" / "traces").symlink_to(tmp_path / "outside")
    assert prune([tmp_path / "cache"], 0) == []
    assert (outside / ("a" * 64)).read_text() == "mine"


def test_an_absent_cache_is_empty(tmp_path: Path) -> None:
    assert entries([tmp_path / "gone"]) == []


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
def test_a_lease_ends_with_its_process_and_the_oldest_applies(tmp_path: Path) -> None:
    hold = "import sys; from pathlib import Path; from recipe_runtime.cache.leases import lease\n"
    hold += f"with lease(Path({str(tmp_path)!r})): print(flush=True); sys.stdin.read()"
    other = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert other.stdin is not None and other.stdout is not None
    other.stdout.readline()
    (file,) = (tmp_path / "in-use").iterdir()
    os.utime(file, (1000.0, 1000.0))
    with lease(tmp_path):
        assert oldest_lease_in(tmp_path) == 1000.0
    other.kill()
    other.wait()
    other.stdin.close()
    other.stdout.close()
    assert oldest_lease_in(tmp_path) == float("inf")
    assert list((tmp_path / "in-use").iterdir()) == []


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
    result = build(dataset_plan(), tmp_path / "tiny", workers=0, cache=tmp_path / "cache", engines=ENGINES)
    assert result.built
    assert entries([store.root]) == []
    monkeypatch.setenv("RECIPE_CACHE_LIMIT", "lots")
    with pytest.raises(InputError, match="RECIPE_CACHE_LIMIT: 'lots' is not a size"):
        build(dataset_plan(), tmp_path / "other", workers=0, cache=tmp_path / "cache", engines=ENGINES)
