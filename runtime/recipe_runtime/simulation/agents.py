"""Creates the agents of a scene, one per actor."""

from __future__ import annotations

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.pedestrian import PedestrianAgent
from recipe_runtime.simulation.vehicle import JunctionReservations, create_vehicle


def create_agents(world: World, scene: ScenePlan) -> list[Agent]:
    """Add all actors of a scene to the world and return their agents, in plan order."""
    dt, junctions = 1.0 / scene.clock.physics, JunctionReservations(scene.town)
    return [
        PedestrianAgent(world, actor, dt)
        if actor.category == "pedestrian"
        else create_vehicle(world, actor, dt, junctions)
        for actor in scene.actors
    ]
