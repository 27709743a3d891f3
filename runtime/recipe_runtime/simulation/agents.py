"""Creates the agents of a scene, one per actor."""

from __future__ import annotations

from recipe_compiler.ir.plan import ActorPlan, ScenePlan

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.pedestrian import PedestrianAgent
from recipe_runtime.simulation.traffic.driver import Driver
from recipe_runtime.simulation.traffic.junctions import JunctionControl
from recipe_runtime.simulation.traffic.road_map import RoadMap
from recipe_runtime.simulation.traffic.standing_props import standing_props
from recipe_runtime.simulation.vehicle import create_vehicle
from recipe_runtime.simulation.walking.surroundings import Surroundings


def create_agents(world: World, scene: ScenePlan, control_dt: float) -> tuple[list[Agent], JunctionControl]:
    """Add all actors of a scene to the world.

    Args:
        world: Without actors.
        scene: The plan.
        control_dt: Seconds between two calls of `Agent.control`.

    Returns:
        The agents, in plan order, and what controls the junctions that their drivers use.
    """
    road_map = RoadMap(scene.town)
    junctions = JunctionControl(road_map)
    props = standing_props(scene.props, world.ground)
    surroundings = Surroundings(scene, world.ground, road_map)

    def create(actor: ActorPlan) -> Agent:
        if actor.category == "pedestrian":
            return PedestrianAgent(world, actor, control_dt, surroundings)
        return create_vehicle(world, actor, control_dt, Driver(actor, road_map, junctions, props))

    agents = [create(actor) for actor in scene.actors]
    walkers = {agent.actor.name: agent for agent in agents if isinstance(agent, PedestrianAgent)}
    for walker in walkers.values():
        leader = walkers.get(walker.actor.companion or "")
        if leader is not None and leader is not walker:
            walker.walk_beside(leader)
    return agents, junctions
