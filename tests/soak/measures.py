"""Measurements of the traffic in a Trace, by code that shares only the plan with the simulation.

All lengths are in metres, speeds in m/s, times in seconds since frame 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from recipe_compiler.ir.plan import Element, ScenePlan
from recipe_compiler.ir.signals import light
from recipe_runtime.core.trace import ContactEvent, Trace

from tests.soak import driving
from tests.soak.driving import Driving
from tests.soak.tracks import PERSON, Tracks

STOP = 3.0  # metres from a junction's edge to the stop line


@dataclass
class Measures:
    """The measurements of one run, and their violations."""

    vehicles: int
    pedestrians: int
    first_speed: float = 0.0  # mean of the vehicles over the first 30 s
    last_speed: float = 0.0  # and over the last 30 s
    walking_speed: float = 0.0  # mean of the pedestrians over the last 30 s
    longest_stand: float = 0.0
    collisions: int = 0
    overlaps: list[str] = field(default_factory=list)
    accelerations: list[str] = field(default_factory=list)
    heights: list[str] = field(default_factory=list)
    red_entries: list[str] = field(default_factory=list)
    standing: list[str] = field(default_factory=list)
    driving: Driving = field(default_factory=Driving)

    def faults(self) -> list[str]:
        """Return a message for each violation."""
        found = [*self.overlaps, *self.accelerations, *self.heights, *self.red_entries, *self.standing]
        found += self.driving.faults()
        if self.last_speed <= self.first_speed / 2:
            found.append(f"the mean speed fell from {self.first_speed:.2f} to {self.last_speed:.2f} m/s")
        return found


def measure(scene: ScenePlan, trace: Trace, events: Sequence[ContactEvent]) -> Measures:
    """Measure a run.

    Args:
        scene: Its plan.
        trace: Its motion.
        events: Contacts, with physics steps since frame 0.
    """
    run = _Run(scene, trace, events)
    people = [n for n, actor in enumerate(scene.actors) if actor.category == "pedestrian"]
    driven = [n for n, actor in enumerate(scene.actors) if actor.category == "vehicle" and actor.speed > 0]
    made = Measures(len(driven), len(people), collisions=len(events))
    clip = 30 * scene.clock.fps
    made.first_speed = run.mean_speed(driven, slice(0, clip))
    made.last_speed = run.mean_speed(driven, slice(-clip, None))
    made.walking_speed = run.mean_speed(people, slice(-clip, None))
    for n in [*driven, *people]:
        stood = run.longest_stand(n)
        made.longest_stand = max(made.longest_stand, stood)
        if stood > 90.0:
            made.standing.append(f"{run.name(n)} stands for {stood:.0f} s")
    made.overlaps = list(run.overlaps())
    made.accelerations = list(run.accelerations([*driven, *people]))
    made.heights = list(run.heights(driven))
    made.red_entries = list(run.red_entries([n for n in driven if scene.actors[n].obeys]))
    made.driving = driving.measure(run, driven)
    return made


class _Run(Tracks):
    def mean_speed(self, group: Sequence[int], frames: slice) -> float:
        here = self.here[frames][:, group]
        return float(self.speed[frames][:, group][here].mean()) if here.any() else 0.0

    def longest_stand(self, n: int) -> float:
        still = (self.speed[:, n] < 0.1) & self.here[:, n]
        longest = count = 0
        for stands in still:
            count = count + 1 if stands else 0
            longest = max(longest, count)
        return longest / self.fps

    def overlaps(self) -> Iterator[str]:
        """Return pairs that overlap by more than 5 cm without a recorded contact, each once."""
        known: set[tuple[int, int]] = set()
        reach = np.linalg.norm(self.half, axis=1)
        for frame in range(0, len(self.at), max(1, self.fps // 10)):
            at = self.at[frame, :, :2]
            apart = np.linalg.norm(at[:, None] - at[None], axis=-1)
            near = (apart < reach[:, None] + reach[None]) & self.here[frame][:, None] & self.here[frame][None]
            for a, b in np.argwhere(np.triu(near, 1)).tolist():
                if (a, b) in known or self._in_contact(a, b, frame / self.fps):
                    continue
                depth = self._depth(frame, a, b)
                if depth > 0.05:
                    known.add((a, b))
                    yield f"{self.name(a)} is {depth:.2f} m inside {self.name(b)} at {frame / self.fps:.1f} s"

    def _in_contact(self, a: int, b: int, seconds: float) -> bool:
        return any(start <= seconds <= end for start, end in self.pairs.get(frozenset((a, b)), ()))

    def _depth(self, frame: int, a: int, b: int) -> float:
        """Return the penetration depth, by the separating axis theorem or a disc's distance from the rectangle."""
        (ax, ay), (bx, by) = self.at[frame, a, :2], self.at[frame, b, :2]
        people = [self.scene.actors[n].category == "pedestrian" for n in (a, b)]
        if all(people):
            return float(2 * PERSON - np.hypot(bx - ax, by - ay))
        if any(people):
            person, box = (a, b) if people[0] else (b, a)
            d = self.at[frame, person, :2] - self.at[frame, box, :2]
            u = self.ahead[frame, box]
            local = np.abs([d @ u, d[1] * u[0] - d[0] * u[1]]) - self.half[box]
            outside = np.hypot(*np.maximum(local, 0.0))
            return float(PERSON - outside) if outside > 0 else float(PERSON - local.max())
        depth = np.inf
        for n in (a, b):
            for ux, uy in (self.ahead[frame, n], self.ahead[frame, n][::-1] * [-1, 1]):
                extents = [self._extent(frame, m, ux, uy) for m in (a, b)]
                depth = min(depth, sum(extents) - abs((bx - ax) * ux + (by - ay) * uy))
        return float(depth)

    def _extent(self, frame: int, n: int, ux: float, uy: float) -> float:
        hx, hy = self.ahead[frame, n]
        return float(abs(hx * ux + hy * uy) * self.half[n, 0] + abs(hx * uy - hy * ux) * self.half[n, 1])

    def accelerations(self, group: Sequence[int]) -> Iterator[str]:
        """Return actors that accelerate by more than 10 m/s2 without a recorded contact, each once."""
        change = np.linalg.norm(np.diff(self.velocity, axis=0), axis=-1) * self.fps
        stays = self.here[1:] & self.here[:-1] & (np.linalg.norm(np.diff(self.at, axis=0), axis=-1) < 10.0)
        hard = (change > 10.0) & stays & ~self.touched[1:] & ~self.touched[:-1]
        for n in group:
            frames = np.flatnonzero(hard[:, n])
            if len(frames):
                worst = frames[np.argmax(change[frames, n])]
                yield f"{self.name(n)} accelerates by {change[worst, n]:.1f} m/s2 at {worst / self.fps:.1f} s"

    def heights(self, group: Sequence[int]) -> Iterator[str]:
        """Return vehicles more than 20 cm above or below the ground without a recorded contact, each once."""
        for n in group:
            off = (np.abs(self.at[:, n, 2]) > 0.2 + 0.15) & self.here[:, n] & ~self.touched[:, n]
            if off.any():
                frame = int(np.flatnonzero(off)[0])
                yield f"{self.name(n)} is at height {self.at[frame, n, 2]:.2f} m at {frame / self.fps:.1f} s"

    def red_entries(self, group: Sequence[int]) -> Iterator[str]:
        """Return vehicles whose front crosses the stop line at a red light."""
        for lamp, junction in _approaches(self.scene.town.elements):
            yaw = np.radians(lamp.pose.yaw + 180.0)  # for approaching vehicles
            ux, uy = np.cos(yaw), np.sin(yaw)
            half = (junction.size[0] if abs(ux) > 0.5 else junction.size[1]) / 2
            for n in group:
                d = self.at[:, n, :2] - [junction.pose.x, junction.pose.y]
                along = d[:, 0] * ux + d[:, 1] * uy + self.half[n, 0] + half + STOP
                aside = np.abs(d[:, 1] * ux - d[:, 0] * uy)
                faces = (self.ahead[:, n, 0] * ux + self.ahead[:, n, 1] * uy) > 0.8
                passed = (along[1:] > 0.0) & (along[:-1] <= 0.0) & (aside[1:] < 6.0) & faces[1:] & (along[1:] < 5.0)
                for frame in np.flatnonzero(passed):
                    share = -along[frame] / (along[frame + 1] - along[frame])
                    seconds = (frame + share) / self.fps
                    if light(lamp.shape, seconds) == "red":
                        yield f"{self.name(n)} passes {lamp.name} on red at {seconds:.1f} s"


def _approaches(elements: Sequence[Element]) -> Iterator[tuple[Element, Element]]:
    """Return each traffic light with its junction, by their names: traffic_light.I.J.YAW and junction.I.J."""
    junctions = {e.name.partition(".")[2]: e for e in elements if e.kind == "junction"}
    for element in elements:
        if element.kind == "traffic_light":
            yield element, junctions[".".join(element.name.split(".")[1:3])]
