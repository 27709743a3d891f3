"""A pack round-trips, has one canonical byte form, and a hostile one is refused before anything is written."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from recipe_compiler.ir.canonical import canonical_bytes
from recipe_compiler.ir.errors import InputError, Place, Problem
from recipe_runtime.transfer.bundle import MAX_FILES, Pack, identity, read, unpacked

FILES = {"street.yaml": b"recipe: street\n", "common/base.yaml": b"town: downtown\n", "lockfiles/street.lock": b"x\n"}
PACK = Pack("street.yaml", FILES)


def _written(folder: Path, body: bytes) -> Path:
    path = folder / "street.recipe"
    path.write_bytes(body)
    return path


def test_a_pack_round_trips(tmp_path: Path) -> None:
    found = read(_written(tmp_path, PACK.dumps()))
    assert (found.recipe, dict(found.files)) == ("street.yaml", FILES)


def test_the_byte_form_is_pinned() -> None:
    """Identities printed in papers must never change: another byte form requires a new format version."""
    assert identity(PACK.dumps()) == "sha256:008f3497e21f09d32a3345723991878cc534ea61ae021830c0831357e4cd203a"


def test_any_unzip_reads_it() -> None:
    with zipfile.ZipFile(io.BytesIO(PACK.dumps())) as archive:
        assert archive.testzip() is None
        assert {n: archive.read(n) for n in archive.namelist() if n != "pack.json"} == FILES


def test_a_pack_is_unpacked_and_removed(tmp_path: Path) -> None:
    with unpacked(_written(tmp_path, PACK.dumps())) as recipe:
        root = recipe.parent
        assert recipe.read_bytes() == FILES["street.yaml"]
        assert (root / "common" / "base.yaml").read_bytes() == FILES["common/base.yaml"]
    assert not root.exists()


def test_problems_of_the_recipe_name_the_file_in_the_pack(tmp_path: Path) -> None:
    path = _written(tmp_path, PACK.dumps())
    with pytest.raises(InputError) as caught, unpacked(path) as recipe:
        raise InputError(Problem("the town is gone", Place(str(recipe), 3, 5)))
    assert str(caught.value) == f"{path}/street.yaml:3:5: the town is gone"
    with pytest.raises(InputError) as caught, unpacked(path) as recipe:
        raise InputError(f"{os.path.relpath(recipe.parent)}/lockfiles/street.lock: there is no lockfile")
    assert str(caught.value) == f"{path}/lockfiles/street.lock: there is no lockfile"


def _zip(entries: list[tuple[zipfile.ZipInfo | str, bytes]], kind: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", kind) as archive:
        for entry, body in entries:
            archive.writestr(entry, body)
    return out.getvalue()


def _indexed(paths: Iterable[str] = (), recipe: str = "street.yaml") -> tuple[str, bytes]:
    """Return an index of a recipe and other files."""
    files = dict.fromkeys(sorted(["street.yaml", *paths]), "0" * 64)
    return "pack.json", canonical_bytes({"format": "recipe/pack/1", "recipe": recipe, "files": files})


def _pack(*entries: tuple[zipfile.ZipInfo | str, bytes], kind: int = zipfile.ZIP_STORED) -> bytes:
    """Return a pack of entries with an index that lists them."""
    names = [entry if isinstance(entry, str) else entry.filename for entry, _ in entries]
    return _zip([_indexed(names), *entries, ("street.yaml", b"a")], kind)


def _link() -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo("common")
    entry.create_system, entry.external_attr = 3, 0o120777 << 16
    return entry


HOSTILE: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "no zip": lambda: b"recipe: street\n" * 100,
    "no index": lambda: _zip([("street.yaml", b"a")]),
    "an index that is not a map": lambda: _zip([("pack.json", b"[]"), ("street.yaml", b"a")]),
    "a deep index": lambda: _zip([("pack.json", b"[" * 100_000)]),
    "another format": lambda: _zip([("pack.json", b'{"format": "recipe/pack/9"}')]),
    "a recipe that is missing": lambda: _zip([_indexed(recipe="gone.yaml"), ("street.yaml", b"a")]),
    "a way up": lambda: _pack(("common/../../evil.yaml", b"evil")),
    "an absolute path": lambda: _pack(("/etc/evil", b"evil")),
    "a hidden file": lambda: _pack((".bashrc", b"evil")),
    "a name with control characters": lambda: _pack(("a\x1b[2J", b"evil")),
    "a file that is a folder": lambda: _pack(("a", b""), ("a/b", b"")),
    "a repeated name": lambda: _pack(("a.yaml", b"a"), ("a.yaml", b"b")),
    "a link": lambda: _pack((_link(), b"/etc")),
    "data after the content of an entry": lambda: PACK.dumps().replace(b"recipe: street\n", b"recipe: street\n\n"),
    "a bomb": lambda: _pack(("a.bin", b"\0" * (1 << 22)), kind=zipfile.ZIP_DEFLATED),
    "bytes before it": lambda: b"#!/bin/sh\n" + PACK.dumps(),
    "bytes after it": lambda: PACK.dumps() + b"\n",
    "a date": lambda: PACK.dumps().replace(b"\x00\x00\x21\x00", b"\x01\x00\x21\x00"),
    "another digest": lambda: PACK.dumps().replace(b"recipe: street", b"recipe: strett"),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_pack_is_refused(tmp_path: Path, name: str) -> None:
    path = _written(tmp_path, HOSTILE[name]())
    with pytest.raises(InputError, match=r"is not a valid pack: .+") as caught:
        read(path)
    assert len(str(caught.value).splitlines()) == 1
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "files",
    [
        {"a": b"", "a/b": b""},
        {"a.yaml": b"", "pack.json": b""},
        {"a.yaml": b"", "lockfiles": b""},
        {"a.yaml": b"", "x" * 201: b""},
        {"a.yaml": b"", "ümlaut": b""},
    ],
)
def test_names_that_a_pack_cannot_have_are_refused(files: dict[str, bytes]) -> None:
    with pytest.raises(InputError, match="pack"):
        Pack(next(iter(files)), files).dumps()


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, len(PACK.dumps()) - 1), value=st.integers(0, 255), cut=st.booleans())
@example(at=29, value=2, cut=False)  # an entry that states more bytes than it has
def test_any_changed_byte_is_detected(tmp_path: Path, at: int, value: int, cut: bool) -> None:
    body = bytearray(PACK.dumps())
    same = body[at] == value and not cut
    body[at] = value
    path = _written(tmp_path, bytes(body[:at] if cut else body))
    if same:
        assert dict(read(path).files) == FILES
    else:
        with pytest.raises(InputError):
            read(path)


@pytest.mark.parametrize(
    ("paths", "reason"),
    [
        ((f"{n}/{'a/' * 95}b" for n in range(30_000)), "at most 2,000 folders"),
        ((f"{n}.png" for n in range(MAX_FILES)), "at most 65,534 files"),
    ],
    ids=["folders", "files"],
)
def test_the_size_of_an_index_is_bounded(tmp_path: Path, paths: Iterable[str], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        read(_written(tmp_path, _zip([_indexed(paths)])))


def test_a_header_with_a_large_size_reserves_no_memory(tmp_path: Path) -> None:
    body = bytearray(PACK.dumps())
    body[18:26] = b"\xff\xff\xff\x7f" * 2  # the sizes of pack.json
    with pytest.raises(InputError, match=r"and at most [0-9]+ are read"):
        read(_written(tmp_path, bytes(body)))


def test_a_lockfile_is_no_recipe_of_a_pack(tmp_path: Path) -> None:
    """Regression: `recipe verify` verified that lockfile, and files that no recipe uses were not refused."""
    files = {"lockfiles/a.lock": b"recipe-lock 1\n", "evil.yaml": b"x: 1\n"}
    path = _written(tmp_path, Pack("lockfiles/a.lock", files).dumps())
    with pytest.raises(InputError, match="is a lockfile; pack"), unpacked(path):
        pass
