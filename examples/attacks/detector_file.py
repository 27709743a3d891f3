"""The weights of detectors trained on photographs: fetched once from npm packages, checked, kept in the cache."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import tarfile
import urllib.error
import urllib.request
from dataclasses import dataclass

from recipe_compiler.ir.errors import RunError
from recipe_runtime.cache.store import Store


@dataclass(frozen=True)
class Member:
    """A file of a package, or its bytes from `first` to before `end`."""

    path: str
    sha256: str
    first: int = 0
    end: int | None = None


@dataclass(frozen=True)
class Package:
    """A version of an npm package, and what is used of it; `size` in bytes."""

    name: str
    version: str
    sha256: str
    size: int
    members: tuple[Member, ...]


# SSD-MobileNetV2, trained by Google on Open Images v4 (Apache-2.0): a .tflite file.
OBJECTRON = Package(
    "@mediapipe/objectron",
    "0.4.1675468480",
    "fc3e37b326b05e8f596099c90b3e0931b05a56cd3160b9ac450b621794bac94c",
    32_667_233,
    (
        Member(
            "package/objectron_solution_packed_assets.data",
            "d0a5255bf8c4f5a0bc4240741a76c41d5e939f7655078f945f50ab53a9375da6",
            184,
            9_987_912,
        ),
    ),
)
# CenterNet with MobileNetV3, trained on COCO (MIT): a graph model of TensorFlow.js.
HUMAN = Package(
    "@vladmandic/human",
    "3.3.6",
    "425e9c51dbbca0c8934362b170cb0d54c2529c11c654b3c03092b16e9d6ad3f7",
    28_615_417,
    (
        Member("package/models/centernet.json", "bfb942eaacc5becf738d536663bc4580a0ae9e560722306e6d4dd7fe4a09de05"),
        Member("package/models/centernet.bin", "1b635a15009071f506f9f2b3519b31c072c534888989f30d269ffd44734ef7ef"),
    ),
)


def detector_files(package: Package) -> list[bytes]:
    """Return the members of a package.

    They are fetched on the first call, from the registry that `npm_config_registry` names or npm is configured for.

    Raises:
        RunError: No registry is known, or it does not answer, or sends another file.
    """
    store = Store()
    kept = [store.get("downloads", member.sha256) for member in package.members]
    found = [
        body for body, m in zip(kept, package.members, strict=True) if body is not None and _sha256(body) == m.sha256
    ]
    if len(found) == len(package.members):
        return found
    found = unpacked(package, _fetched(package))
    for member, body in zip(package.members, found, strict=True):
        store.put("downloads", member.sha256, body)
    return found


def unpacked(package: Package, packed: bytes) -> list[bytes]:
    """Return the members of a package, from its bytes.

    Raises:
        RunError: It is another package.
    """
    title = f"{package.name} {package.version}"
    _check(title, packed, package.sha256)
    found = []
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        for member in package.members:
            file = archive.extractfile(member.path)
            found.append(file.read()[member.first : member.end] if file else b"")
            _check(f"{member.path} in {title}", found[-1], member.sha256)
    return found


def _fetched(package: Package) -> bytes:
    url = f"{_registry()}/{package.name}/-/{package.name.partition('/')[2]}-{package.version}.tgz"
    try:
        with urllib.request.urlopen(url, timeout=60) as answer:
            body: bytes = answer.read(package.size + 1)
    except (OSError, urllib.error.URLError) as error:
        raise RunError(
            f"{package.name} {package.version} cannot be fetched from {url}: {error}; try again later"
        ) from error
    return body


def _registry() -> str:
    registry = os.environ.get("npm_config_registry", "")  # noqa: SIM112
    if not registry:
        try:
            command = ["npm", "config", "get", "registry"]
            registry = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.strip()
        except (OSError, subprocess.SubprocessError) as error:
            raise RunError(
                f"npm cannot be asked for its registry: {error}; install npm or set npm_config_registry"
            ) from error
    return registry.rstrip("/")


def _check(name: str, body: bytes, wanted: str) -> None:
    found = _sha256(body)
    if found != wanted:
        raise RunError(f"{name} has the SHA-256 {found}, not {wanted}; check the registry, or fetch it again")


def _sha256(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()
