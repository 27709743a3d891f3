"""Small towns for tests of the traffic rules: one crossing, one street, one motorway."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from recipe_compiler.ir.plan import Element, Pose, TownPlan
from recipe_compiler.library import towns
from recipe_compiler.library.towns.highway import Motorway
from recipe_compiler.library.towns.streets import BAY, CORNER, LANE, SIDE, STOP, StreetGrid

REACH = LANE + BAY + CORNER  # from the crossing's centre to its edge
LINE = REACH + STOP - CORNER  # ... to its stop lines
FAR = 200.0
YAWS = {(1, 0): 0.0, (0, 1): 90.0, (-1, 0): 180.0, (0, -1): 270.0}
East, North, West, South = (1, 0), (0, 1), (-1, 0), (0, -1)
_GRID = StreetGrid((0.0,), (0.0,), (BAY,), (BAY,), FAR)

GREEN = {"cycle": 1000.0, "green_from": 0.0, "green": 990.0, "amber": 3.0}
RED = {"cycle": 1000.0, "green_from": 500.0, "green": 100.0, "amber": 3.0}


def crossing(
    *, stop: Sequence[tuple[int, int]] = (), lights: Mapping[tuple[int, int], Mapping[str, float]] | None = None
) -> TownPlan:
    """Two streets that cross at (0, 0); stop signs and lights by direction of travel."""
    size = FAR - REACH
    elements = [Element(name="junction", kind="junction", pose=Pose(), size=(2 * REACH, 2 * REACH, 0.0))]
    for n, ((dx, dy), yaw) in enumerate(YAWS.items()):
        middle = -(REACH + size / 2)
        road = Pose(x=middle * dx, y=middle * dy, yaw=yaw)
        shape = {"limit": 30.0, "stop_a": 0.0, "stop_b": STOP - CORNER}
        elements.append(
            Element(name=f"road.{n}", kind="road", pose=road, size=(size, 2 * (LANE + BAY), 0.0), shape=shape)
        )
    corner = LANE + BAY + SIDE + 2.0
    for (dx, dy), yaw in YAWS.items():
        post = Pose(x=-corner * dx + 5.8 * dy, y=-corner * dy - 5.8 * dx, yaw=(yaw + 180.0) % 360.0)
        if (dx, dy) in stop:
            shape = {"face": 0.0, "value": 0.0}
            elements.append(Element(name=f"sign.{yaw}", kind="sign", pose=post, size=(0.1, 0.7, 2.7), shape=shape))
        if lights and (dx, dy) in lights:
            times = dict(lights[dx, dy])
            elements.append(
                Element(name=f"light.{yaw}", kind="traffic_light", pose=post, size=(0.2, 0.2, 5.6), shape=times)
            )
    return TownPlan(name="crossing", elements=tuple(elements))


def through(
    come: tuple[int, int], go: tuple[int, int], back: float, on: float = 120.0
) -> tuple[tuple[float, float, float], list[tuple[float, float]]]:
    """Return a start (x, y, yaw) `back` metres before the stop line, and a route through the crossing."""
    (dx, dy), (ex, ey) = come, go
    start = (-(LINE + back) * dx + 1.5 * dy, -(LINE + back) * dy - 1.5 * dx, YAWS[come])
    points = _GRID._through((0, 0), come, go)
    end = ((LINE + on) * ex + 1.5 * ey, (LINE + on) * ey - 1.5 * ex)
    return start, [*points, end]


def street(length: float = 800.0) -> TownPlan:
    """A street along x from 0, without junctions."""
    shape = {"limit": 50.0, "stop_a": 0.0, "stop_b": 0.0}
    road = Element(name="road", kind="road", pose=Pose(x=length / 2), size=(length, 2 * (LANE + BAY), 0.0), shape=shape)
    return TownPlan(name="street", elements=(road,))


def motorway() -> TownPlan:
    """A motorway along y with three lanes each way."""
    return towns.build("highway", 1, {"lanes": 3, "length": 10}).plan


def lane(number: int) -> float:
    """Return the x of a motorway lane towards +y, counted from the median."""
    return Motorway(3, 500.0).lane(number)
