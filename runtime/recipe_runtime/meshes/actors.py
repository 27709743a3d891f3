"""An actor's body: its rigid parts, each in its own frame."""

from recipe_compiler.plan import ActorPlan

from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.pedestrian import pedestrian_parts
from recipe_runtime.meshes.skeleton import has_rider, is_person
from recipe_runtime.meshes.twowheeler import twowheeler_parts
from recipe_runtime.meshes.vehicle import vehicle_parts


def actor_body(actor: ActorPlan) -> Body:
    """The body of a pedestrian or vehicle; its base part, first, has its origin on the ground and looks along +x."""
    if is_person(actor.shape):
        parts = pedestrian_parts
    else:
        parts = twowheeler_parts if has_rider(actor.shape) else vehicle_parts
    return Body(actor.name, actor.tag * 1000 + actor.instance, parts(actor))
