"""Who moves: pedestrians walk and step aside, vehicles drive their lane and brake for what is ahead."""

from __future__ import annotations

from recipe_compiler.plan import ScenePlan

from recipe_runtime.bullet import World
from recipe_runtime.driving import Crossroads, driver
from recipe_runtime.mover import Mover
from recipe_runtime.walking import Walker


def movers(world: World, scene: ScenePlan) -> list[Mover]:
    """All actors, set into the world in plan order."""
    dt, crossroads = 1.0 / scene.clock.physics, Crossroads(scene.town)
    return [
        Walker(world, actor, dt) if actor.category == "pedestrian" else driver(world, actor, dt, crossroads)
        for actor in scene.actors
    ]
