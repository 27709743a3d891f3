"""A driver who keeps behind others and takes turns at junctions."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir.plan import TownPlan

from recipe_runtime.body.skeleton import is_person
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.command import Command
from recipe_runtime.simulation.vehicle import VehicleAgent

_ACCELERATION, _BRAKING = 2.0, 3.0  # m/s2


class JunctionReservations:
    """Right of way: a junction is reserved for one vehicle at a time, first come, first served."""

    def __init__(self, town: TownPlan) -> None:
        reach = 4.5  # from the junction's edge to the waiting position, clear of a turning bus
        self._areas = [
            (e.pose.x, e.pose.y, e.size[0] / 2 + reach, e.size[1] / 2 + reach)
            for e in town.elements
            if e.kind == "junction"
        ]
        self._holders: dict[int, VehicleAgent] = {}

    def distance_to_stop_line(self, vehicle: VehicleAgent) -> float:
        """Return the metres to the stop line where a vehicle must wait, infinity if it need not.

        Reserves free junctions that are within the vehicle's stopping distance.
        """
        way = math.inf
        for n, (x, y, half_x, half_y) in enumerate(self._areas):
            dx, dy = x - vehicle.x, y - vehicle.y
            mine = self._holders.get(n) is vehicle
            if abs(dx) > half_x + 60.0 or abs(dy) > half_y + 60.0:
                continue
            ahead = dx * vehicle.heading[0] + dy * vehicle.heading[1]
            aside = abs(dx * vehicle.heading[1] - dy * vehicle.heading[0])
            half = half_x if abs(vehicle.heading[0]) > abs(vehicle.heading[1]) else half_y
            line = ahead - half - vehicle.reach
            inside = abs(dx) < half_x and abs(dy) < half_y
            leaving = max(abs(dx) - half_x, abs(dy) - half_y) > vehicle.reach - 1.0 and ahead < 0.0
            if mine and (leaving or vehicle.arrived):
                del self._holders[n]
            elif inside and not vehicle.arrived:
                self._holders.setdefault(n, vehicle)
            elif not mine and -1.0 < line < vehicle.speed * vehicle.speed / 4.0 + 3.0 and aside < 4.0:
                owner = self._holders.setdefault(n, vehicle)
                way = way if owner is vehicle else min(way, max(0.0, line))
        return way


class SimpleDriver:
    """Decides for one vehicle."""

    def __init__(self, junctions: JunctionReservations) -> None:
        self._junctions = junctions

    def decide(self, vehicle: VehicleAgent, neighbours: Sequence[Agent], seconds: float) -> Command:
        """Return the acceleration towards the highest safe speed."""
        way = self._junctions.distance_to_stop_line(vehicle)
        vehicle.waiting = way < 60.0
        wish = min(_following_speed(vehicle, neighbours), math.sqrt(4.0 * min(way, 1e6)))
        return Command(max(-1.6 * _BRAKING, min(_ACCELERATION, (wish - vehicle.speed) / 0.1)))


def _following_speed(vehicle: VehicleAgent, others: Sequence[Agent]) -> float:
    """Return the highest speed from which it can stop behind every agent in its path."""
    wish = vehicle.actor.speed
    (hx, hy), curvature = vehicle.heading, vehicle.curvature
    for other in others:
        dx, dy = other.x - vehicle.x, other.y - vehicle.y
        if abs(dx) > 40.0 or abs(dy) > 40.0:
            continue
        gap = dx * hx + dy * hy
        bend = 0.5 * curvature * gap * gap if abs(gap) < 6 else 0.0
        side = hx * dy - hy * dx - bend
        same = other.heading[0] * hx + other.heading[1] * hy
        if other.waiting and same < 0.5:
            continue  # it stands at a stop line until this one has passed
        along = abs(same)
        wide = along * other.radius + (1.0 - along) * other.reach
        deep = along * other.reach + (1.0 - along) * other.radius
        if is_person(other.actor.shape):
            side += (other.velocity[1] * hx - other.velocity[0] * hy) * 0.8
            wide += 0.5
        if gap > 0 and abs(side) < vehicle.radius + wide + 0.35:
            free = gap - vehicle.reach - deep - 1.8
            away = max(0.0, other.velocity[0] * hx + other.velocity[1] * hy)
            wish = min(wish, math.sqrt(2.0 * _BRAKING * max(0.0, free) + away * away) if free > 0 else 0.0)
    return wish
