"""Finds the agents near a place by a uniform grid."""

from __future__ import annotations

from collections.abc import Iterable

from recipe_runtime.simulation.agent import Agent

_CELL = 40.0  # metres


class NeighbourGrid:
    """Agents that are present, by the square cell of the ground in which each is at the time of creation."""

    def __init__(self, agents: Iterable[Agent]) -> None:
        self._cells: dict[tuple[int, int], list[tuple[int, Agent]]] = {}
        for number, agent in enumerate(agents):
            if agent.present:
                key = int(agent.x // _CELL), int(agent.y // _CELL)
                self._cells.setdefault(key, []).append((number, agent))

    def within(self, x: float, y: float, distance: float) -> list[Agent]:
        """Return the agents whose x and y differ from a position by at most a distance (metres), in plan order."""
        found: list[tuple[int, Agent]] = []
        columns = range(int((x - distance) // _CELL), int((x + distance) // _CELL) + 1)
        rows = range(int((y - distance) // _CELL), int((y + distance) // _CELL) + 1)
        for i in columns:
            for j in rows:
                found += self._cells.get((i, j), ())
        found.sort(key=_number)
        return [agent for _, agent in found if abs(agent.x - x) <= distance and abs(agent.y - y) <= distance]

    def around(self, agent: Agent) -> list[Agent]:
        """Return the other agents within an agent's sight, in plan order."""
        return [other for other in self.within(agent.x, agent.y, agent.sight) if other is not agent]


def _number(entry: tuple[int, Agent]) -> int:
    return entry[0]
