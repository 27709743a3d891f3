"""Small meshes and images for tests, built byte by byte, so that tests can break them at any place."""

from __future__ import annotations

import json
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int64)


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(pixels: NDArray[np.uint8], *, extra: bytes = b"") -> bytes:
    """Return an unfiltered PNG of [H, W], [H, W, 2], [H, W, 3] or [H, W, 4]; `extra` chunks precede the pixels."""
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, {1: 0, 2: 4, 3: 2, 4: 6}[channels], 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in np.ascontiguousarray(pixels))
    body = chunk(b"IHDR", header) + extra + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def picture(width: int = 4, height: int = 3) -> NDArray[np.uint8]:
    """Return an image in which every texel has another colour."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([x * 60, y * 80, (x + y) * 30 % 256], axis=-1).astype(np.uint8)


def stl(vertices: Any = TETRAHEDRON, faces: Any = FACES, *, declared: int | None = None) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *vertices[face].reshape(-1), 0) for face in faces)
    return b"test".ljust(80, b"\0") + struct.pack("<I", len(faces) if declared is None else declared) + rows


def stl_text(vertices: Any = TETRAHEDRON, faces: Any = FACES) -> bytes:
    lines = ["solid test"]
    for face in faces:
        lines += ["facet normal 0 0 0", " outer loop", *("  vertex {} {} {}".format(*vertices[n]) for n in face)]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid test", ""]).encode()


def obj(vertices: Any = TETRAHEDRON, faces: Any = FACES) -> bytes:
    rows = ["v {} {} {}".format(*row) for row in vertices] + ["f {} {} {}".format(*(face + 1)) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def document(**changes: Any) -> tuple[dict[str, Any], bytes]:
    """Return a glTF document of the tetrahedron and its binary data; `changes` replace sections."""
    uvs = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], "<f4")
    columns = [TETRAHEDRON.astype("<f4"), FACES.astype("<u2").reshape(-1), uvs]
    image = png(picture())
    body, views = b"", []
    for data in (*(column.tobytes() for column in columns), image):
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)})
        body += data + b"\0" * (-len(data) % 4)
    found = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    return {**found, **changes}, body


def glb(declared: dict[str, Any] | None = None, body: bytes | None = None) -> bytes:
    plain, own = document()
    text = json.dumps(declared or plain).encode()
    text, body = text + b" " * (-len(text) % 4), own if body is None else body
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
