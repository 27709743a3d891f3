"""The patches of an appearance on the device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from recipe_compiler.ir.patches import STATIC, PatchFace, PatchPlan
from recipe_compiler.ir.plan import TexturePlan

from recipe_runtime.render.device.arrays import DeviceArray, set_fields, struct_array
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.patches.patch_kernels import PatchArrays
from recipe_runtime.render.scene.geometry import Geometry
from recipe_runtime.render.texture.surface_colours import linear_colour

_RADIANCE = 3.141592653589793 / 11000.0  # radiance of 1 cd/m2 of white, in the units of `air`
_COAT = 0.05  # reflectance at normal incidence of a glossy patch, like varnish


def no_patches(device: str) -> DeviceArray:
    """Return a one-element array of `PatchArrays` without patches."""
    return struct_array([PatchArrays()], device)


def texture_of(patch: PatchPlan, frame: int) -> TexturePlan | None:
    """Return the image that a patch shows in a frame; None for a colour."""
    file = patch.shown.at(frame)
    return None if file is None else TexturePlan(file=file)


def patch_structs(
    geometry: Geometry, patches: Sequence[PatchPlan], numbers: Mapping[TexturePlan, int], frame: int, device: str
) -> DeviceArray:
    """Return the patches of an appearance in a frame, a one-element array of `PatchArrays`.

    Args:
        geometry: The bodies.
        patches: The patches; each covers those before it.
        numbers: Index of each image in the appearance's atlas.
        frame: The frame's number.
        device: The Warp device.
    """
    columns: dict[object, dict[str, object]] = {
        wp.int32: {**_by_surface(geometry, patches), **_integers(geometry, patches, numbers, frame)},
        wp.float32: _scalars(patches),
        wp.vec3f: _vectors(patches),
        wp.vec4f: {"region": [_extent(face) for patch in patches for face in patch.faces]},
    }
    arrays: dict[str, DeviceArray] = {
        name: wp.array(np.array(values, np.int32 if kind is wp.int32 else np.float32), dtype=kind, device=device)
        for kind, fields in columns.items()
        for name, values in fields.items()
    }
    g = geometry
    mesh = {"triangles": g.triangles, "vertex_part": g.vertex_part, "face_normals": g.face_normals}
    return struct_array([set_fields(PatchArrays(), count=len(patches), **mesh, **arrays)], device)


def patch_shapes(geometry: Geometry, patches: Sequence[PatchPlan], device: str) -> DeviceArray:
    """Return patches without their images, a one-element array of `PatchArrays`, for `draw_patch_numbers`."""
    images = (texture_of(patch, 0) for patch in patches)
    return patch_structs(geometry, patches, {image: -1 for image in images if image is not None}, 0, device)


def _by_surface(geometry: Geometry, patches: Sequence[PatchPlan]) -> dict[str, object]:
    """Return the patches on each surface, from the lowest to the topmost."""
    entries = [
        [k for k, p in enumerate(patches) if key.body == p.body and (not p.slots or key.slot in p.slots)]
        for key in geometry.surfaces
    ]
    return {"first_entry": np.cumsum([0, *map(len, entries)]), "entries": [k for found in entries for k in found]}


def _integers(
    geometry: Geometry, patches: Sequence[PatchPlan], numbers: Mapping[TexturePlan, int], frame: int
) -> dict[str, object]:
    textures = [texture_of(patch, frame) for patch in patches]
    return {
        "first_face": np.cumsum([0, *(len(patch.faces) for patch in patches)]),
        "whole": [patch.whole for patch in patches],
        "image": [-1 if texture is None else numbers[texture] for texture in textures],
        "part": [_part_number(geometry, patch.body, face.part) for patch in patches for face in patch.faces],
    }


def _scalars(patches: Sequence[PatchPlan]) -> dict[str, object]:
    return {
        "emission": [patch.emission * _RADIANCE for patch in patches],
        "coat": [_COAT if patch.gloss > 0.0 else 0.0 for patch in patches],
        "gloss": [patch.gloss for patch in patches],
        "reach": [face.reach for patch in patches for face in patch.faces],
    }


def _vectors(patches: Sequence[PatchPlan]) -> dict[str, object]:
    faces = [face for patch in patches for face in patch.faces]
    return {
        "colour": [linear_colour(patch.shown.colour or "#ffffff") for patch in patches],
        "corner": [face.corner for face in faces],
        "right": [_by_length(face.right, face.width) for face in faces],
        "down": [_by_length(face.down, face.height) for face in faces],
        "normal": [face.normal for face in faces],
    }


def _part_number(geometry: Geometry, body: str, part: str) -> int:
    """Return 0 for the world, 1 + p for part p of the Trace; -1 if the body has no such part."""
    if part == STATIC:
        return 0
    for actor in geometry.actors:
        if actor.name == body and part in actor.part_names:
            return 1 + actor.first_part + actor.part_names.index(part)
    return -1


def _by_length(direction: tuple[float, float, float], length: float) -> list[float]:
    return [v / length for v in direction]


def _extent(face: PatchFace) -> tuple[float, float, float, float]:
    left, top, right, bottom = face.region
    return left, top, right - left, bottom - top
