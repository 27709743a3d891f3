"""Normals of the visible surfaces: unit vectors, float32 [H, W, 3], in the camera's optical frame; 0 for the sky.

The optical frame has x right, y down, z forward: a surface that faces the camera has a negative z. The normals are
those of shading: interpolated between a triangle's corners, so that round bodies are round, but without the relief of
surface patterns. They do not depend on weather, light or patches.
"""

# (Without deferred annotations: Warp reads those of the kernel.)
from functools import cache
from typing import TYPE_CHECKING, no_type_check

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.modalities import form_of
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import codecs
from recipe_runtime.modalities.modality import Array, FileForm, Modality

if TYPE_CHECKING:
    from recipe_runtime.render.device.arrays import DeviceArray
    from recipe_runtime.render.raster.surfaces import VisibleSurfaces

NAME = "normals"
_LARGEST = 65535.0  # of 16 bits
_NONE = 32768  # the code of 0


@cache
@no_type_check
def _kernel():
    """Return the kernel. Warp is imported here, because readers of datasets do not need it."""
    from recipe_runtime.render.device.setup import OPTIONS, wp
    from recipe_runtime.render.numeric.vectors import normalize, rotate
    from recipe_runtime.render.raster.distortion_kernels import Distortion, nearest_sample
    from recipe_runtime.render.raster.label_kernels import triangle_of
    from recipe_runtime.render.raster.skin_kernels import blended_normal
    from recipe_runtime.render.sampling.coverage_kernels import CENTRE
    from recipe_runtime.render.sampling.sample_kernels import barycentric_weights, ray_of
    from recipe_runtime.render.scene.pinhole import Pinhole

    wp.set_module_options(OPTIONS)

    @wp.kernel
    def surface_normals(
        keys: wp.array[wp.uint64],
        vertices: wp.array[wp.vec3f],
        normals: wp.array[wp.vec3f],
        vertex_part: wp.array[wp.int32],
        vertex_skin: wp.array[wp.int32],
        skin_parts: wp.array[wp.vec4i],
        skin_weights: wp.array[wp.vec4f],
        triangles: wp.array[wp.vec3i],
        view_from_part: wp.array2d[wp.float32],
        pinhole: Pinhole,
        distortion: Distortion,
        out_normals: wp.array[wp.float32],
    ):
        """Write the unit normal of the surface that each pixel shows."""
        i = wp.tid()
        n = wp.vec3f(0.0, 0.0, 0.0)
        if keys[i] != wp.uint64(0):
            t = triangles[triangle_of(keys[i])]
            ray = ray_of(nearest_sample(i, distortion), CENTRE, pinhole)
            w = barycentric_weights(ray, vertices[t[0]], vertices[t[1]], vertices[t[2]])
            if vertex_skin[t[0]] < 0:
                local = normals[t[0]] * w[0] + normals[t[1]] * w[1] + normals[t[2]] * w[2]
                n = rotate(view_from_part, vertex_part[t[0]], local)
            else:
                for k in range(3):
                    row = vertex_skin[t[k]]
                    n = n + blended_normal(view_from_part, skin_parts[row], skin_weights[row], normals[t[k]]) * w[k]
            n = normalize(n)
        for axis in range(3):
            out_normals[3 * i + axis] = n[axis]

    return surface_normals


def _draw(surfaces: "VisibleSurfaces", out: "DeviceArray") -> None:
    from recipe_runtime.render.device.launch import fields_of, launch

    g = surfaces.geometry
    launch(
        _kernel(),
        surfaces.pixels,
        surfaces.device,
        keys=surfaces.keys,
        vertices=surfaces.vertices,
        normals=g.normals,
        **fields_of(g, "vertex_part", "vertex_skin", "skin_parts", "skin_weights"),
        triangles=g.triangles,
        view_from_part=surfaces.view_from_part,
        pinhole=surfaces.pinhole,
        distortion=surfaces.distortion,
        out_normals=out,
    )


def _to_16_bits(normals: Array) -> NDArray[np.uint16]:
    """Convert components from -1 to 1 to round((n + 1) / 2 * 65535); 0 is 32768."""
    steps = normals.astype(np.float64)
    steps += 1.0
    steps *= _LARGEST / 2.0
    return np.rint(steps).astype(np.uint16)


def _from_16_bits(stored: Array) -> NDArray[np.float32]:
    """The inverse of `_to_16_bits`, within half a step of 2 / 65535; exact for the sky."""
    normals = (stored.astype(np.float64) * (2.0 / _LARGEST) - 1.0).astype(np.float32)
    normals[(stored == _NONE).all(axis=-1)] = 0.0
    return normals


def _picture(normals: Array) -> NDArray[np.uint8]:
    """Map the normals to the usual colours: red to the right, green up, blue to the camera; black for the sky."""
    shown = normals.astype(np.float32) * np.array([1.0, -1.0, -1.0], np.float32)
    colours = np.rint(np.clip((np.nan_to_num(shown) + 1.0) * 127.5, 0.0, 255.0)).astype(np.uint8)
    colours[(normals == 0).all(axis=-1)] = 0
    return colours


_CARD = {
    "png": "16-bit RGB PNG: component = code / 65535 * 2 - 1, and code 32768 is 0",
    "npy": "`.npy`, float32 [H, W, 3]: the values that are hashed. With kwcoco, the same as 16-bit RGB PNG beside each",
}


def _card(dataset: DatasetPlan) -> str:
    text = _CARD[form_of(NAME, dataset.forms).name]
    where = "Unit vectors in the camera's optical frame (x right, y down, z forward), 0 for the sky"
    return f"- normals: {text}. {where}."


MODALITY = Modality(
    name=NAME,
    dtype="float32",
    channels=3,
    files={
        "png": FileForm("uint16", "nx|ny|nz", store=_to_16_bits, load=_from_16_bits, tolerance=1.6e-5),
        "npy": FileForm("float32", "nx|ny|nz", codecs.npy),
    },
    picture=_picture,
    card=_card,
    draw=_draw,
)
