"""A cache folder is marked; only the project's own files in it are removed; one with other files is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.errors import InputError
from recipe_runtime.build.pipeline import build
from recipe_runtime.cache import cache_folder, pruning
from recipe_runtime.cache.cache_folder import contents, create_cache_folder, is_cache_folder, is_marked
from recipe_runtime.cache.leases import lease, oldest_lease_in
from recipe_runtime.cache.pruning import auto_prune, entries, prune
from recipe_runtime.cache.store import Store
from recipe_runtime.core.files import write_atomic
from recipe_runtime.render.device import setup

from tests.runtime.fakes import ENGINES, dataset_plan, tree

KEY = "ab" * 32
KERNELS = "kernels/0.1.0-x86_64/1.19.0"
MODULE = "wp_recipe_runtime.render.shade_0123abc"

OURS = {
    f"traces/ab/{KEY}": b"recipe/store/1 traces",
    f"built/ab/{KEY}": b"recipe/store/2 built",
    f"pixels/ab/.{KEY}.17.0.tmp": b"recipe/sto",
    f"{KERNELS}/{MODULE}/{MODULE}.cpu27609690.o": b"x",
    f"{KERNELS}/{MODULE}/{MODULE}.meta": b"{}",
    f"{KERNELS}/{MODULE}/{MODULE}.sha256": b"x",
    f"{KERNELS}/{MODULE}_p17_t18/{MODULE}.cpp": b"x",
    f"{KERNELS}/wp_a_0000000/wp_a_0000000.sm90.cubin": b"x",
}
THEIRS = [
    f"data/ab/{KEY}",  # of a backup
    f"traces/cd/{KEY}",
    f"traces/ab/{KEY}.bak",
    f"traces/ab/{KEY[:-1]}",
    f"traces/{KEY}",
    "traces/ab/notes.tmp",
    f"traces/AB/{KEY}",
    "kernels/a/b/c/d.o",
    f"kernels/linux-6.1-x86_64/1.19.0/{MODULE}/{MODULE}.o",
    f"kernels/0.1.0-x86_64/mine/{MODULE}/{MODULE}.o",
    f"{KERNELS}/wp_mine/wp_mine.o",
    f"{KERNELS}/{MODULE[:-1]}d/thesis.tex",
    "in-use/17",
    "photos/1.jpg",
    "README",
]


def _write(root: Path, files: dict[str, bytes]) -> None:
    for path, body in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_bytes(body)


def test_a_new_cache_is_tagged_and_marked(tmp_path: Path) -> None:
    """Backup programs recognise CACHEDIR.TAG by its first 43 bytes."""
    Store(tmp_path / "new" / "cache").put("traces", KEY, b"")
    root = tmp_path / "new" / "cache"
    assert (root / "CACHEDIR.TAG").read_bytes()[:43] == b"Signature: 8a477f597d28d172789f06886806bc55"
    assert (root / "dataset-recipe-cache").read_bytes().startswith(b"recipe/cache/1\n")
    assert is_marked(root)


def test_absent_and_empty_folders_are_not_a_cache(tmp_path: Path) -> None:
    assert not is_cache_folder(tmp_path) and not is_cache_folder(tmp_path / "gone")
    assert prune([tmp_path, tmp_path / "gone"], 0) == []
    assert list(tmp_path.iterdir()) == []


def test_a_cache_of_an_earlier_version_is_adopted(tmp_path: Path) -> None:
    _write(tmp_path, {**OURS, "in-use/17.0": b""})
    create_cache_folder(tmp_path)
    assert is_marked(tmp_path)
    assert len(prune([tmp_path], 0)) == 6
    assert sorted(tree(tmp_path)) == ["CACHEDIR.TAG", "dataset-recipe-cache", "in-use/17.0"]


@pytest.mark.parametrize("mark", ["CACHEDIR.TAG", "dataset-recipe-cache"])
@pytest.mark.parametrize("size", [0, 7])
@pytest.mark.parametrize("zeros", [0, 100])
def test_a_truncated_marker_is_written_again(tmp_path: Path, mark: str, size: int, zeros: int) -> None:
    """File systems shorten files at a power failure, or keep their size and fill them with zeros."""
    create_cache_folder(tmp_path)
    whole = (tmp_path / mark).read_bytes()
    (tmp_path / "dataset-recipe-cache").unlink(missing_ok=mark != "CACHEDIR.TAG")
    (tmp_path / mark).write_bytes(whole[:size] + bytes(zeros))
    create_cache_folder(tmp_path)
    assert (tmp_path / mark).read_bytes() == whole
    assert is_marked(tmp_path)


def _put(root: Path) -> None:
    Store(root).put("traces", KEY, b"")


def _leased(root: Path) -> None:
    with lease(root):
        pass


def _kernels(root: Path) -> None:
    setup._cache_folder()


def _built(root: Path) -> None:
    build(dataset_plan(frames=2, weathers=1), root.parent / "out" / "tiny", workers=0, engines=ENGINES)


USES: list[Callable[[Path], object]] = [
    create_cache_folder,
    contents,
    oldest_lease_in,
    lambda root: entries([root]),
    lambda root: prune([root], 0),
    _put,
    _leased,
    _kernels,
    _built,
]


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("path", THEIRS)
def test_a_folder_with_other_files_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, use: Callable[[Path], object]
) -> None:
    """Regression: a backup's `data/ab/...` was removed when RECIPE_CACHE named its folder."""
    root = tmp_path / "backup"
    monkeypatch.setenv("RECIPE_CACHE", str(root))
    monkeypatch.delenv("RECIPE_KERNEL_CACHE", raising=False)
    _write(root, {**OURS, path: b"theirs"})
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"^RECIPE_CACHE /.*/backup: it holds .*; set RECIPE_CACHE to an empty folder"):
        use(root)
    assert auto_prune([root], 0) == []
    assert tree(tmp_path) == before
    assert not (tmp_path / "out").exists()


def test_an_entry_with_an_unknown_header_is_not_adopted(tmp_path: Path) -> None:
    _write(tmp_path, {f"traces/ab/{KEY}": b"\x7fELF"})
    with pytest.raises(InputError, match=f"it holds traces/ab/{KEY}"):
        create_cache_folder(tmp_path)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ours=st.sets(st.sampled_from(sorted(OURS))), theirs=st.sets(st.sampled_from(THEIRS)))
def test_exactly_the_projects_own_files_of_a_marked_cache_are_removed(
    tmp_path_factory: pytest.TempPathFactory, ours: set[str], theirs: set[str]
) -> None:
    root = tmp_path_factory.mktemp("cache")
    create_cache_folder(root)
    _write(root, {path: OURS[path] for path in ours} | dict.fromkeys(theirs, b"theirs"))
    prune([root], 0)
    oldest_lease_in(root)
    assert set(tree(root)) == {*theirs, "CACHEDIR.TAG", "dataset-recipe-cache"}


def test_a_kernel_folder_with_other_files_is_not_removed(tmp_path: Path) -> None:
    create_cache_folder(tmp_path)
    _write(tmp_path, {f"{KERNELS}/{MODULE}/{MODULE}.o": b"", f"{KERNELS}/{MODULE}/notes/thesis.tex": b""})
    before = tree(tmp_path)
    assert prune([tmp_path], 0) == []
    assert tree(tmp_path) == before


@pytest.mark.parametrize("level", range(1, 4))
@pytest.mark.parametrize("path", [f"traces/ab/{KEY}", f"{KERNELS}/{MODULE}/{MODULE}.o", "in-use/17.0"])
def test_no_link_below_the_cache_is_followed(tmp_path: Path, path: str, level: int) -> None:
    """Links at any depth: in place of a kind's folder, of a folder within it, or of a file."""
    parts = path.split("/")
    level = min(level, len(parts))
    root, outside = tmp_path / "cache", tmp_path / "outside"
    create_cache_folder(root)
    _write(outside, {"/".join(parts[level:]) or "file": b"theirs"})
    (root / "/".join(parts[:level])).parent.mkdir(parents=True, exist_ok=True)
    (root / "/".join(parts[:level])).symlink_to(outside if level < len(parts) else outside / "file")
    before = tree(outside)
    assert prune([root], 0) == []
    oldest_lease_in(root)
    assert tree(outside) == before


@pytest.mark.parametrize("path", [f"traces/ab/{KEY}", f"{KERNELS}/{MODULE}/{MODULE}.o"])
def test_a_link_that_replaces_a_folder_during_pruning_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str
) -> None:
    """Another user of a shared cache could place a link between the listing and the removal."""
    root, outside = tmp_path / "cache", tmp_path / "outside"
    create_cache_folder(root)
    _write(root, {path: OURS.get(path, b"")})
    _write(outside, {Path(path).name: b"theirs"})
    listed = entries([root])
    folder = (root / path).parent
    folder.rename(tmp_path / "aside")
    folder.symlink_to(outside)
    monkeypatch.setattr(pruning, "entries", lambda roots: listed)
    prune([root], 0)
    assert tree(outside) == {Path(path).name: b"theirs"}


def test_the_cache_folder_itself_may_be_a_link(tmp_path: Path) -> None:
    """The user may link it, for example, to a larger disk."""
    (tmp_path / "disk").mkdir()
    (tmp_path / "cache").symlink_to(tmp_path / "disk")
    Store(tmp_path / "cache").put("traces", KEY, b"")
    assert [entry.kind for entry in prune([tmp_path / "cache"], 0)] == ["traces"]


def test_two_processes_can_mark_a_folder_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A marker that the other process has written in part does not make the folder refused."""

    def slower(path: Path, body: bytes) -> None:
        half = path.with_name(f".{path.name}.17.0.tmp")
        half.write_bytes(body[:5])
        assert is_cache_folder(tmp_path)
        half.unlink()
        write_atomic(path, body)

    monkeypatch.setattr(cache_folder, "write_atomic", slower)
    create_cache_folder(tmp_path)
    assert is_marked(tmp_path)
