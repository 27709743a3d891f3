"""Pictures of texture maps, to paint on: where each triangle of a body finds its colour, with the names of the islands.

They are drawn with Pillow, whose fonts may change; no digest covers them.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir.patches import PatchFace

from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.skin import split_parts
from recipe_runtime.meshes.vectors import cross, unit

_LONGEST = 2048  # pixels
_PAPER, _FRAME, _EDGE, _INK = (208, 208, 204), (150, 150, 146), (196, 200, 206), (90, 92, 98)
_FILL = (255, 255, 255)

Island = tuple[str, PatchFace]


def texture_map(islands: Sequence[Island], aspect: float, body: Body, slots: Sequence[str]) -> bytes:
    """Return a PNG of a texture map: its triangles in white, so that windows and wheels are left out.

    Args:
        islands: the islands of the map, with their names.
        aspect: its width by its height.
        body: the body that it covers, whose parts are at rest.
        slots: the slots of the body that it covers; none: all.
    """
    size = map_size(aspect)
    page = Image.new("RGB", size, _PAPER)
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size[0] // 90)
    meshes = dict(split_parts(body.parts))
    for part in dict.fromkeys(face.part for _, face in islands):
        faces = [face for _, face in islands if face.part == part]
        if part in meshes:
            for outline in _triangles(meshes[part], faces, slots, size):
                pen.polygon(outline, fill=_FILL, outline=_EDGE)
    for name, face in islands:
        left, top, right, bottom = (v * size[n % 2] for n, v in enumerate(face.region))
        pen.rectangle((left, top, right - 1, bottom - 1), outline=_FRAME)
        pen.text((left + 4, top + 2), name, fill=_INK, font=font)
    made = io.BytesIO()
    page.save(made, "PNG", optimize=True)
    return made.getvalue()


def map_size(aspect: float) -> tuple[int, int]:
    """Return width and height of the picture of a texture map, pixels."""
    if aspect < 1.0:
        return max(1, round(_LONGEST * aspect)), _LONGEST
    return _LONGEST, max(1, round(_LONGEST / aspect))


def _triangles(
    mesh: Mesh, faces: Sequence[PatchFace], slots: Sequence[str], size: tuple[int, int]
) -> list[list[tuple[float, float]]]:
    """The corners of a part's triangles on the map, in pixels: those farthest from the outside first."""
    here = np.array([not slots or mesh.surfaces[surface].slot in slots for surface in mesh.surface], bool)
    corners = mesh.vertices.astype(np.float64)[mesh.triangles[here]]
    normals = unit(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    turned = np.stack([along(normals, face.normal) for face in faces])
    chosen = turned.argmax(axis=0)
    found: list[tuple[float, list[tuple[float, float]]]] = []
    for number, face in enumerate(faces):
        own = corners[chosen == number]
        offset = own - np.array(face.corner)
        u, v = (along(offset, d) / n for d, n in ((face.right, face.width), (face.down, face.height)))
        left, top, right, bottom = face.region
        x = (left + np.clip(u, 0.0, 1.0) * (right - left)) * size[0]
        y = (top + np.clip(v, 0.0, 1.0) * (bottom - top)) * size[1]
        depth = along(offset, face.normal).mean(axis=1)
        found += [
            (float(d), list(zip(a.tolist(), b.tolist(), strict=True))) for d, a, b in zip(depth, x, y, strict=True)
        ]
    return [outline for _, outline in sorted(found, key=lambda one: one[0])]


def along(vectors: NDArray[np.float64], axis: Sequence[float]) -> NDArray[np.float64]:
    """Return the products of vectors [..., 3] with one."""
    product: NDArray[np.float64] = vectors[..., 0] * axis[0] + vectors[..., 1] * axis[1] + vectors[..., 2] * axis[2]
    return product
