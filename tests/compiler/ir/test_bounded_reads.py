"""Reading a document that a stranger wrote takes a bounded amount of memory."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path

import pytest
from recipe_compiler.ir import bounded_reads, lockfile
from recipe_compiler.ir.bounded_reads import bound_memory, bounded_memory
from recipe_compiler.ir.errors import InputError
from recipe_runtime.dataset import manifest_reader, reader
from recipe_runtime.transfer import export_folder

from tests.runtime import fakes

SIZE = 1 << 28  # more than Python has left over in its own pools


@pytest.fixture(autouse=True)
def bound() -> Iterator[None]:
    bound_memory(SIZE)
    yield
    bound_memory(None)


def too_much(*_: object) -> bytes:
    return bytes(range(256)) * (SIZE // 128)


def test_a_block_that_takes_too_much_is_ended() -> None:
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    with bounded_memory("x"):
        assert len(bytes(range(256)) * (SIZE // 512)) == SIZE // 2
    message = "x takes too much memory to read: over 268,435,456 bytes"
    with pytest.raises(InputError, match=message), bounded_memory("x"):
        too_much()
    assert resource.getrlimit(resource.RLIMIT_DATA) == limits
    assert len(too_much()) == 2 * SIZE


def test_a_library_is_not_bounded() -> None:
    """A program that reads datasets in one of its threads needs its memory in the others."""
    bound_memory(None)
    with bounded_memory("x"):
        assert len(too_much()) == 2 * SIZE


def test_the_bound_of_the_outer_block_stays() -> None:
    with pytest.raises(InputError, match="outer"), bounded_memory("outer"):
        half = bytes(range(256)) * (SIZE // 512)
        with bounded_memory("inner"):
            assert len(bytes(range(256)) * (SIZE // 256 * 3 // 4)) + len(half) > SIZE


def test_a_failure_within_the_limits_of_the_host_is_no_fault_of_the_document(monkeypatch: pytest.MonkeyPatch) -> None:
    used = bounded_reads._data_bytes()
    assert used is not None
    monkeypatch.setattr(resource, "getrlimit", lambda _: (used + SIZE // 2, resource.RLIM_INFINITY))
    with pytest.raises(MemoryError), bounded_memory("x"):
        raise MemoryError


def test_a_host_that_does_not_report_its_memory_has_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound would apply to all memory of the process, and refuse valid documents."""
    monkeypatch.setattr(bounded_reads, "_data_bytes", lambda: None)
    with bounded_memory("x"):
        assert len(too_much()) == 2 * SIZE


def test_every_reader_of_documents_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "manifest.json").write_text("{}")
    (tmp_path / "index.json").write_text("{}")
    (tmp_path / "tiny.lock").write_text("recipe/lock/1\n")
    monkeypatch.setattr(lockfile, "_parse", too_much)
    with pytest.raises(InputError, match=r"tiny\.lock takes too much memory"):
        lockfile.read(tmp_path / "tiny.lock")
    monkeypatch.setattr(manifest_reader, "parse", too_much)
    with pytest.raises(InputError, match=r"manifest\.json takes too much memory"):
        manifest_reader.read(tmp_path)
    monkeypatch.setattr(reader, "_read", too_much)
    with pytest.raises(InputError, match="takes too much memory"):
        reader.read(tmp_path)
    monkeypatch.setattr(export_folder, "_read_rows", too_much)
    dataset = reader.Dataset(tmp_path, fakes.dataset_plan(frames=2), None, {}, "tiny", None, {})  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"index\.json takes too much memory"):
        export_folder.read_index(tmp_path, "index.json", dataset, 100)
