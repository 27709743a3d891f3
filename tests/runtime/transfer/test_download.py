"""A dataset read from a URL has the bytes of the original; an untrusted one costs only bounded resources."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import fsspec
import pytest
import recipe_runtime
from fsspec.spec import AbstractFileSystem
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.dataset import manifest_reader
from recipe_runtime.dataset.reader import read
from recipe_runtime.transfer import download, stores
from recipe_runtime.transfer.download import fetched
from recipe_runtime.transfer.upload import Target
from recipe_runtime.verify.verdict import Report
from recipe_runtime.verify.verify import Options, verify, verify_files

from tests.runtime.fakes import ENGINES, quiet, tree

URL = "memory://fetched/small"


@pytest.fixture
def store(built: Path) -> Iterator[dict[str, Any]]:
    """Return the files of the in-memory store that the dataset was copied to, by path."""
    Target(URL, built).put(quiet)
    memory = fsspec.filesystem("memory")
    yield memory.store
    memory.store.clear()
    memory.pseudo_dirs[:] = [""]


def integrity(url: str) -> Report:
    with fetched(url, quiet) as folder:
        return verify_files(read(folder, url), Options(nonce=1), quiet)


def corrupt(path: str, body: bytes) -> None:
    fsspec.filesystem("memory").pipe_file(f"/fetched/small/{path}", body)


def test_downloaded_files_equal_the_uploaded_ones(store: dict[str, Any], built: Path) -> None:
    with fetched(URL, quiet) as folder:
        assert tree(folder) == tree(built)
        made = read(folder, URL)
        assert (
            verify(made.plan, made.lock, Options(1, workers=0), quiet, dataset=made, engines=ENGINES).verdict == "PASS"
        )
    assert not folder.exists()


def test_a_file_url_is_read_in_place(built: Path) -> None:
    with fetched(f"file://{built}", quiet) as folder:
        assert folder == built
    assert built.is_dir()
    assert integrity(f"file://{built}").verdict == integrity(f"FILE://{built}").verdict == "PASS"


@pytest.mark.parametrize(
    ("path", "body", "said"),
    [
        ("README.md", b"?", "README.md has 1 byte"),
        ("weather=w0,jitter=still/tracks.csv", None, "tracks.csv is missing"),
        ("weather=w0,jitter=still/more.txt", b"more", "more.txt is not in the manifest"),
        ("more/or/less.txt", b"more", "more/ is a folder without a file of this plan"),
    ],
)
def test_different_files_at_the_url_are_reported(
    store: dict[str, Any], path: str, body: bytes | None, said: str
) -> None:
    if body is None:
        store.pop(f"/fetched/small/{path}")
    else:
        corrupt(path, body)
    report = integrity(URL)
    assert report.verdict == "FAIL"
    assert any(said in str(d) for d in report.differences), [str(d) for d in report.differences]


def test_a_flipped_bit_at_the_url_is_reported(store: dict[str, Any], built: Path) -> None:
    path = "weather=w0,jitter=still/street/rgb/000002.png"
    body = (built / path).read_bytes()
    corrupt(path, body[:-9] + bytes([body[-9] ^ 1]) + body[-8:])
    (only,) = integrity(URL).differences
    assert f"{path} differs from its SHA-256 in the manifest" in str(only)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("a/../../out.txt", r"is not a path within a dataset"),
        ("/etc/out.txt", r"is not a path within a dataset"),
        ("x" * 300, r"is not a path within a dataset"),
        ("README.md/x", r"README\.md is listed as a file, and README\.md/x is in it"),
    ],
)
def test_a_manifest_with_paths_that_a_dataset_cannot_have_is_refused(
    store: dict[str, Any], path: str, said: str
) -> None:
    manifest = json.loads(store["/fetched/small/manifest.json"].getvalue())
    manifest["files"][path] = {"size": 3, "sha256": "0" * 64}
    corrupt("manifest.json", json.dumps(manifest).encode())
    with pytest.raises(InputError, match=rf"manifest\.json is damaged .*{said}"):
        integrity(URL)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("memory://bucket/nothing", "is not a dataset: it holds no manifest.json"),
        ("memory://", "has no path"),
        ("nowhere://x/y", "nowhere:// is not a supported scheme; use one of s3://"),
        ("zip::https://example.org/dataset.zip", "chains several schemes with `::`"),
        ("HTTPS://example.org/dataset", "a web server neither lists nor accepts files"),
    ],
)
def test_urls_without_a_dataset_are_refused(url: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        integrity(url)


@pytest.mark.parametrize(
    "url",
    [
        "nowhere://user:se:cr@et@host/x",
        "https://user:se:cr@et@host/x",
        "simplecache::HTTPS://user:se:cr@et@host/x",
        "memory://user:se:cr@et@host/x",
        "sftp://user:se:cr@et@127.0.0.1:1/x",
    ],
)
def test_a_password_is_not_shown(url: str) -> None:
    with pytest.raises((InputError, RunError)) as caught:
        integrity(url)
    assert "://user:***@" in str(caught.value)
    assert not {"se", "cr", "et"} & set(re.split(r"[^a-z]+", str(caught.value)))


def test_a_manifest_of_another_format_is_refused(store: dict[str, Any]) -> None:
    for body in (b"{}", b"[" * 100_000, b"\xff", b'{"format": "recipe/manifest/1"}'):
        corrupt("manifest.json", body)
        with pytest.raises(InputError, match=URL):
            integrity(URL)


def test_a_dataset_larger_than_the_free_space_is_not_downloaded(
    store: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(download.shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10, 9, 1))  # type: ignore[attr-defined]
    with pytest.raises(RunError, match=r"its files take .* MiB, and .* has 0\.0 MiB left; set TMPDIR"):
        integrity(URL)


class Endless(io.RawIOBase):
    """An endless file that counts the bytes read from it."""

    read_so_far = 0

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        assert 0 < size <= 1 << 20, "all at once"
        Endless.read_so_far += size
        return bytes(size)


class Hostile(AbstractFileSystem):  # type: ignore[misc]  # fsspec has no types
    """A store whose content differs from its listing, and whose names lead out of the folder."""

    protocol = "hostile"
    cachable = False
    manifest: bytes | None = b""
    rows: tuple[dict[str, Any], ...] = ()

    def _open(self, path: str, mode: str = "rb", **_: Any) -> Any:
        return io.BytesIO(self.manifest) if path.endswith("manifest.json") and self.manifest is not None else Endless()

    def ls(self, path: str, detail: bool = True, **_: Any) -> list[dict[str, Any]]:
        return [row for row in self.rows if cast(str, row["name"]).rpartition("/")[0] == path] if detail else []


@pytest.fixture
def hostile(monkeypatch: pytest.MonkeyPatch) -> type[Hostile]:
    fsspec.register_implementation("hostile", Hostile, clobber=True)
    monkeypatch.setitem(stores.SCHEMES, "hostile", stores.Scheme())
    monkeypatch.setattr(Endless, "read_so_far", 0)
    return Hostile


def test_an_endless_file_is_read_up_to_the_size_in_the_manifest(
    hostile: type[Hostile], built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hostile, "manifest", (built / "manifest.json").read_bytes())
    sizes = {path: len(body) for path, body in tree(built).items()}
    rows = [{"name": f"x/y/{path}", "size": size, "type": "file"} for path, size in sizes.items()]
    folders = {str(p.relative_to(built)) for p in built.rglob("*") if p.is_dir()}
    rows += [{"name": f"x/y/{path}", "size": 0, "type": "directory"} for path in folders]
    monkeypatch.setattr(hostile, "rows", tuple(rows))
    with fetched("hostile://x/y", quiet) as folder:
        assert Endless.read_so_far <= sum(sizes.values()) + len(sizes)
        with pytest.raises(InputError, match="hostile://x/y: its manifest or a plan is damaged"):
            read(folder, "hostile://x/y")


def test_an_endless_manifest_is_refused(hostile: type[Hostile], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostile, "manifest", None)
    for module in (download, manifest_reader):
        monkeypatch.setattr(module, "MAX_BYTES", 5_000_000)
    with pytest.raises(InputError, match=r"has 5,000,001 bytes, and at most 5,000,000 are read"):
        integrity("hostile://x/y")
    assert Endless.read_so_far == 5_000_001


@pytest.mark.parametrize("name", ["elsewhere/z", "x/y/../../z", "x/y/..", "x/y/\x1b[2J", "x/yz", "x/y/z/"])
def test_a_listing_with_names_outside_the_folder_is_refused(
    hostile: type[Hostile], built: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(hostile, "manifest", (built / "manifest.json").read_bytes())
    monkeypatch.setattr(hostile, "find", lambda *_, **__: {name: {"size": 1}})
    with pytest.raises(InputError, match="which is not a path in a dataset; remove it") as caught:
        integrity("hostile://x/y")
    assert "\x1b" not in str(caught.value)


def test_files_where_a_folder_would_have_to_be_are_reported(
    hostile: type[Hostile], built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An object store may have both `a` and `a/b`."""
    monkeypatch.setattr(hostile, "manifest", (built / "manifest.json").read_bytes())
    card = len((built / "README.md").read_bytes())
    for names in (("more", "more/x"), ("README.md", "README.md/x")):
        monkeypatch.setattr(hostile, "find", lambda *_, names=names, **__: {f"x/y/{n}": {"size": card} for n in names})
        with pytest.raises(InputError, match=f"holds {names[1]} twice: as a file and as a folder"):
            integrity("hostile://x/y")


def test_files_with_another_size_than_in_the_manifest_are_not_downloaded(
    hostile: type[Hostile], built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hostile, "manifest", (built / "manifest.json").read_bytes())
    monkeypatch.setattr(hostile, "rows", ({"name": "x/y/README.md", "size": 1 << 40, "type": "file"},))
    with fetched("hostile://x/y", quiet) as folder:
        found = (folder / "README.md").stat()
        assert (found.st_size, found.st_blocks, Endless.read_so_far) == (1 << 40, 0, 0)


def test_python_opens_recipes_from_local_files_only() -> None:
    with pytest.raises(InputError, match=r"s3://b/x\.yaml: a recipe is opened from a file of this host; copy it here"):
        recipe_runtime.open("s3://b/x.yaml")
