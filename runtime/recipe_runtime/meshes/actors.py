"""Bodies of actors: rigid parts, each in its own frame, and the skins of people."""

from collections.abc import Mapping
from functools import lru_cache

from recipe_compiler.ir.plan import ActorPlan

from recipe_runtime.body.skeleton import has_rider, is_parked, is_person
from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.person.people import pedestrian_parts
from recipe_runtime.meshes.twowheeler import twowheeler_parts
from recipe_runtime.meshes.vehicle import vehicle_parts

SHAPES_CACHE_SIZE = 256  # number of cached shapes, about 300 kB each


def actor_body(actor: ActorPlan) -> Body:
    """Return the body of a pedestrian or vehicle.

    The base part comes first; its origin is on the ground and +x points forward. Actors of the same shape share their
    meshes, whose arrays are read-only.
    """
    lit = is_person(actor.shape) or not is_parked(actor)
    return Body(actor.name, actor.tag * 1000 + actor.instance, shape_parts(actor.shape, actor.tag, lit))


def shape_parts(shape: Mapping[str, float], tag: int, lit: bool = True) -> tuple[tuple[str, Mesh], ...]:
    """Return the parts of a shape, the base part first; `lit`: whether a vehicle's lamps can be lit."""
    return _parts(tuple(sorted(shape.items())), tag, lit)


@lru_cache(maxsize=SHAPES_CACHE_SIZE)
def _parts(sorted_shape: tuple[tuple[str, float], ...], tag: int, lit: bool) -> tuple[tuple[str, Mesh], ...]:
    """Build the parts of a shape. All values that a mesh depends on are arguments, because the result is cached."""
    shape = dict(sorted_shape)
    if is_person(shape):
        parts = pedestrian_parts(shape, tag)
    elif has_rider(shape):
        parts = twowheeler_parts(shape, tag)
    else:
        parts = vehicle_parts(shape, tag, lit)
    for _, mesh in parts:
        skin = () if mesh.skin is None else (mesh.skin.parts, mesh.skin.weights, mesh.skin.origins)
        for array in (mesh.vertices, mesh.normals, mesh.uvs, mesh.triangles, mesh.surface, *skin):
            array.flags.writeable = False
    return parts
