"""Geometry: the triangles of towns, props, vehicles and pedestrians."""

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.meshes.actors import actor_bodies, actor_body
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.props import prop_bodies
from recipe_runtime.meshes.town import signal_bodies, town_bodies

__all__ = ["actor_bodies", "actor_body", "scene_bodies", "signal_bodies", "town_bodies"]


def scene_bodies(scene: ScenePlan, assets: Assets) -> list[Body]:
    """Return all bodies of a scene.

    First come the static bodies of the town and the props, then the actors in plan order, then the lamps of traffic
    lights in the order of the town's elements.
    """
    still = [*town_bodies(scene.town), *prop_bodies(scene.props, assets)]
    return [*still, *actor_bodies(scene.actors, assets), *signal_bodies(scene.town)]
