"""Datasets uploaded by fsspec: complete or absent, equal to the folder, and only new files are sent."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fsspec
import pytest
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import read
from recipe_runtime.transfer import local_place
from recipe_runtime.transfer.upload import MARKER, Copied, Target
from recipe_runtime.transfer.upload_journal import UploadJournal
from recipe_runtime.verify.verify import Options, verify_files

from tests.runtime.fakes import ENGINES, dataset_plan
from tests.sources import ROOT

TINY = ROOT / "tests" / "golden" / "tiny.yaml"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    return build(
        dataset_plan(), folder / "small", BuildOptions(engines=ENGINES, workers=0, cache=folder / "cache")
    ).path


@pytest.fixture(params=["memory", "file"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    yield "memory://bucket/small" if request.param == "memory" else f"file://{tmp_path}/remote/small"
    fsspec.filesystem("memory").store.clear()


def put(url: str, root: Path) -> Copied:
    return Target(url, root).put(lambda *_: None)


def local(root: Path) -> dict[str, bytes]:
    return {p.relative_to(root).as_posix(): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def remote_files(url: str) -> dict[str, bytes]:
    fs, prefix = fsspec.core.url_to_fs(url)
    return {name[len(prefix) + 1 :]: fs.cat_file(name) for name in fs.find(prefix)}


@pytest.mark.slow
def test_all_files_are_uploaded_once(url: str, built: Path) -> None:
    first = put(url, built)
    assert remote_files(url) == local(built)
    contents = {body for path, body in local(built).items() if path != "manifest.json"}
    assert first == Copied(len(contents), len(local(built)) - 1 - len(contents), 0)
    assert first.copied > 0  # labels shared by variants
    assert put(url, built) == Copied(0, 0, len(local(built)) - 1)


@pytest.mark.slow
def test_only_new_files_are_sent_and_obsolete_ones_removed(url: str, built: Path, tmp_path: Path) -> None:
    put(url, built)
    before = remote_files(url)
    plan = dataset_plan()
    less = plan.model_copy(update={"variants": plan.variants[:1]})
    other = build(
        less, tmp_path / "less" / "small", BuildOptions(engines=ENGINES, workers=0, cache=tmp_path / "cache")
    ).path
    sent = put(url, other)
    assert remote_files(url) == local(other)
    unchanged = {path for path, body in local(other).items() if before.get(path) == body}
    assert sent.kept == len(unchanged) and sent.sent < len(local(other)) / 2
    assert not list(other.parent.glob(".*sent*"))
    if url.startswith("file"):  # `verify` reports folders without a file
        assert all(any(folder.iterdir()) for folder in Path(url[7:]).rglob("*") if folder.is_dir())


def with_files(root: Path, files: dict[str, bytes]) -> dict[str, bytes]:
    """Write files into a dataset, with their manifest rows; return all of its files."""
    manifest = json.loads((root / "manifest.json").read_text())
    for path, body in files.items():
        (root / path).parent.mkdir(exist_ok=True)
        (root / path).write_bytes(body)
        manifest["files"][path] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
    (root / "manifest.json").write_text(json.dumps(manifest))
    return local(root)


def test_files_of_an_interrupted_upload_are_not_taken_for_those_of_another_dataset(
    url: str, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: files that were sent and not recorded counted as those of the earlier dataset, or as foreign."""

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    root, card = tmp_path / "small", (built / "README.md").read_bytes()
    put(url, shutil.copytree(built, root))
    with_files(root, {"README.md": card[:-2] + b"X\n", "extra/new.txt": b"new"})
    with monkeypatch.context() as patched:
        patched.setattr(UploadJournal, "record", killed)
        with pytest.raises(KeyboardInterrupt):
            put(url, root)
    assert remote_files(url) not in (local(built), local(root))
    shutil.rmtree(root)
    put(url, shutil.copytree(built, root))
    assert remote_files(url) == local(built)


def test_an_upload_that_is_killed_before_its_marker_is_written_is_resumed(
    url: str, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: the place had no marker any more, or one without a record, and every further upload was refused."""

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    root = tmp_path / "small"
    with_files(shutil.copytree(built, root), {"extra/new.txt": b"new"})
    fs, _ = fsspec.core.url_to_fs(url)
    for kind, name in ((Target, "_remove_empty_folders"), (type(fs), "pipe_file")):
        with monkeypatch.context() as patched:
            patched.setattr(kind, name, killed)
            with pytest.raises(KeyboardInterrupt):
                put(url, root)
        shutil.rmtree(root)
        shutil.copytree(built, root)
    assert put(url, root).kept > 0
    assert remote_files(url) == local(built)


def test_empty_folders_at_a_local_place_are_removed(built: Path, tmp_path: Path) -> None:
    """Regression: `verify` reports them, and an interrupted upload leaves them."""
    place, root = tmp_path / "place", shutil.copytree(built, tmp_path / "small")
    put(f"file://{place}", root)
    for _ in ("equal", "changed"):
        (place / "left" / "behind").mkdir(parents=True)
        put(f"file://{place}", root)
        assert not (place / "left").exists()
        with_files(root, {"extra.txt": b"new"})


@pytest.mark.parametrize("place", ["{root}", "{link}", "{root}/copy", "{root}/mots/copy", "{above}"])
def test_a_dataset_is_not_copied_to_its_own_folder(built: Path, tmp_path: Path, place: str) -> None:
    """Files at the place are removed before they are sent: there, that would remove the dataset."""
    root = Path(shutil.copytree(built, tmp_path / "all" / "small"))
    (tmp_path / "link").symlink_to(root)
    before = local(tmp_path)
    url = f"file://{place.format(root=root, above=root.parent, link=tmp_path / 'link')}"
    with pytest.raises(InputError, match="is not apart from"):
        Target(url, root)
    assert local(tmp_path) == before


def test_a_place_behind_a_link_to_itself_is_an_error(built: Path, tmp_path: Path) -> None:
    """Regression: a traceback, as `Path.resolve` raises RuntimeError for such a link."""
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(RunError, match="symbolic link"):
        Target(f"file://{tmp_path}/loop/copy", built)


def test_an_upload_during_the_build_is_noticed(url: str, built: Path, tmp_path: Path) -> None:
    """The files of the other dataset may have the same sizes."""
    put(url, built)
    other = Path(shutil.copytree(built, tmp_path / "other"))
    body = (other / layout.CARD).read_bytes().swapcase()
    (other / layout.CARD).write_bytes(body)
    manifest = json.loads((other / layout.MANIFEST).read_bytes())
    manifest["files"][layout.CARD]["sha256"] = hashlib.sha256(body).hexdigest()
    (other / layout.MANIFEST).write_text(json.dumps(manifest))
    slow = Target(url, built)  # as a build begins that takes hours
    assert put(url, other).sent == 1 and remote_files(url) == local(other)
    assert slow.put(lambda *_: None).sent == 1
    assert remote_files(url) == local(built)


def test_a_url_that_is_not_utf8_is_a_place(built: Path, tmp_path: Path) -> None:
    assert put(f"file://{tmp_path}/\udcff", built).kept == 0
    assert local(tmp_path / "\udcff") == local(built)


@pytest.mark.parametrize("calls", [0, 1, 7, 40])
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
    assert "manifest.json" not in remote_files(url) and MARKER in remote_files(url)
    monkeypatch.setattr(type(fs), "put_file", send)
    assert put(url, built).kept >= calls
    assert remote_files(url) == local(built)


def test_an_older_dataset_is_never_mixed_with_a_new_one(url: str, built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(url, built)
    fs, prefix = fsspec.core.url_to_fs(url)
    name = next(name for name in fs.find(prefix) if name.endswith("rgb/000003.png"))
    fs.pipe_file(name, b"half")
    monkeypatch.setattr(type(fs), "put_file", lambda *_, **__: (_ for _ in ()).throw(ConnectionError("gone")))
    with pytest.raises(RunError):
        put(url, built)
    assert "manifest.json" not in remote_files(url)
    monkeypatch.undo()
    assert put(url, built).sent == 1
    assert remote_files(url) == local(built)


@pytest.mark.slow
def test_an_upload_by_another_host_invalidates_the_journal_of_a_stopped_one(
    url: str, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An upload stops, another host uploads other bytes of the same sizes, and the first upload is resumed."""
    fs, prefix = fsspec.core.url_to_fs(url)
    send, sent = type(fs).put_file, list[str]()

    def failing(self: Any, *args: Any, **kwargs: Any) -> None:
        if len(sent) > 30:
            raise ConnectionError("the line is dead")
        send(self, *args, **kwargs)
        sent.append(args[1])

    monkeypatch.setattr(type(fs), "put_file", failing)
    with pytest.raises(RunError):
        put(url, built)
    monkeypatch.undo()
    for name in sent:
        fs.rm_file(name)
        fs.pipe_file(name, bytes(len(local(built)[name.partition("small/")[2]])))
    fs.pipe_file(f"{prefix}/{MARKER}", b'{"copy": "another", "dataset": "x"}')
    assert put(url, built).kept == 0
    assert remote_files(url) == local(built)


@pytest.mark.slow
def test_an_upload_writes_no_file_over_one_of_a_newer_upload(
    url: str, built: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: an upload that was suspended went on, and broke a dataset that was complete."""
    fs, prefix = fsspec.core.url_to_fs(url)
    monkeypatch.setattr("recipe_runtime.transfer.upload._AT_ONCE", 1)
    place_file, placed = Target._place_file, list[str]()

    def counted(self: Target, token: str, path: str, *rest: Any) -> Any:
        if len(placed) == 3:
            fs.pipe_file(f"{prefix}/{MARKER}", b"{}")  # as another upload does
        found = place_file(self, token, path, *rest)
        placed.append(path)
        return found

    monkeypatch.setattr(Target, "_place_file", counted)
    with pytest.raises(RunError, match="another upload to this place ran at the same time"):
        put(url, built)
    assert len(placed) == 3
    assert set(remote_files(url)) == {*placed, MARKER}


@pytest.mark.parametrize(("path", "body"), [("manifest.json", b"{}"), (MARKER, b'{"copy": "another"}')])
def test_another_upload_at_the_end_of_one_is_noticed(
    url: str, built: Path, monkeypatch: pytest.MonkeyPatch, path: str, body: bytes
) -> None:
    """Regression: its manifest was overwritten, and the mixed copy was reported as complete."""
    fs, prefix = fsspec.core.url_to_fs(url)
    remove = Target._remove_empty_folders

    def removed(self: Target) -> None:
        remove(self)
        fs.pipe_file(f"{prefix}/{path}", body)

    monkeypatch.setattr(Target, "_remove_empty_folders", removed)
    with pytest.raises(RunError, match="another upload to this place ran at the same time"):
        put(url, built)
    assert remote_files(url)[path] == body


def test_two_uploads_to_one_folder_do_not_run_at_once(built: Path, tmp_path: Path) -> None:
    place = tmp_path / "remote"
    place.mkdir()
    with local_place.locked(place), pytest.raises(RunError, match=r"another upload to .*remote is running"):
        put(f"file://{place}", built)
    assert put(f"file://{place}", built).sent


def test_an_upload_to_a_local_dataset_does_not_write_through_hard_links(built: Path, tmp_path: Path) -> None:
    target = tmp_path / "remote" / "small"
    plan = dataset_plan()
    less = plan.model_copy(update={"variants": plan.variants[:2]})
    build(less, target, BuildOptions(engines=ENGINES, workers=0, cache=tmp_path / "cache"))
    put(f"file://{target}", built)
    assert local(target) == local(built)


def test_a_folder_that_is_a_link_is_not_written_through(built: Path, tmp_path: Path) -> None:
    """With an untrusted dataset that has a link `recipe -> elsewhere`, a build must not write there."""
    place, other = tmp_path / "remote" / "small", tmp_path / "elsewhere"
    put(f"file://{place}", built)
    manifest = json.loads((place / "manifest.json").read_text())
    folder = next(path for path in manifest["files"] if "/" in path).partition("/")[0]
    (place / folder).rename(other)
    (place / folder).symlink_to(other)
    kept = {path: row for path, row in manifest["files"].items() if not path.startswith(f"{folder}/")}
    manifest["files"] = {**kept, folder: {"size": 1, "sha256": "0" * 64}}
    (place / "manifest.json").write_text(json.dumps(manifest))
    before = local(other)
    with pytest.raises(InputError, match=r"(is a symbolic link|holds files but no)"):
        put(f"file://{place}", built)
    assert local(other) == before and before


def test_the_journal_neither_follows_a_link_nor_waits_for_a_pipe(built: Path, tmp_path: Path) -> None:
    """An attacker with access to the folder can compute the journal's name."""
    url, root = f"file://{tmp_path}/remote/small", tmp_path / "small"
    shutil.copytree(built, root)
    journal, precious = UploadJournal(root, url), tmp_path / "precious"
    precious.write_text("precious")
    path = journal._path
    path.symlink_to(precious)
    assert journal.rows("x") == {}
    put(url, root)
    assert precious.read_text() == "precious" and not path.is_symlink()
    os.mkfifo(path)
    assert journal.rows("x") == {}
    path.unlink()
    path.write_bytes(b"x\n" + b"[" * 50_000 + b"\n" + b'[["a"], 1]\n["a", 3, "b"]\n')
    assert journal.rows("x") == {"a": (3, "b")}
    path.unlink()
    path.symlink_to(precious)
    with pytest.raises(RunError, match="cannot be written"):
        journal.record("a", (1, "b"))


@pytest.mark.parametrize("url", ["s3://", "memory://", "file:///"])
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


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("nowhere://bucket/x", "nowhere://bucket/x: nowhere:// is not a supported scheme"),
        ("gs://bucket/x", r"its library is not installed; install it: pip install 'gcsfs>=2024\.6'"),
    ],
)
def test_unsupported_urls_are_refused(url: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gcsfs", None)
    with pytest.raises(InputError, match=message):
        Target(url, Path("small"))


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
    assert local(back) == local(tmp_path / "datasets" / "tiny")
    assert verify_files(read(back), Options(nonce=1), lambda *_: None).verdict == "PASS"
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
        assert remote_files(url) == local(built)
    finally:
        memory.store.clear()
