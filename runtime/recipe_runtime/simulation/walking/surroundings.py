"""The static surroundings that all pedestrians of a scene share: ground, roads and obstacles."""

from __future__ import annotations

import math

from recipe_compiler.ir.ground.obstacles import ObstacleMap
from recipe_compiler.ir.plan import ScenePlan

from recipe_runtime.simulation.terrain import Ground
from recipe_runtime.simulation.traffic.road_map import Junction, RoadMap

SIGHT = 1.8  # metres within which obstacles are avoided
_CELL, _COARSE = 2.0, 32.0  # metres, sizes of the grid cells for obstacles and for junctions
_LEVEL = 0.1  # metres; higher ground is a sidewalk


class Surroundings:
    """The static part of a scene.

    Attributes:
        obstacles: Obstacles; a query near a position returns all within `SIGHT`.
    """

    def __init__(self, scene: ScenePlan, ground: Ground, roads: RoadMap) -> None:
        """Collect the static surroundings of a scene.

        Args:
            scene: The plan.
            ground: Its ground.
            roads: Its roads and junctions.
        """
        props = [(prop, ground.height(prop.pose.x, prop.pose.y)) for prop in scene.props]
        self.obstacles = ObstacleMap.of(scene.town, props, reach=SIGHT, cell=_CELL)
        self._ground, self._roads = ground, roads
        self._junctions: dict[tuple[int, int], list[Junction]] = {}
        for junction in roads.junctions:
            low_x, low_y, high_x, high_y = junction.bounds
            for i in range(_coarse(low_x), _coarse(high_x) + 1):
                for j in range(_coarse(low_y), _coarse(high_y) + 1):
                    self._junctions.setdefault((i, j), []).append(junction)

    def on_road(self, x: float, y: float) -> bool:
        """Return whether a position is on a carriageway."""
        if self._ground.height(x, y) > _LEVEL:
            return False
        return self._roads.limit(x, y) is not None or self.junction_at(x, y) is not None

    def junction_at(self, x: float, y: float) -> Junction | None:
        """Return the junction between whose stop lines a position is; None if there is none."""
        for junction in self._junctions.get((_coarse(x), _coarse(y)), ()):
            low_x, low_y, high_x, high_y = junction.bounds
            if low_x <= x <= high_x and low_y <= y <= high_y:
                return junction
        return None


def _coarse(metres: float) -> int:
    return math.floor(metres / _COARSE)
