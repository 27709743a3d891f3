"""Vehicles that leave the scene at the end of their route and enter it again."""

from __future__ import annotations

from collections.abc import Iterable

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.neighbours import NeighbourGrid
from recipe_runtime.simulation.vehicle import VehicleAgent

_AHEAD, _BEHIND, _ASIDE = 40.0, 25.0, 1.5  # metres that must be free: ahead, behind, and at both sides of a vehicle


def exchange(agents: Iterable[Agent], neighbours: NeighbourGrid) -> None:
    """Remove the vehicles that have arrived, and admit those whose entry is free, in plan order.

    Args:
        agents: All agents.
        neighbours: Those that are present.
    """
    entered: list[VehicleAgent] = []
    for agent in agents:
        if not isinstance(agent, VehicleAgent) or agent.actor.entry is None:
            continue
        if agent.present and agent.arrived:
            agent.leave()
        elif not agent.present:
            entry = agent.actor.entry
            others = [*neighbours.within(entry.x, entry.y, _AHEAD + 10.0), *entered]
            if all(_clear(entry, agent, other) for other in others):
                agent.enter(entry, agent.actor.speed)
                entered.append(agent)


def _clear(entry: Pose, agent: VehicleAgent, other: Agent) -> bool:
    sine, cosine = exact.sin_cos_deg(entry.yaw)
    dx, dy = other.x - entry.x, other.y - entry.y
    ahead, aside = dx * cosine + dy * sine, dy * cosine - dx * sine
    room = agent.reach + other.reach
    return not (-_BEHIND - room < ahead < _AHEAD + room and abs(aside) < agent.radius + other.radius + _ASIDE)
