"""Caps on what the variants of a recipe have, counted before anything is lowered.

The estimate of a build needs the plan, and lowering a hostile recipe may take hours. What lowering creates is therefore
counted from the checked variants, and a recipe that exceeds a cap is refused within seconds. Each cap is about as much
as is lowered in five to ten seconds. Work that lowering shares between variants counts once.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Hashable
from typing import NamedTuple

from recipe_compiler.estimate import FRAME_LIMIT, TooLargeError
from recipe_compiler.expand import Variant
from recipe_compiler.ir.errors import Place
from recipe_compiler.ir.plurals import count
from recipe_compiler.library import towns
from recipe_compiler.lowering import traffic
from recipe_compiler.lowering.actors import MAX_ROUTE
from recipe_compiler.lowering.patches import lower as patch_lowering
from recipe_compiler.lowering.placement import CANDIDATES
from recipe_compiler.lowering.sensors import arms
from recipe_compiler.schema.motion import Motion
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.tick import interval_of
from recipe_compiler.source.yaml_reader import Value


class Cap(NamedTuple):
    """The most that all variants together may have of something."""

    most: int
    what: str
    path: tuple[str, ...]  # what it follows from in the recipe


CAPS = {
    "values": Cap(1_000_000, "values in sections that differ", ("base",)),
    "changes": Cap(250_000, "changes by deltas and draws", ("deltas",)),
    "frames": Cap(FRAME_LIMIT, "frames", ("base", "clock", "frames")),
    "elements": Cap(150_000, "elements of different towns", ("base", "town")),
    "coloured": Cap(3_000_000, "town elements in different scenes", ("base", "town")),
    "actors": Cap(50_000, "actors in different scenes", ("base", "traffic")),
    "waypoints": Cap(1_000_000, "waypoints of actors", ("base", "clock", "frames")),
    "props": Cap(50_000, "props in different scenes", ("base", "props")),
    "patches": Cap(50_000, "patches in different scenes", ("base", "patches")),
    "images": Cap(1_000_000, "images that patches show", ("base", "patches")),
    "poses": Cap(FRAME_LIMIT, "poses of moving sensors", ("base", "clock", "frames")),
    "obstacles": Cap(1_000_000, "town elements that may shorten the arms of sensors", ("base", "sensors")),
}

_PACE = 5.0  # m/s: mean speed on generated routes
_LEG = 25.0  # metres: mean distance between their waypoints


class Counts:
    """What the variants of a recipe have so far."""

    def __init__(self, root: Value, variants: int, changes: int) -> None:
        """Start to count.

        Args:
            root: the recipe, for places.
            variants: the number of its variants.
            changes: the number of axes and draws, which each variant merges into the base.
        """
        self._root, self._variants, self._changes = root, variants, changes
        self._number = 0
        self._totals = Counter[str]()
        self._known = set[Hashable]()

    def add(self, variant: Variant, base: Base, values: int) -> None:
        """Add a variant. Sections that are the same object in several variants are shared, and must be kept alive.

        Args:
            variant: the variant.
            base: its checked base.
            values: the number of values that were checked so far, in all variants.

        Raises:
            TooLargeError: the variants so far exceed a cap.
        """
        clock, sensors = base.clock, base.sensors.values()
        self._number += 1
        self._add("values", values - self._totals["values"])
        self._add("changes", self._changes)
        self._add("frames", sum(-(-clock.frames // interval_of(sensor.tick, clock.fps)) for sensor in sensors))
        sequences = sum(
            patch.texture is not None and patch.texture.frames is not None for patch in base.patches.values()
        )
        self._add("images", sequences * clock.frames)
        parameters = base.town.model_extra or {}
        elements = towns.elements(base.town.name, parameters)
        if self._is_new("town", base.town.name, base.town.seed, json.dumps(parameters, sort_keys=True)):
            self._add("elements", elements)
        near = id(base.sensors) if base.traffic.near is not None else None
        cast = id(clock), id(base.town), id(base.actors), id(base.traffic), id(base.props), near
        scene = (*cast, patch_lowering.board_key(base.patches), variant.seed)
        if self._is_new("scene", *scene):
            self._add_scene(base, elements)
        if self._is_new("patches", id(base.patches), *scene):
            self._add("patches", len(base.patches))
        if self._is_new("rig", id(clock), id(base.sensors), id(base.town), variant.seed):
            self._add_rig(base, elements)

    def _add_scene(self, base: Base, elements: int) -> None:
        crowd = sum(traffic.counts(base).values())
        self._add("coloured", elements)
        self._add("actors", len(base.actors) + crowd + base.traffic.parked)
        self._add("props", len(base.props))
        seconds = base.clock.frames / base.clock.fps + traffic.warmup(base)
        tried = CANDIDATES if base.traffic.near is not None else 1
        routes = sum(actor.route is None and actor.goal is None for actor in base.actors.values()) + crowd * tried
        given = sum(len(actor.route or ()) for actor in base.actors.values())
        self._add("waypoints", given + round(routes * min(seconds * _PACE, MAX_ROUTE) / _LEG))

    def _add_rig(self, base: Base, elements: int) -> None:
        sensors = base.sensors.values()
        self._add("poses", sum(sensor.motion != Motion() for sensor in sensors) * base.clock.frames)
        self._add("obstacles", sum(map(arms.is_shortened, sensors)) * elements)

    def _is_new(self, *key: Hashable) -> bool:
        """Return whether a key is seen for the first time."""
        known = key in self._known
        self._known.add(key)
        return not known

    def _add(self, name: str, amount: int) -> None:
        self._totals[name] += amount
        cap, total = CAPS[name], self._totals[name]
        if total <= cap.most:
            return
        some = f" in the first {self._number:,} of {count(self._variants, 'variant')}" if self._variants > 1 else ""
        # The larger factor of the total is at fault: what one variant has, or how many variants there are.
        place = self._root.place_of(*cap.path) if amount > self._variants else place_of_variants(self._root)
        raise TooLargeError(place, [f"{total:,} {cap.what}{some} are over {cap.most:,}"], self._variants)


def place_of_variants(root: Value) -> Place:
    """Return the place of what decides about the number of variants; of the base if there is one."""
    for path in (("sweep", "repeats"), ("sweep", "draw", "count"), ("deltas",)):
        if root.get(*path):
            return root.place_of(*path)
    return root.place_of("base", "clock", "frames")
