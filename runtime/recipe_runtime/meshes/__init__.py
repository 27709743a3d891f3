"""Geometry: the triangles of towns, props, vehicles and pedestrians."""

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.mesh import Body
from recipe_runtime.meshes.props import prop_body
from recipe_runtime.meshes.town import town_bodies

__all__ = ["actor_body", "scene_bodies", "town_bodies"]


def scene_bodies(scene: ScenePlan, assets: Assets) -> list[Body]:
    """All bodies of a scene: the town's and the props', which stand still, then the actors' in plan order."""
    still = [*town_bodies(scene.town), *(prop_body(prop, assets) for prop in scene.props)]
    return [*still, *(actor_body(actor) for actor in scene.actors)]
