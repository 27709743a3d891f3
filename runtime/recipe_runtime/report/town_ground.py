"""Draws the elements of a town from above: streets, footpaths, buildings, plants, street furniture, lights."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Element, Pose, TownPlan

from recipe_runtime.report.canvas import Box, Canvas, Point, placed, rectangle

INK, PAPER = "#1d2126", "#ffffff"
GRASS, WALK, ASPHALT, MARK, PATH = "#dfe8d2", "#efe6d3", "#b4b8be", "#ffffff", "#d8ccb6"
BUILDING, WALL, GREEN, THING = "#8f857b", "#5d544c", "#9dbb84", "#8a8f96"
LANE = "#5b636d"
_FRONTED = ("building", "house", "wall")  # elements with the origin in the middle of their front
_THINGS = ("bench", "bicycles", "billboard", "board", "bollard", "bus_stop", "cafe", "delivery", "fountain", "kiosk",
           "lamp", "letter_box", "planter", "statue")  # fmt: skip
_LAMPS = ("#e03131", "#f2b01e", "#2fb344")  # of a traffic light, from the top


def town_canvas(town: TownPlan, box: Box, longest: int) -> Canvas:
    """Return a canvas with a part of a town.

    Args:
        town: The town.
        box: What to draw: x0, y0, x1, y1, metres.
        longest: Pixels of the longer side.
    """
    canvas = Canvas(box, longest / max(box[2] - box[0], box[3] - box[1]), GRASS)
    for kinds, draw in _LAYERS:
        for element in town.elements:
            if element.kind in kinds:
                draw(canvas, element)
    return canvas


def _sidewalk(canvas: Canvas, e: Element) -> None:
    x, y, walk = e.size[0] / 2, e.size[1] / 2, e.shape["walk"]
    canvas.polygon(_rounded(e.pose, x, y, e.shape["radius"]), WALK, THING)
    if not e.shape["paved"] and walk < min(x, y):
        canvas.polygon(rectangle(e.pose, walk - x, x - walk, walk - y, y - walk), GRASS)


def _rounded(pose: Pose, x: float, y: float, radius: float) -> list[Point]:
    points = []
    for quarter, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        for k in range(6):
            s, c = exact.sin_cos_deg(90.0 * quarter + 18.0 * k)
            points.append((sx * (x - radius) + radius * c, sy * (y - radius) + radius * s))
    return placed(pose, points)


def _flat(colour: str, least: float = 0.0) -> Callable[[Canvas, Element], None]:
    """Return a function that draws an element as its rectangle, at least `least` metres wide."""

    def draw(canvas: Canvas, e: Element) -> None:
        x, y = max(e.size[0], least) / 2, max(e.size[1], least) / 2
        canvas.polygon(rectangle(e.pose, -x, x, -y, y), colour)

    return draw


def _road_marks(canvas: Canvas, e: Element) -> None:
    """Draw centre line, parking bays, stop lines, and an arrow in each lane; traffic towards +x uses the lane at -y."""
    half, side, bay = e.size[0] / 2, e.size[1] / 2, e.shape["bay"]
    a, b, lane = e.shape["stop_a"] - half, half - e.shape["stop_b"], side - bay
    for k in range(int((b - a) / 4.5) + 1):
        canvas.line(placed(e.pose, [(a + 4.5 * k, 0.0), (min(a + 4.5 * k + 2.5, b), 0.0)]), MARK, 2.0)
    for x, sign, stop in ((a, 1, e.shape["stop_a"]), (b, -1, e.shape["stop_b"])):
        if stop:
            canvas.line(placed(e.pose, [(x, 0.0), (x, sign * lane)]), MARK, 3.0)
    low, high = e.shape["bay_from"], e.shape["bay_from"] + e.shape["bays"] * e.shape["bay_length"]
    for sign in (1, -1) if e.shape["bays"] else ():
        canvas.line(placed(e.pose, [(low, sign * lane), (high, sign * lane)]), MARK)
        for k in range(int(e.shape["bays"]) + 1):
            x = low + k * e.shape["bay_length"]
            canvas.line(placed(e.pose, [(x, sign * lane), (x, sign * side)]), MARK)
    _arrows(canvas, e.pose, (a, b), ((-lane / 2, 0.0), (lane / 2, 180.0)))


def _carriageway_marks(canvas: Canvas, e: Element) -> None:
    """Draw lines between lanes, and an arrow in each; traffic drives along +x, with the median on its left."""
    half, side, lane, lanes = e.size[0] / 2, e.size[1] / 2, e.shape["lane"], int(e.shape["lanes"])
    strip = e.size[1] - e.shape["shoulder"] - lanes * lane
    for n in range(lanes + 1):
        y = side - strip - n * lane
        if n in (0, lanes):
            canvas.line(placed(e.pose, [(-half, y), (half, y)]), MARK, 2.0)
        else:
            for k in range(int(2 * half / 6.0)):
                canvas.line(placed(e.pose, [(6.0 * k - half, y), (6.0 * k + 3.0 - half, y)]), MARK, 1.5)
    _arrows(canvas, e.pose, (-half, half), tuple((side - strip - (n + 0.5) * lane, 0.0) for n in range(lanes)))


def _arrows(canvas: Canvas, pose: Pose, span: tuple[float, float], lanes: Sequence[tuple[float, float]]) -> None:
    """Draw arrows about 12 m apart; `lanes` holds the offset along the pose's y and the heading relative to it."""
    count = max(1, int((span[1] - span[0]) / 12.0))
    for y, turn in lanes:
        for k in range(count):
            ((x, at),) = placed(pose, [(span[0] + (span[1] - span[0]) * (k + 0.5) / count, y)])
            canvas.arrow(Pose(x=x, y=at, yaw=pose.yaw + turn), 3.4, LANE)


def _crossings(canvas: Canvas, e: Element) -> None:
    for over, wide, turn in ((e.shape["over_x"], e.shape["wide_x"], 0.0), (e.shape["over_y"], e.shape["wide_y"], 90.0)):
        pose, count = Pose(x=e.pose.x, y=e.pose.y, yaw=e.pose.yaw + turn), int(2 * wide)
        for sign in (1, -1):
            for k in range(count):
                y = -wide + 2 * wide * (k + 0.5) / count
                canvas.polygon(rectangle(pose, sign * over - 1.5, sign * over + 1.5, y - 0.25, y + 0.25), MARK)


def _building(canvas: Canvas, e: Element) -> None:
    x0 = -e.size[0] if e.kind in _FRONTED else -e.size[0] / 2
    corners = rectangle(e.pose, x0, x0 + e.size[0], -e.size[1] / 2, e.size[1] / 2)
    canvas.polygon(corners, BUILDING, WALL, 1.5)


def _barrier(canvas: Canvas, e: Element) -> None:
    colour = GREEN if e.kind == "hedge" else WALL
    canvas.line(
        placed(e.pose, [(0.0, -e.size[1] / 2), (0.0, e.size[1] / 2)]), colour, max(2.0, e.size[0] * canvas.scale)
    )


def _plant(canvas: Canvas, e: Element) -> None:
    canvas.disc((e.pose.x, e.pose.y), e.size[0] / 2, GREEN)


def traffic_light(canvas: Canvas, pose: Pose) -> None:
    """Draw a traffic light."""
    canvas.polygon(rectangle(Pose(x=pose.x, y=pose.y), -0.6, 0.6, -1.5, 1.5), INK)
    for n, colour in enumerate(_LAMPS):
        canvas.disc((pose.x, pose.y + 0.9 * (1 - n)), 0.38, colour)


def stop_sign(canvas: Canvas, pose: Pose) -> None:
    """Draw a stop sign."""
    canvas.disc((pose.x, pose.y), 0.9, _LAMPS[0], PAPER, 1.5)


def _sign(canvas: Canvas, e: Element) -> None:
    if int(e.shape["face"]) == 0:  # see `library.towns.network.FACES`
        stop_sign(canvas, e.pose)


_LAYERS: tuple[tuple[tuple[str, ...], Callable[[Canvas, Element], None]], ...] = (
    (("road", "junction", "carriageway"), _flat(ASPHALT)),
    (("sidewalk",), _sidewalk),
    (("path", "parking"), _flat(PATH)),
    (("road",), _road_marks),
    (("carriageway",), _carriageway_marks),
    (("junction",), _crossings),
    (("building", "house", "tower"), _building),
    (("tree", "bush"), _plant),
    (("wall", "fence", "hedge", "guardrail"), _barrier),
    (_THINGS, _flat(THING, 0.4)),
    (("traffic_light",), lambda canvas, e: traffic_light(canvas, e.pose)),
    (("sign",), _sign),
)
