"""The simulation of a scene, step by step.

Time is counted in physics steps from the beginning of the warm-up. Agents read their bodies and control them thirty
times a second, and decide ten times a second, whatever the frame rate.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.core.trace import ContactEvent
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.agents import create_agents
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.contacts import ContactRecorder
from recipe_runtime.simulation.neighbours import NeighbourGrid
from recipe_runtime.simulation.recording import FrameRecorder
from recipe_runtime.simulation.traffic import through_traffic

CONTROL_RATE, DECISION_RATE = 30, 10  # times a second


class Simulation:
    """A scene that is simulated step by step.

    Attributes:
        world: The bodies.
        agents: In plan order.
        contacts: The contacts so far.
        step: Physics steps since the beginning of the warm-up.
    """

    def __init__(self, scene: ScenePlan) -> None:
        clock = scene.clock
        self._warmup = clock.warmup_steps
        self._control = max(1, clock.physics // CONTROL_RATE)  # steps
        self._decision = self._control * max(1, clock.physics // (DECISION_RATE * self._control))
        self.world = World(scene.town, clock.physics, scene.props)
        control_dt = self._control * self.world.dt
        self.agents, self._junctions = create_agents(self.world, scene, control_dt)
        self.contacts = ContactRecorder(self.world, self.agents)
        self.step = 0
        if self._warmup == 0:  # everybody starts from rest
            for agent in self.agents:
                agent.held = False

    @property
    def seconds(self) -> float:
        """Time since frame 0; negative during the warm-up."""
        return (self.step - self._warmup) * self.world.dt

    def agents_now(self) -> Sequence[Agent]:
        """The agents in their state at this step.

        Between two calls of `Agent.control` these are copies, so that recording frames does not affect the simulation.
        """
        since = self.step % self._control
        if since == 0:
            return self.agents
        copies = [copy.copy(agent) for agent in self.agents]
        for agent in copies:
            agent.read(since * self.world.dt)
        return copies

    def advance(self) -> None:
        """Simulate one step."""
        if self.step % self._decision == 0:
            self._decide()
        if self.step % self._control == 0:
            for agent in self.agents:
                if agent.present:
                    agent.control()
        self.world.step()
        self.contacts.record(self.step - self._warmup)
        self.step += 1
        if self.step % self._control == 0:
            for agent in self.agents:
                agent.read(self._control * self.world.dt)
        if self.step == self._warmup:
            for agent in self.agents:
                if agent.held:
                    agent.start_moving()

    def close(self) -> None:
        """Close the physics engine."""
        self.world.close()

    def _decide(self) -> None:
        self._junctions.update(self.agents, self.seconds)
        neighbours = NeighbourGrid(self.agents)
        for agent in self.agents:
            if agent.present:
                agent.decide(neighbours.around(agent), self.seconds)
        through_traffic.exchange(self.agents, neighbours)


def run(scene: ScenePlan, take: Callable[[int, bytes], None], report: Callable[[int, int], None]) -> list[ContactEvent]:
    """Simulate a scene.

    Args:
        scene: The plan.
        take: Called with each frame's number and bytes.
        report: Called with the steps done and the total number of steps, once a frame.

    Returns:
        Contacts between bodies.
    """
    clock = scene.clock
    simulation = Simulation(scene)
    recorder = FrameRecorder(simulation.agents, simulation.world.ground)
    steps = clock.warmup_steps + (clock.frames - 1) * clock.steps_per_frame
    while True:
        frame, rest = divmod(simulation.step - clock.warmup_steps, clock.steps_per_frame)
        if rest == 0:
            if frame >= 0:
                recorder.add(simulation.agents_now())
            if recorder.full or simulation.step == steps:
                for number, data in recorder.frames():
                    take(number, data)
            report(simulation.step, steps)
        if simulation.step == steps:
            break
        simulation.advance()
    simulation.close()
    return simulation.contacts.events()
