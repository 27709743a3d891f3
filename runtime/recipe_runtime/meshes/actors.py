"""Bodies of actors: rigid parts, each in its own frame, and the skins of people."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

from recipe_compiler.ir.assets import AssetError
from recipe_compiler.ir.errors import Code, InputError, RunError
from recipe_compiler.ir.plan import ActorPlan
from recipe_compiler.ir.plan_bounds import MAX_PROP_TRIANGLES

from recipe_runtime.body.skeleton import has_rider, is_parked, is_person
from recipe_runtime.core.asset_files import Assets
from recipe_runtime.meshes.mesh import Body, Mesh
from recipe_runtime.meshes.own_actors import own_parts
from recipe_runtime.meshes.person.people import pedestrian_parts
from recipe_runtime.meshes.twowheeler import twowheeler_parts
from recipe_runtime.meshes.vehicle import vehicle_parts

SHAPES_CACHE_SIZE = 256  # number of cached shapes, about 300 kB each


def actor_bodies(actors: Sequence[ActorPlan], assets: Assets) -> list[Body]:
    """Return the bodies of actors, in order; each file is read once.

    Raises:
        InputError: The bodies from files have more triangles than the limit: the plan may be untrusted.
        RunError: A file is missing, or is not the plan's.
    """
    found: list[Body] = []
    known: dict[str, tuple[tuple[str, Mesh], ...]] = {}
    triangles = 0
    for actor in actors:
        if actor.mesh is None:
            found.append(actor_body(actor))
            continue
        key = actor.model_dump_json(include={"mesh", "shape", "tag"})
        if key not in known:
            try:
                known[key] = own_parts(actor, assets.body(actor.mesh.file))
            except AssetError as error:
                raise RunError(f"{actor.name}: {error}") from None
        triangles += sum(len(mesh.triangles) for _, mesh in known[key])
        if triangles > MAX_PROP_TRIANGLES:
            raise InputError(
                f"{actor.name}: {triangles:,} triangles of bodies up to here exceed {MAX_PROP_TRIANGLES:,}",
                help="use fewer actors, or simpler files",
                code=Code.INPUT_LIMIT,
            )
        found.append(Body(actor.name, actor.tag * 1000 + actor.instance, known[key]))
    return found


def actor_body(actor: ActorPlan) -> Body:
    """Return the body of a pedestrian or vehicle of the library.

    The base part comes first; its origin is on the ground and +x points forward. Actors of the same shape share their
    meshes, whose arrays are read-only.

    Raises:
        ValueError: The body is in a file: `actor_bodies` reads it.
    """
    if actor.mesh is not None:
        raise ValueError(f"the body of {actor.name} is in a file")
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
