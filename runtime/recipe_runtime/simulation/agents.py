"""Creates the agents of a scene, one per actor."""

from __future__ import annotations

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.pedestrian import PedestrianAgent
from recipe_runtime.simulation.simple_driver import JunctionReservations, SimpleDriver
from recipe_runtime.simulation.vehicle import create_vehicle


def create_agents(world: World, scene: ScenePlan, control_dt: float) -> list[Agent]:
    """Add all actors of a scene to the world and return their agents, in plan order.

    Args:
        world: Without actors.
        scene: The plan.
        control_dt: Seconds between two calls of `Agent.control`.
    """
    junctions = JunctionReservations(scene.town)
    return [
        PedestrianAgent(world, actor, control_dt)
        if actor.category == "pedestrian"
        else create_vehicle(world, actor, control_dt, SimpleDriver(junctions))
        for actor in scene.actors
    ]
