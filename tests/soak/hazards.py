"""What is in the way of a vehicle that brakes: a person, a vehicle, a light that is not green, or a stop line.

The vehicle is imagined to go on unbraked, on the way that it takes later. All lengths are in metres, speeds in m/s.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.signals import light

from tests.soak.tracks import Array, Tracks

Hazard = Literal["person", "vehicle", "light", "stop line", "nothing"]
_HORIZON, _STEP = 3.0, 0.5  # seconds for which the way is considered, and between two moments
_HEADWAY, _GAP = 1.0, 2.0  # seconds and metres to keep ahead
_ASIDE = {"pedestrian": 1.5, "vehicle": 0.5}  # clearance beside the body
_APART = 0.5  # between two points of the way
_STOP = 3.0  # from a junction's edge to the stop line


class Hazards:
    """Finds what is in the way of vehicles."""

    def __init__(self, tracks: Tracks) -> None:
        self._tracks = tracks
        elements = tracks.scene.town.elements
        self._junctions = {e.name.partition(".")[2]: e for e in elements if e.kind == "junction"}
        self._lights = [e for e in elements if e.kind == "traffic_light"]

    def ahead(self, n: int, frame: int) -> Hazard:
        """Return what is in the way of vehicle `n`, whose braking begins at a frame."""
        tracks, fps = self._tracks, self._tracks.fps
        front, speed = tracks.half[n, 0], float(tracks.speed[frame, n])
        reach = speed * (_HORIZON + _HEADWAY) + _GAP
        way = self._way(n, frame, reach + front)
        arc = np.arange(len(way)) * _APART - front  # from its front
        found: set[Hazard] = set()
        for seconds in np.arange(0.0, _HORIZON + 0.01, _STEP):
            later = min(frame + round(seconds * fps), len(tracks.at) - 1)
            gone = float(np.linalg.norm(tracks.at[frame : later + 1, n, :2][-1] - tracks.at[frame, n, :2]))
            part = way[(arc >= gone - 0.5) & (arc <= speed * (seconds + _HEADWAY) + _GAP)]
            for m in self._others(n, frame, later, reach):
                d = part - tracks.at[later, m, :2]
                ux, uy = tracks.ahead[later, m]
                local = np.abs(np.stack([d @ [ux, uy], d @ [-uy, ux]], axis=-1)) - tracks.half[m]
                category = tracks.scene.actors[m].category
                apart = np.linalg.norm(np.maximum(local, 0.0), axis=1)
                if (apart < tracks.half[n, 1] + _ASIDE[category]).any():
                    found.add("person" if category == "pedestrian" else "vehicle")
        found.add(self._line(way[arc >= 0.0], frame))
        order: tuple[Hazard, ...] = ("person", "vehicle", "light", "stop line", "nothing")
        return next(hazard for hazard in order if hazard in found)

    def _way(self, n: int, frame: int, length: float) -> Array:
        """Return points of its way from its middle, straight on where the Trace ends or it leaves."""
        tracks = self._tracks
        here = tracks.here[frame:, n]
        end = frame + (int(np.argmin(here)) if not here.all() else len(here))
        at = tracks.at[frame:end, n, :2]
        at = np.concatenate([at, at[-1:] + tracks.ahead[end - 1, n] * (length + 1.0)])
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=-1))])
        arc = arc + np.arange(len(arc)) * 1e-9  # strictly increasing
        wanted = np.arange(0.0, length, _APART)
        return np.stack([np.interp(wanted, arc, at[:, axis]) for axis in (0, 1)], axis=-1)

    def _others(self, n: int, frame: int, later: int, reach: float) -> list[int]:
        """Return the actors near it at a later frame, but for those that follow it."""
        tracks = self._tracks
        apart = tracks.at[later, :, :2] - tracks.at[frame, n, :2]
        near = np.hypot(*apart.T) < reach + tracks.half[n, 0] + tracks.half[:, 0] + 2.0
        behind = (tracks.at[frame, :, :2] - tracks.at[frame, n, :2]) @ tracks.ahead[frame, n] < 0.0
        follows = behind & (tracks.ahead[frame] @ tracks.ahead[frame, n] > 0.5)
        found = near & tracks.here[later] & ~follows
        found[n] = False
        return [int(m) for m in np.flatnonzero(found)]

    def _line(self, way: Array, frame: int) -> Hazard:
        """Return whether a way enters a junction, and what its stop line asks for."""
        seconds = frame / self._tracks.fps
        for name, junction in self._junctions.items():
            half = np.array(junction.size[:2]) / 2 + _STOP
            inside: NDArray[np.bool_] = np.all(np.abs(way - [junction.pose.x, junction.pose.y]) < half, axis=1)
            if not inside.any() or inside[0]:
                continue
            ux, uy = way[int(np.argmax(inside))] - way[int(np.argmax(inside)) - 1]
            for lamp in self._lights:
                yaw = np.radians(lamp.pose.yaw + 180.0)  # for approaching vehicles
                if ".".join(lamp.name.split(".")[1:3]) == name and ux * np.cos(yaw) + uy * np.sin(yaw) > 0.7 * _APART:
                    shown = {light(lamp.shape, seconds + later) for later in (0.0, 1.0, 2.0)}
                    return "nothing" if shown == {"green"} else "light"
            return "stop line"
        return "nothing"
