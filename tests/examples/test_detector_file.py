"""The detector's file is checked before it is used or stored."""

from __future__ import annotations

import hashlib
import io
import tarfile
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from recipe_compiler.ir.errors import RunError
from recipe_runtime.cache.store import Store

from examples.attacks import detector_file as module

MODEL = b"a model" * 9


def package(model: bytes) -> bytes:
    content, packed = b"=" * 184 + model, io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w:gz") as archive:
        member = tarfile.TarInfo("package/objectron_solution_packed_assets.data")
        member.size = len(content)
        archive.addfile(member, io.BytesIO(content))
    return packed.getvalue()


@pytest.fixture
def registry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the registry by one that sends a small package; return the list of requested addresses."""
    body, fetched = package(MODEL), []

    def urlopen(url: str, timeout: float) -> Any:
        fetched.append(url)
        return io.BytesIO(body)

    monkeypatch.setenv("RECIPE_CACHE", str(tmp_path))
    monkeypatch.setenv("npm_config_registry", "https://registry.example/npm/")
    monkeypatch.setattr(urllib.request, "urlopen", urlopen)
    monkeypatch.setattr(module, "PACKAGE_SHA256", hashlib.sha256(body).hexdigest())
    monkeypatch.setattr(module, "MODEL_SHA256", hashlib.sha256(MODEL).hexdigest())
    return fetched


def test_it_is_downloaded_once(registry: list[str]) -> None:
    assert [module.detector_file(), module.detector_file()] == [MODEL, MODEL]
    version = "0.4.1675468480"
    assert registry == [f"https://registry.example/npm/@mediapipe/objectron/-/objectron-{version}.tgz"]


def test_a_damaged_file_in_the_cache_is_downloaded_again(registry: list[str]) -> None:
    module.detector_file()
    kept = Store().path("downloads", module.MODEL_SHA256)
    kept.write_bytes(kept.read_bytes()[:-1])
    assert module.detector_file() == MODEL and len(registry) == 2
    assert module.detector_file() == MODEL and len(registry) == 2
    Store().put("downloads", module.MODEL_SHA256, b"another file")
    assert module.detector_file() == MODEL and len(registry) == 3, "an entry may have another content"


@pytest.mark.parametrize("constant", ["PACKAGE_SHA256", "MODEL_SHA256"])
def test_other_bytes_are_refused_and_not_stored(
    constant: str, registry: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, constant, "0" * 64)
    with pytest.raises(RunError, match="not 0000"):
        module.detector_file()
    assert not list(tmp_path.rglob("downloads"))


def test_an_unreachable_registry_is_a_run_error(registry: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(url: str, timeout: float) -> Any:
        raise OSError("no route")

    monkeypatch.setattr(urllib.request, "urlopen", unreachable)
    with pytest.raises(RunError, match="no route; try again later"):
        module.detector_file()


def test_the_registry_is_that_of_npms_configuration(
    registry: list[str], tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    npm = tmp_path_factory.mktemp("bin") / "npm"
    npm.write_text('#!/bin/sh\n[ "$*" = "config get registry" ] && echo https://configured.example/\n')
    npm.chmod(0o755)
    monkeypatch.delenv("npm_config_registry")
    monkeypatch.setenv("PATH", f"{npm.parent}:/bin")
    module.detector_file()
    assert registry[0].startswith("https://configured.example/@mediapipe/")


def test_without_npm_the_error_has_a_remedy(
    registry: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("npm_config_registry")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RunError, match="install npm or set npm_config_registry"):
        module.detector_file()
