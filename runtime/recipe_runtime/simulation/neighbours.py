"""Finds the agents near a position with a uniform grid."""

from __future__ import annotations

from collections.abc import Iterable

from recipe_runtime.simulation.agent import Agent

_CELL = 40.0  # metres
_CROWD = 8  # agents that can be tested in the time of looking up a cell
_Entry = tuple[int, float, float, Agent]  # number in the plan, x, y


class NeighbourGrid:
    """Agents that are present, by the square cell of the ground in which each is at the time of creation."""

    def __init__(self, agents: Iterable[Agent]) -> None:
        self._all: list[_Entry] = []
        self._cells: dict[tuple[int, int], list[_Entry]] = {}
        for number, agent in enumerate(agents):
            if agent.present:
                key = int(agent.x // _CELL), int(agent.y // _CELL)
                entry = (number, agent.x, agent.y, agent)
                self._all.append(entry)
                self._cells.setdefault(key, []).append(entry)

    def within(self, x: float, y: float, distance: float) -> list[Agent]:
        """Return the agents whose x and y differ from a position by at most a distance (metres), in plan order."""
        left, right, low, high = x - distance, x + distance, y - distance, y + distance
        columns = range(int(left // _CELL), int(right // _CELL) + 1)
        rows = range(int(low // _CELL), int(high // _CELL) + 1)
        if len(self._all) < _CROWD * len(columns) * len(rows):  # to look at everybody is faster
            return [e[3] for e in self._all if left <= e[1] <= right and low <= e[2] <= high]
        found: list[_Entry] = []
        for i in columns:
            for j in rows:
                if cell := self._cells.get((i, j)):
                    found += [e for e in cell if left <= e[1] <= right and low <= e[2] <= high]
        found.sort()  # by number, which is unique
        return [entry[3] for entry in found]

    def around(self, agent: Agent) -> list[Agent]:
        """Return the other agents within an agent's sight, in plan order."""
        return [other for other in self.within(agent.x, agent.y, agent.sight) if other is not agent]
