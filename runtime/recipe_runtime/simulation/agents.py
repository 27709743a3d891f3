"""Who moves: pedestrians walk and step aside, vehicles drive their lane and brake for what is ahead."""

from __future__ import annotations

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.simulation.agent import Mover
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.pedestrian import Walker
from recipe_runtime.simulation.vehicle import Crossroads, driver


def movers(world: World, scene: ScenePlan) -> list[Mover]:
    """All actors, set into the world in plan order."""
    dt, crossroads = 1.0 / scene.clock.physics, Crossroads(scene.town)
    return [
        Walker(world, actor, dt) if actor.category == "pedestrian" else driver(world, actor, dt, crossroads)
        for actor in scene.actors
    ]
