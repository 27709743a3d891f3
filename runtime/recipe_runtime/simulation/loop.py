"""The simulation of a scene, step by step.

Time is counted in physics steps from the beginning of the warm-up. Agents read their bodies and control them sixty
times a second, and decide ten times a second, whatever the frame rate.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.simulation import through_traffic
from recipe_runtime.simulation.agent import Agent
from recipe_runtime.simulation.agents import create_agents
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.contacts import ContactRecorder
from recipe_runtime.simulation.events import ContactEvent
from recipe_runtime.simulation.neighbours import NeighbourGrid
from recipe_runtime.simulation.recording import record_frame
from recipe_runtime.simulation.traffic.junctions import JunctionControl

CONTROL_RATE, DECISION_RATE = 60, 10  # times a second


def run(scene: ScenePlan, take: Callable[[int, bytes], None], report: Callable[[int, int], None]) -> list[ContactEvent]:
    """Simulate a scene.

    Args:
        scene: The plan.
        take: Called with each frame's number and bytes.
        report: Called with the steps done and the total number of steps, at each frame.

    Returns:
        Contacts between bodies.
    """
    clock = scene.clock
    control = max(1, clock.physics // CONTROL_RATE)  # steps
    decision = control * max(1, clock.physics // (DECISION_RATE * control))
    world = World(scene.town, clock.physics, scene.props)
    agents, junctions = create_agents(world, scene, control * world.dt)
    contacts = ContactRecorder(world, agents)
    steps = clock.warmup_steps + (clock.frames - 1) * clock.steps_per_frame
    for step in range(steps + 1):
        since_zero = step - clock.warmup_steps
        if step > 0 and step % control == 0:
            for agent in agents:
                agent.read(control * world.dt)
        if since_zero == 0:
            _release(agents, moving=step > 0)
        frame, rest = divmod(since_zero, clock.steps_per_frame)
        if rest == 0:
            if frame >= 0:
                take(frame, record_frame(_at_step(agents, step % control * world.dt)))
            report(step, steps)
        if step == steps:
            break
        if step % decision == 0:
            _decide(agents, junctions, since_zero * world.dt)
        if step % control == 0:
            for agent in agents:
                if agent.present:
                    agent.control()
        world.step()
        contacts.record(since_zero)
    world.close()
    return contacts.events()


def _release(agents: Sequence[Agent], *, moving: bool) -> None:
    """Let held agents go at frame 0: at their speed, or from rest if there was no warm-up."""
    for agent in agents:
        if agent.held and moving:
            agent.start_moving()
        agent.held = False


def _at_step(agents: Sequence[Agent], seconds: float) -> Sequence[Agent]:
    """The agents some seconds after they were last read. Copies read, so frames do not affect the simulation."""
    if seconds == 0.0:
        return agents
    copies = [copy.copy(agent) for agent in agents]
    for agent in copies:
        agent.read(seconds)
    return copies


def _decide(agents: Sequence[Agent], junctions: JunctionControl, seconds: float) -> None:
    junctions.update(agents, seconds)
    neighbours = NeighbourGrid(agents)
    for agent in agents:
        if agent.present:
            agent.decide(neighbours.around(agent), seconds)
    through_traffic.exchange(agents, neighbours)
