"""Asset files, which plans refer to by digest.

A plan specifies the content of a file and not its path. The recipe gives the path; a dataset's folder does not. Bytes
are verified against the digest on every read, in every process.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import assets as files
from recipe_compiler.ir.bounded_reads import read_regular
from recipe_compiler.ir.errors import RunError
from recipe_compiler.ir.plan import FilePlan, PropPlan, ScenarioPlan, TexturePlan

from recipe_runtime.core.files import stamp_of


@lru_cache(maxsize=1)  # the images of a mesh are read one after the other, each from the whole file
def _verified(path: Path, size: int, sha256: str, stamp: str) -> bytes | None:
    """Return the bytes of a file; None if it has another digest. `stamp` changes when the file does."""
    content = read_regular(path, size)
    return content if hashlib.sha256(content).hexdigest() == sha256 else None


@dataclass(frozen=True)
class Assets:
    """Paths of asset files by SHA-256. Picklable, so that it can be sent to workers."""

    places: Mapping[str, Path] = field(default_factory=dict)

    def missing(self, plans: Iterable[ScenarioPlan]) -> str | None:
        """Return why plans cannot be rendered here: the first missing or damaged file; None if there is none."""
        for file in {sha256: file for plan in plans for sha256, file in plan.files.items()}.values():
            try:
                self.content(file)
            except RunError as error:
                return str(error)
        return None

    def content(self, file: FilePlan) -> bytes:
        """Return the bytes of a file.

        Raises:
            RunError: It is not available, or no longer has the plan's digest.
        """
        path = self.places.get(file.sha256)
        if path is None:
            reason = "name the recipe, which contains its path"
            raise RunError(f"the .{file.kind} file sha256:{file.sha256} is not available; {reason}")
        try:
            content = _verified(path, file.bytes, file.sha256, stamp_of(path.stat()))
        except (OSError, ValueError) as error:
            reason = (isinstance(error, OSError) and error.strerror) or str(error)
            raise RunError(f"{path}: cannot be read: {reason}; restore it") from None
        if content is None:
            remedy = "restore it, or compile the recipe again"
            raise RunError(f"{path}: is no longer the file sha256:{file.sha256} of the plan; {remedy}")
        return content

    def mesh(self, prop: PropPlan) -> files.MeshData:
        """Return the mesh of a prop that has one; RunError if it cannot be loaded."""
        assert prop.mesh is not None
        try:
            return files.mesh(self.content(prop.mesh), prop.mesh.kind, prop.up)
        except files.AssetError as error:
            raise RunError(f"{prop.name}: {error}") from None

    def body(self, file: FilePlan) -> files.BodyData:
        """Return the body of an actor; RunError if it cannot be loaded."""
        try:
            return files.body(self.content(file))
        except files.AssetError as error:
            raise RunError(f"sha256:{file.sha256}: {error}") from None

    def image(self, texture: TexturePlan) -> NDArray[np.uint8]:
        """Return the pixels of a texture, uint8 [H, W, 3] sRGB; RunError if it cannot be loaded."""
        try:
            return files.image(self.content(texture.file), texture.file.kind, texture.number)
        except files.AssetError as error:
            raise RunError(f"sha256:{texture.file.sha256}: {error}") from None
