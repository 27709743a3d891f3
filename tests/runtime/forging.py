"""Changes of a dataset's folder, as a forger would make them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from recipe_compiler.ir.canonical import pretty


@contextmanager
def edited(root: Path) -> Iterator[Any]:
    """Yield the manifest in a folder, and write it again as the block leaves it."""
    path = root / "manifest.json"
    manifest = json.loads(path.read_text())
    yield manifest
    path.unlink()  # it may be a hard link
    path.write_text(pretty(manifest))


def rewrite(root: Path, path: str, body: bytes) -> None:
    """Change a file, and its row in the manifest."""
    (root / path).unlink(missing_ok=True)
    (root / path).write_bytes(body)
    with edited(root) as manifest:
        manifest["files"][path] = {"size": len(body), "sha256": hashlib.sha256(body).hexdigest()}
