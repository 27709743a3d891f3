"""Height of the ground according to the town's plan: 0 on roads, the height of the kerb on sidewalks."""

from __future__ import annotations

from recipe_compiler.ir.plan import TownPlan


class Ground:
    """The sidewalks of a town: axis-aligned rectangles with rounded corners."""

    def __init__(self, town: TownPlan) -> None:
        self._slabs = [
            (e.pose.x, e.pose.y, e.size[0] / 2, e.size[1] / 2, e.shape["radius"], e.pose.z + e.size[2])
            for e in town.elements
            if e.kind == "sidewalk"
        ]

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground in metres at a position in the world frame."""
        for cx, cy, half_x, half_y, radius, top in self._slabs:
            dx, dy = abs(x - cx), abs(y - cy)
            if dx <= half_x and dy <= half_y:
                ax, ay = dx - half_x + radius, dy - half_y + radius
                return top if ax <= 0.0 or ay <= 0.0 or ax * ax + ay * ay <= radius * radius else 0.0
        return 0.0
