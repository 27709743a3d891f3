"""Decodes a file of a known kind to its mesh or its pixels. Any error in the file raises AssetError."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from recipe_compiler.ir.assets import bodies, gltf, obj, png, stl
from recipe_compiler.ir.assets.geometry import AssetError, MeshData, Raw, finish

_READERS: dict[str, Callable[[bytes], Sequence[Raw]]] = {
    "glb": gltf.read,
    "gltf": gltf.read,
    "obj": obj.read,
    "stl": stl.read,
}
_DAMAGE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error)


def mesh(content: bytes, kind: str, up: str) -> MeshData:
    """Return the mesh in a file of a kind in `_READERS`, whose axis `up` (y or z) points up."""
    with _as_one_error():
        return finish(_READERS[kind](content), up)


def body(content: bytes) -> bodies.BodyData:
    """Return the body of an actor in a glTF file."""
    with _as_one_error():
        return bodies.read(content)


def image(content: bytes, kind: str, number: int | None = None) -> png.Pixels:
    """Return the pixels [H, W, 3], sRGB, of an image, or of image `number` of a glTF file."""
    with _as_one_error():
        return png.decode(content) if number is None or kind == "png" else gltf.picture(content, number)


@contextmanager
def _as_one_error() -> Iterator[None]:
    try:
        yield
    except AssetError:
        raise
    except _DAMAGE as error:
        reason = " ".join(str(error).split())[:60]
        raise AssetError(f"is damaged: {type(error).__name__} {reason}; export it again") from None
