"""The arrays of a frame's samples."""

from __future__ import annotations

from recipe_runtime.render.device.arrays import DeviceArray, set_fields
from recipe_runtime.render.device.launch import fields_of
from recipe_runtime.render.device.setup import wp
from recipe_runtime.render.sampling.coverage_kernels import SceneArrays
from recipe_runtime.render.sampling.sample_kernels import Samples
from recipe_runtime.render.scene.geometry import Geometry

_KINDS = {
    "keys": wp.uint64,
    "pixels": wp.int32,
    "places": wp.int32,
    "weights": wp.float32,
    "tiles": wp.int32,
    "surfaces": wp.int32,
    "codes": wp.uint32,
    "positions": wp.vec3f,
    "normals": wp.vec3f,
    "details": wp.vec4f,
    "puddle_depths": wp.float32,
}
EVALUATED = ("surfaces", "positions", "normals", "details", "codes", "puddle_depths")  # from the others


class SampleColumns:
    """Arrays with one element per sample, for `capacity` samples."""

    keys: DeviceArray  # uint64, visibility key
    pixels: DeviceArray  # int32, index of the pixel
    places: DeviceArray  # int32, row of the pixel's sample, or ROWS for the centre
    weights: DeviceArray  # float32, share of the pixel
    tiles: DeviceArray  # int32
    surfaces: DeviceArray  # int32, -1 for the sky
    codes: DeviceArray  # uint32
    positions: DeviceArray  # vec3f, world position in metres; for the sky a direction
    normals: DeviceArray  # vec3f
    details: DeviceArray  # vec4f: fields of `Detail`; with an image, coordinates and the longer step
    puddle_depths: DeviceArray  # float32, see `Samples`

    def __init__(self, capacity: int, device: str) -> None:
        self.capacity = capacity
        for name, kind in _KINDS.items():
            setattr(self, name, wp.empty(capacity, dtype=kind, device=device))

    def grown(self, capacity: int, count: int, device: str) -> SampleColumns:
        """Return columns of another capacity, with the first `count` samples of these."""
        wider = SampleColumns(capacity, device)
        for name in _KINDS:
            wp.copy(getattr(wider, name), getattr(self, name), count=count)
        return wider


def samples_of(columns: SampleColumns) -> Samples:
    """Return the struct `Samples` of the columns, for shading; its eye and its transforms are not set."""
    return set_fields(Samples(), **fields_of(columns, *EVALUATED, "pixels", "tiles", "keys"))


def scene_arrays(
    g: Geometry, vertices: DeviceArray, world_from_part: DeviceArray, world_from_view: DeviceArray
) -> SceneArrays:
    """Return the struct `SceneArrays` of a frame: `vertices` vec3f [V] in view space, transforms float32 [N, 12]."""
    return set_fields(
        SceneArrays(),
        view=vertices,
        **fields_of(g, "normals", "uvs", "vertex_part", "vertex_skin", "skin_parts", "skin_weights"),
        **fields_of(g, "triangles", "face_normals", "triangle_surface"),
        surface_pattern=g.surface_pattern,
        world_from_part=world_from_part,
        world_from_view=world_from_view,
    )
