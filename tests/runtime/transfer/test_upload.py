"""Datasets uploaded by fsspec: complete or absent, equal to the folder, and only new files are sent."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import fsspec
import pytest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import read
from recipe_runtime.transfer.upload import MARKER, Copied, Target
from recipe_runtime.verify.verify import Options, verify_files

from tests.runtime.fakes import dataset_plan, quiet, tree
from tests.runtime.transfer.conftest import made
from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"


@pytest.fixture(params=["memory", "file"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    yield "memory://bucket/small" if request.param == "memory" else f"file://{tmp_path}/remote/small"
    fsspec.filesystem("memory").store.clear()


def put(url: str, root: Path) -> Copied:
    return Target(url, root).put(quiet)


def remote_files(url: str) -> dict[str, bytes]:
    fs, prefix = fsspec.core.url_to_fs(url)
    return {name[len(prefix) + 1 :]: fs.cat_file(name) for name in fs.find(prefix)}


@pytest.mark.slow
def test_all_files_are_uploaded_once(url: str, built: Path) -> None:
    first = put(url, built)
    assert remote_files(url) == tree(built)
    contents = {body for path, body in tree(built).items() if path != "manifest.json"}
    assert first == Copied(len(contents), len(tree(built)) - 1 - len(contents), 0)
    assert first.copied > 0  # labels shared by variants
    assert put(url, built) == Copied(0, 0, len(tree(built)) - 1)


@pytest.mark.slow
def test_only_new_files_are_sent_and_obsolete_ones_removed(url: str, built: Path, tmp_path: Path) -> None:
    put(url, built)
    before = remote_files(url)
    plan = dataset_plan()
    less = plan.model_copy(update={"variants": plan.variants[:1]})
    other = made(less, tmp_path / "less" / "small").root
    sent = put(url, other)
    assert remote_files(url) == tree(other)
    unchanged = {path for path, body in tree(other).items() if before.get(path) == body}
    assert sent.kept == len(unchanged) and sent.sent < len(tree(other)) / 2
    if url.startswith("file"):  # `verify` reports folders without a file
        assert all(any(folder.iterdir()) for folder in Path(url[7:]).rglob("*") if folder.is_dir())
        assert [path.name for path in Path(url[7:]).parent.iterdir()] == ["small"]


@pytest.mark.parametrize("place", ["{root}", "{link}", "{root}/copy", "{above}"])
def test_a_dataset_is_not_copied_to_its_own_folder(built: Path, tmp_path: Path, place: str) -> None:
    """Files at the place are removed before they are sent: there, that would remove the dataset."""
    root = Path(shutil.copytree(built, tmp_path / "all" / "small"))
    (tmp_path / "link").symlink_to(root)
    before = tree(tmp_path)
    url = f"file://{place.format(root=root, above=root.parent, link=tmp_path / 'link')}"
    with pytest.raises(InputError, match="is not apart from"):
        Target(url, root)
    assert tree(tmp_path) == before


def test_a_local_place_that_cannot_be_written_is_an_error_before_the_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(**_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", refused)
    with pytest.raises(RunError, match="Permission denied"):
        Target(f"file://{tmp_path}/copy", tmp_path / "built")


def changed(built: Path, root: Path) -> Path:
    """Return a copy of a dataset in which a file has other bytes of equal size, one is new, and one is gone."""
    shutil.copytree(built, root)
    card, manifest = root / layout.CARD, json.loads((root / layout.MANIFEST).read_text())
    card.write_bytes(card.read_bytes().swapcase())
    (root / "new.txt").write_text("new")
    gone = next(path for path in manifest["files"] if path.endswith("tracks.csv"))
    (root / gone).unlink()
    del manifest["files"][gone]
    for path in (layout.CARD, "new.txt"):
        body = (root / path).read_bytes()
        manifest["files"][path] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
    (root / layout.MANIFEST).write_text(json.dumps(manifest))
    return root


@pytest.mark.slow
@pytest.mark.parametrize("first", ["whole", "changed"])
def test_an_upload_may_be_killed_at_every_change_of_a_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    """There is no manifest but of a complete dataset, and the next upload, of either dataset, is complete."""
    url, memory = "memory://bucket/small", type(fsspec.filesystem("memory"))
    whole = made(dataset_plan(2, 1), tmp_path / "whole").root
    roots = [whole, changed(whole, tmp_path / "changed")]
    roots.sort(key=lambda root: root.name != first)
    contents = [tree(root) for root in roots]
    left = 0

    def counted(change: Any) -> Any:
        def counting(*arguments: Any, **named: Any) -> None:
            nonlocal left
            left -= 1
            if left < 0:
                raise KeyboardInterrupt
            change(*arguments, **named)

        return counting

    for last in range(15):
        memory.store.clear()
        put(url, roots[0])
        with monkeypatch.context() as patched:
            for name in ("pipe_file", "put_file", "cp_file", "rm_file"):
                patched.setattr(memory, name, counted(getattr(memory, name)))
            for root in (roots[1], roots[0], roots[1]):
                left = last
                with suppress(KeyboardInterrupt):
                    put(url, root)
                found = remote_files(url)
                found.pop(MARKER, None)
                assert layout.MANIFEST not in found or found in contents
        for root, content in zip(roots, contents, strict=True):
            put(url, root)
            assert remote_files(url) == content
    assert left > 0, "the last upload was killed, too"
    memory.store.clear()


def test_an_upload_during_the_build_is_noticed(url: str, built: Path, tmp_path: Path) -> None:
    """The files of the other dataset may have the same sizes."""
    put(url, built)
    other = changed(built, tmp_path / "other")
    slow = Target(url, built)  # as a build begins that takes hours
    assert put(url, other).sent == 2 and remote_files(url) == tree(other)
    assert slow.put(quiet).sent == 2
    assert remote_files(url) == tree(built)


@pytest.mark.parametrize("calls", [0, 7])
def test_a_stopped_upload_is_resumed(url: str, built: Path, calls: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """There is no manifest until the upload is complete; files that were sent are not sent again."""
    fs, _ = fsspec.core.url_to_fs(url)
    send, count = type(fs).put_file, 0

    def failing(self: Any, *args: Any, **kwargs: Any) -> None:
        nonlocal count
        count += 1
        if count > calls:
            raise ConnectionError("the line is dead")
        send(self, *args, **kwargs)

    monkeypatch.setattr(type(fs), "put_file", failing)
    with pytest.raises(RunError, match="the line is dead; try again: uploaded files are kept"):
        put(url, built)
    assert "manifest.json" not in remote_files(url)
    monkeypatch.setattr(type(fs), "put_file", send)
    assert put(url, built).kept >= calls
    assert remote_files(url) == tree(built)


def test_an_upload_to_a_local_dataset_does_not_write_through_hard_links(built: Path, tmp_path: Path) -> None:
    target = tmp_path / "remote" / "small"
    plan = dataset_plan()
    less = plan.model_copy(update={"variants": plan.variants[:2]})
    made(less, target)
    put(f"file://{target}", built)
    assert tree(target) == tree(built)


def test_a_folder_that_is_a_link_is_not_written_through(built: Path, tmp_path: Path) -> None:
    """An untrusted dataset has a link `recipe -> elsewhere`."""
    place, other = tmp_path / "remote" / "small", tmp_path / "elsewhere"
    put(f"file://{place}", built)
    folder = next(path for path in place.iterdir() if path.is_dir())
    folder.rename(other)
    folder.symlink_to(other)
    before = tree(other)
    put(f"file://{place}", changed(built, tmp_path / "small"))
    assert tree(other) == before and before
    assert not folder.is_symlink() and tree(place) == tree(tmp_path / "small")


@pytest.mark.parametrize("url", ["s3://", "file:///"])
def test_a_url_without_a_path_is_refused(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="has no path"):
        Target(url, tmp_path / "small")
    assert not list(tmp_path.iterdir())


def test_foreign_files_at_the_url_are_unchanged(url: str, built: Path) -> None:
    fs, prefix = fsspec.core.url_to_fs(url)
    fs.makedirs(prefix, exist_ok=True)
    fs.pipe_file(f"{prefix}/thesis.tex", b"precious")
    with pytest.raises(InputError, match=r"holds files but no manifest\.json of a dataset; name another place"):
        Target(url, built)
    fs.rm_file(f"{prefix}/thesis.tex")
    put(url, built)
    fs.pipe_file(f"{prefix}/thesis.tex", b"precious")
    notices = list[str]()
    if url.startswith("file"):  # the folder is kept beside the new one
        Target(url, built).put(lambda *_: None, notice=notices.append)
        assert remote_files(url) == tree(built) and "small.replaced" in notices[0]
        assert remote_files(f"{url}.replaced")["thesis.tex"] == b"precious"
        return
    with pytest.raises(InputError, match=r"holds a file that is not the dataset's, 'thesis\.tex'"):
        put(url, built)
    assert remote_files(url)["thesis.tex"] == b"precious"


def test_a_damaged_file_is_not_uploaded(url: str, built: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(built, copy)
    victim = next(copy.rglob("rgb/000003.png"))
    body = bytearray(victim.read_bytes())
    body[-20] ^= 1
    victim.unlink()
    victim.write_bytes(body)
    with pytest.raises(InputError, match="differs from its SHA-256 in the manifest"):
        put(url, copy)


@pytest.mark.parametrize(("scheme", "module"), [("s3", "s3fs"), ("gs", "gcsfs"), ("az", "adlfs")])
def test_a_missing_library_is_an_error(scheme: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"its library is not installed; install it: pip install '{module}>="):
        Target(f"{scheme}://bucket/x", Path("small"))


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Start a local S3 server, and return a bucket on it."""
    server_module = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    server = server_module.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for key, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(key, value)
    boto3.client("s3").create_bucket(Bucket="datasets")
    yield "s3://datasets/tiny"
    server.stop()


def recipe(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "recipe_cli", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, env=dict(os.environ))


@pytest.mark.s3
def test_a_build_into_a_bucket(s3: str, tmp_path: Path) -> None:
    """The files are read by boto3, Amazon's client, and pass verification as a folder."""
    import boto3

    shutil.copy(TINY, tmp_path)
    done = recipe(tmp_path, "build", "tiny.yaml", "--out", s3, "--json")
    assert done.returncode == 0, done.stderr
    reported = json.loads(done.stdout)
    assert reported["url"] == s3 and reported["kept"] == 0
    client, back = boto3.client("s3"), tmp_path / "back"
    for row in client.get_paginator("list_objects_v2").paginate(Bucket="datasets", Prefix="tiny/"):
        for entry in row["Contents"]:
            path = back / entry["Key"].removeprefix("tiny/")
            path.parent.mkdir(parents=True, exist_ok=True)
            client.download_file("datasets", entry["Key"], str(path))
    assert tree(back) == tree(tmp_path / "datasets" / "tiny")
    assert verify_files(read(back), Options(nonce=1), quiet).verdict == "PASS"
    again = json.loads(recipe(tmp_path, "build", "tiny.yaml", "--out", s3, "--json").stdout)
    assert (again["built"], again["sent"], again["copied"]) == (False, 0, 0)


@pytest.mark.s3
def test_a_dataset_in_a_bucket_passes_verification(s3: str, tmp_path: Path) -> None:
    import boto3

    shutil.copy(TINY, tmp_path)
    assert recipe(tmp_path, "build", "tiny.yaml", "--out", s3).returncode == 0
    shutil.rmtree(tmp_path / "datasets")
    whole = recipe(tmp_path, "verify", s3, "--integrity")
    assert (whole.returncode, whole.stderr) == (0, "") and whole.stdout.startswith(f"PASS  {s3}\n")
    for arguments in (["tiny.yaml", "--against", s3], [s3]):
        held = recipe(tmp_path, "verify", *arguments, "--frames", "2")
        assert held.returncode == 0 and "error[" not in held.stderr, held.stdout
    client = boto3.client("s3")
    rows = client.list_objects_v2(Bucket="datasets", Prefix="tiny/")["Contents"]
    key = next(row["Key"] for row in rows if row["Key"].endswith("rgb/000000.png"))
    body = client.get_object(Bucket="datasets", Key=key)["Body"].read()
    client.put_object(Bucket="datasets", Key=key, Body=body[:-9] + bytes([body[-9] ^ 1]) + body[-8:])
    client.put_object(Bucket="datasets", Key="tiny/preview/", Body=b"")  # as the web console creates a folder
    for arguments in ([s3, "--integrity"], ["tiny.yaml", "--against", s3, "--frames", "1"]):
        spoiled = recipe(tmp_path, "verify", *arguments)
        assert spoiled.returncode == 1
        assert f"{key.removeprefix('tiny/')} differs from its SHA-256 in the manifest" in spoiled.stdout
    gone = recipe(tmp_path, "verify", "s3://nobodys-bucket/tiny", "--integrity")
    assert (gone.returncode, "s3://nobodys-bucket/tiny" in gone.stderr, "Traceback" in gone.stderr) == (2, True, False)


@pytest.mark.s3
def test_a_missing_bucket_is_an_error(s3: str, tmp_path: Path) -> None:
    shutil.copy(TINY, tmp_path)
    done = recipe(tmp_path, "build", "tiny.yaml", "--out", "s3://nobodys-bucket/tiny")
    assert (done.returncode, done.stdout) == (2, "")
    assert "s3://nobodys-bucket/tiny: there is no such place (a bucket must exist already)" in done.stderr
    assert not (tmp_path / "datasets").exists()


@pytest.mark.s3
def test_a_server_without_an_answer_is_an_error(s3: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    shutil.copy(TINY, tmp_path)
    done = recipe(tmp_path, "build", "tiny.yaml", "--out", s3)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert f"error[remote]: {s3}: " in done.stderr


def test_a_store_that_cannot_copy_gets_equal_files_again(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    url = "memory://bucket/small"
    memory = type(fsspec.filesystem("memory"))

    def not_implemented(*_: Any, **__: Any) -> None:
        raise NotImplementedError

    monkeypatch.setattr(memory, "cp_file", not_implemented)
    try:
        put(url, built)
        assert remote_files(url) == tree(built)
    finally:
        memory.store.clear()
