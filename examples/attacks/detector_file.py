"""The weights of a detector trained on photographs: fetched once, checked, kept in the cache.

SSD-MobileNetV2, trained by Google on Open Images v4, is part of the npm package @mediapipe/objectron (Apache-2.0).
"""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import tarfile
import urllib.error
import urllib.request

from recipe_compiler.ir.errors import RunError
from recipe_runtime.cache.store import Store

PACKAGE, VERSION = "@mediapipe/objectron", "0.4.1675468480"
PACKAGE_SHA256 = "fc3e37b326b05e8f596099c90b3e0931b05a56cd3160b9ac450b621794bac94c"
MODEL_SHA256 = "d0a5255bf8c4f5a0bc4240741a76c41d5e939f7655078f945f50ab53a9375da6"

_MEMBER = "package/objectron_solution_packed_assets.data"
_MODEL = slice(184, 9_987_912)  # bytes of that member
_PACKAGE_BYTES = 32_667_233


def detector_file() -> bytes:
    """Return the detector's .tflite file.

    It is fetched on the first call, from the registry that `npm_config_registry` names or npm is configured for.

    Raises:
        RunError: No registry is known, or it does not answer, or sends another file.
    """
    store = Store()
    model = store.get("downloads", MODEL_SHA256)
    if model is None or hashlib.sha256(model).hexdigest() != MODEL_SHA256:
        model = unpacked(_fetched())
        store.put("downloads", MODEL_SHA256, model)
    return model


def unpacked(package: bytes) -> bytes:
    """Return the model of the package's bytes.

    Raises:
        RunError: It is another package.
    """
    _check(f"{PACKAGE} {VERSION}", package, PACKAGE_SHA256)
    with tarfile.open(fileobj=io.BytesIO(package)) as archive:
        member = archive.extractfile(_MEMBER)
        model = member.read()[_MODEL] if member else b""
    _check(f"the detector in {PACKAGE} {VERSION}", model, MODEL_SHA256)
    return model


def _fetched() -> bytes:
    url = f"{_registry()}/{PACKAGE}/-/{PACKAGE.partition('/')[2]}-{VERSION}.tgz"
    try:
        with urllib.request.urlopen(url, timeout=60) as answer:
            body: bytes = answer.read(_PACKAGE_BYTES + 1)
    except (OSError, urllib.error.URLError) as error:
        raise RunError(f"{PACKAGE} {VERSION} cannot be fetched from {url}: {error}; try again later") from error
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
    found = hashlib.sha256(body).hexdigest()
    if found != wanted:
        raise RunError(f"{name} has the SHA-256 {found}, not {wanted}; check the registry, or fetch it again")
