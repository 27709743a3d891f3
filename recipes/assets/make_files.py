"""Makes the files that the recipe beside it brings: a poster, a crate with its planks, a pillar and a cone.

All four come from this code alone, and may be used for anything (CC0). Run it from anywhere; it writes beside itself.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_runtime.core.codecs import png

HERE = Path(__file__).parent
Pixels = NDArray[np.uint8]


def poster() -> Pixels:
    """A low sun over hills and water, 480 x 360, in a chequered frame."""
    height, width = 360, 480
    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    picture = np.zeros((height, width, 3))
    for channel, (top, low) in enumerate(((28, 250), (60, 176), (120, 108))):
        picture[..., channel] = top + (low - top) * np.minimum(y / 210.0, 1.0)
    distance = (x - 300) * (x - 300) + (y - 165) * (y - 165)
    picture[distance < 62.0 * 62.0] = (255, 236, 160)
    for base, rise, step, colour in ((225, 60, 97, (86, 72, 110)), (250, 42, 61, (52, 50, 88))):
        ridge = base - rise * np.abs(((x + base) % (2 * step)) / step - 1.0)
        picture[y > ridge] = colour
    picture[y > 255] = (38, 84, 118)
    glitter = (y > 255) & (((x + 3 * y) % 46) < 22) & ((y % 9) < 3) & (np.abs(x - 300) < 20 + (y - 255))
    picture[glitter] = (252, 214, 140)
    rim = (x < 20) | (y < 20) | (x >= width - 20) | (y >= height - 20)
    squares = ((x // 20 + y // 20) % 2)[..., None] * np.array([215.0, 205.0, 190.0]) + 20.0
    return np.where(rim[..., None], squares, picture).astype(np.uint8)


def planks() -> Pixels:
    """Boards behind a frame with a brace across, 128 x 128."""
    size = 128
    y, x = np.mgrid[0:size, 0:size]
    grain = ((x * 7 + (y // 3) * 13 + (x // 16) * 31) % 23) - 11
    board = (x // 16) * 37 % 29
    tone = 150.0 + grain * 1.3 + board
    tone[(x % 16) == 0] = 70.0
    frame = (x < 14) | (y < 14) | (x >= size - 14) | (y >= size - 14) | (np.abs(x - y) < 9)
    tone[frame] = 188.0 + ((x + y * 3) % 11)[frame]
    edge = (np.abs(x - y) == 9) | (((x == 14) | (x == size - 15)) & (y >= 14) & (y < size - 14))
    edge |= ((y == 14) | (y == size - 15)) & (x >= 14) & (x < size - 14)
    tone[edge] = 62.0
    return (tone[..., None] * np.array([1.0, 0.76, 0.48])).clip(0, 255).astype(np.uint8)


def crate() -> bytes:
    """A cube of one metre, binary glTF: each side shows the planks, which are in the file."""
    corners, normals, uvs, triangles = [], [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal, u = np.zeros(3), np.zeros(3)
            normal[axis], u[(axis + 1) % 3] = sign, sign
            v = np.cross(normal, u)
            if axis == 0:  # so that planks stand upright on all four sides (y is up)
                u, v = -v, u
            at = len(corners)
            for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                place = 0.5 * (normal + s * u + t * v) + np.array([0.0, 0.5, 0.0])
                corners.append(place)
                normals.append(normal)
                uvs.append(((s + 1) / 2, (1 - t) / 2))
            triangles += [(at, at + 1, at + 2), (at, at + 2, at + 3)]
    columns = [
        ("POSITION", np.array(corners, "<f4"), "VEC3", 5126),
        ("NORMAL", np.array(normals, "<f4"), "VEC3", 5126),
        ("TEXCOORD_0", np.array(uvs, "<f4"), "VEC2", 5126),
        ("indices", np.array(triangles, "<u2").reshape(-1), "SCALAR", 5123),
    ]
    body, views, accessors = b"", [], []
    for _, values, kind, component in columns:
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": values.nbytes})
        accessors.append({"bufferView": len(accessors), "componentType": component, "count": len(values), "type": kind})
        body += values.tobytes()
    accessors[0] |= {"min": [-0.5, 0.0, -0.5], "max": [0.5, 1.0, 0.5]}
    picture = png(planks(), 9)
    views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(picture)})
    body += picture
    document = {
        "asset": {"version": "2.0", "generator": "recipes/assets/make_files.py", "copyright": "CC0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "crate"}],
        "meshes": [{"primitives": [{"attributes": {c[0]: i for i, c in enumerate(columns[:3])}, "indices": 3,
                                    "material": 0}]}],
        "materials": [{"name": "planks", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 4, "mimeType": "image/png"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }  # fmt: skip
    return glb(document, body)


def glb(document: dict[str, Any], body: bytes) -> bytes:
    """A binary glTF file of a document and the bytes beside it."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text, body = text + b" " * (-len(text) % 4), body + b"\0" * (-len(body) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def lathe(profile: list[tuple[float, float]], sides: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Corners [N, 3] and triangles of a body of revolution about z; `profile` is radius and height, from below."""
    turns = [exact.sin_cos_deg(360.0 * k / sides) for k in range(sides)]
    corners = [(r * c, r * s, z) for r, z in profile for s, c in turns]
    faces = []
    for row in range(len(profile) - 1):
        for k in range(sides):
            a, b = row * sides + k, row * sides + (k + 1) % sides
            faces += [(a, b, b + sides), (a, b + sides, a + sides)]
    return np.array(corners), np.array(faces)


def pillar() -> str:
    """An advertising pillar, OBJ, y up: a picture goes once around its drum; cap and foot are plain."""
    sides, rows = 32, [(0.55, 0.45), (0.55, 2.45)]
    lines = ["# An advertising pillar, metres, y up. CC0.", "usemtl drum"]
    for r, y in rows:
        for k in range(sides + 1):
            s, c = exact.sin_cos_deg(360.0 * k / sides)
            lines += [f"v {r * s:.5f} {y:.5f} {r * c:.5f}", f"vt {2 * k / sides:.5f} {(y - 0.45) / 2:.5f}"]
            lines.append(f"vn {s:.5f} 0 {c:.5f}")
    for k in range(1, sides + 1):
        a, b, up = k, k + 1, sides + 1
        lines.append("f " + " ".join(f"{n}/{n}/{n}" for n in (a, b, b + up, a + up)))
    profile = [(0.62, 0.0), (0.62, 0.4), (0.55, 0.45), (0.55, 2.45), (0.68, 2.45), (0.68, 2.6), (0.3, 2.9), (0.02, 3.2)]
    start = 2 * (sides + 1)
    for piece in (profile[:3], profile[3:]):
        corners, faces = lathe(piece, sides)
        lines += ["usemtl stone", *(f"v {y:.5f} {z:.5f} {x:.5f}" for x, y, z in corners)]
        lines += ["f " + " ".join(str(n + 1 + start) for n in face) for face in faces]
        start += len(corners)
    return "\n".join(lines) + "\n"


def cone() -> bytes:
    """A traffic cone, binary STL, z up, in centimetres."""
    corners, faces = lathe([(20, 0), (20, 3), (15, 3), (3, 70), (0, 70)], 24)
    out = b"A traffic cone, centimetres. CC0.".ljust(80) + struct.pack("<I", len(faces))
    for face in faces:
        out += struct.pack("<12fH", 0.0, 0.0, 0.0, *corners[face].reshape(-1), 0)
    return out


def main() -> None:
    """Write the files."""
    (HERE / "poster.png").write_bytes(png(poster(), 9))
    (HERE / "crate.glb").write_bytes(crate())
    (HERE / "pillar.obj").write_text(pillar())
    (HERE / "cone.stl").write_bytes(cone())


if __name__ == "__main__":
    main()
