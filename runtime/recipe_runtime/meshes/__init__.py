"""Geometry: the triangles of towns, vehicles and pedestrians."""

from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.town import town_bodies

__all__ = ["actor_body", "town_bodies"]
