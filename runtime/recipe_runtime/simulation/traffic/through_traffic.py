"""Vehicles that leave the scene at the end of their route and enter it again.

A vehicle enters at the greatest speed, up to its desired one, at which it need not brake noticeably for the vehicles
ahead in its lane, or on their way into it. If that speed is too low for the road, it waits.
"""

from __future__ import annotations

from collections.abc import Iterable

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose

from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.neighbours import NeighbourGrid
from recipe_runtime.simulation.traffic.following import Style, following_acceleration, free_acceleration
from recipe_runtime.simulation.traffic.lane_change import band
from recipe_runtime.simulation.vehicle import VehicleAgent

_SIGHT, _BEHIND, _ASIDE = 200.0, 25.0, 1.5  # metres: considered ahead, free behind, and free at both sides of a vehicle
_BRAKING = 1.0  # m/s2, the hardest braking on entry
_LEAST = 0.8  # share of the desired speed below which a vehicle waits
_STEPS = 12  # halvings of the interval in which the speed on entry is searched


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
            entry = agent.entry
            others = [*neighbours.within(entry.x, entry.y, _SIGHT), *entered]
            speed = _speed_on_entry(entry, agent, others)
            if speed > 0.0:
                agent.enter(entry, speed)
                entered.append(agent)


def _speed_on_entry(entry: Pose, agent: VehicleAgent, others: Iterable[Agent]) -> float:
    """Return the speed at which a vehicle can enter, m/s; 0 if it has to wait."""
    desired, style = agent.driver.desired, agent.driver.style
    speed = desired
    sine, cosine = exact.sin_cos_deg(entry.yaw)
    for other in others:
        dx, dy = other.x - entry.x, other.y - entry.y
        ahead, aside = dx * cosine + dy * sine, dy * cosine - dx * sine
        right, left = band(other, aside)
        free = agent.radius + _ASIDE
        gap = abs(ahead) - agent.reach - other.reach
        if right > free or left < -free or (ahead < 0.0 and gap > _BEHIND):
            continue
        if ahead < 0.0 or gap <= 0.0:
            return 0.0
        velocity = other.velocity[0] * cosine + other.velocity[1] * sine
        speed = min(speed, speed_behind(gap, max(0.0, velocity), desired, style))
    return speed if speed >= _LEAST * desired else 0.0


def speed_behind(gap: float, leader_speed: float, desired: float, style: Style) -> float:
    """Return the greatest speed at which a vehicle behind a leader brakes by at most `_BRAKING`.

    Args:
        gap: Metres from its front to the leader.
        leader_speed: m/s.
        desired: Its desired speed, which the result does not exceed, m/s.
        style: Its parameters of car following.
    """

    def permitted(speed: float) -> bool:
        free = free_acceleration(speed, desired, style)
        return following_acceleration(speed, free, gap, leader_speed, style, style.gap) >= -_BRAKING

    if permitted(desired):
        return desired
    low, high = 0.0, desired
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if permitted(middle) else (low, middle)
    return low
