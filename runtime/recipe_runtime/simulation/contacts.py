"""Records contacts between bodies as events (names, time and impulse), and notifies the agents."""

from __future__ import annotations

from collections.abc import Sequence

from recipe_runtime.core.trace import ContactEvent
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.bullet import World

_SEPARATE = 0.5  # seconds without contact that end an event


class ContactRecorder:
    """Collects the contacts of every step, and notifies the agents."""

    def __init__(self, world: World, agents: Sequence[Agent]) -> None:
        self._world = world
        self._agents = {agent.body: agent for agent in agents}
        self._open: dict[tuple[int, int], ContactEvent] = {}
        self._closed: list[ContactEvent] = []
        self._gap = int(_SEPARATE / world.dt)

    def record(self, step: int) -> None:
        """Add the contacts of the last step.

        Args:
            step: Number of the step, since frame 0.
        """
        impulses: dict[tuple[int, int], float] = {}
        for first, second, impulse in self._world.contacts():
            pair = (first, second) if first < second else (second, first)
            impulses[pair] = impulses.get(pair, 0.0) + impulse
        for pair in sorted(impulses):
            self._add(pair, impulses[pair], step)

    def events(self) -> list[ContactEvent]:
        """Return all events so far, in the order of their start."""
        events = [*self._closed, *self._open.values()]
        return sorted(events, key=lambda event: (event.start, event.first, event.second))

    def _add(self, pair: tuple[int, int], impulse: float, step: int) -> None:
        last = self._open.get(pair)
        if last is not None and step - last.end > self._gap:
            self._closed.append(last)
            last = None
        start, so_far = (step, 0.0) if last is None else (last.start, last.impulse)
        first, second = (self._world.names[body] for body in pair)
        self._open[pair] = ContactEvent(first, second, start, step, so_far + impulse)
        bodies = [self._agents.get(body) for body in pair]
        for agent, other in (bodies, bodies[::-1]):
            if agent is not None:
                agent.collide(other, impulse, step * self._world.dt)
