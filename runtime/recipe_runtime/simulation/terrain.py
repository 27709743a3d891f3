"""Height of the ground according to the town's plan: 0 on roads, the height of the kerb on sidewalks."""

from __future__ import annotations

from recipe_compiler.ir.plan import TownPlan

_Slab = tuple[float, float, float, float, float, float]  # x, y, half its size in x and y, radius of its corners, top
_CELL = 8.0  # metres


class Ground:
    """The sidewalks of a town: axis-aligned rectangles with rounded corners, found by a grid of square cells."""

    def __init__(self, town: TownPlan) -> None:
        self._cells: dict[tuple[int, int], list[_Slab]] = {}
        for e in town.elements:
            if e.kind != "sidewalk":
                continue
            half_x, half_y = e.size[0] / 2, e.size[1] / 2
            slab = (e.pose.x, e.pose.y, half_x, half_y, e.shape["radius"], e.pose.z + e.size[2])
            for i in range(_cell(e.pose.x - half_x), _cell(e.pose.x + half_x) + 1):
                for j in range(_cell(e.pose.y - half_y), _cell(e.pose.y + half_y) + 1):
                    self._cells.setdefault((i, j), []).append(slab)

    def height(self, x: float, y: float) -> float:
        """Return the height of the ground in metres at a position in the world frame."""
        for cx, cy, half_x, half_y, radius, top in self._cells.get((int(x // _CELL), int(y // _CELL)), ()):
            dx, dy = abs(x - cx), abs(y - cy)
            if dx <= half_x and dy <= half_y:
                ax, ay = dx - half_x + radius, dy - half_y + radius
                return top if ax <= 0.0 or ay <= 0.0 or ax * ax + ay * ay <= radius * radius else 0.0
        return 0.0


def _cell(metres: float) -> int:
    return int(metres // _CELL)
