"""A map of a town: lanes with directions, sidewalks, crossings, parking places, spawn points, actors and sensors.

It is drawn with Pillow, whose fonts and scaling may change, so no digest covers it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Pose, ScenarioPlan, SensorPlan, TownPlan

from recipe_runtime.core import codecs
from recipe_runtime.report.canvas import Box, Canvas, Point, placed, rectangle
from recipe_runtime.report.town_ground import (
    ASPHALT,
    BUILDING,
    GREEN,
    INK,
    LANE,
    MARK,
    PAPER,
    PATH,
    THING,
    WALK,
    WALL,
    stop_sign,
    town_canvas,
    traffic_light,
)

_MAX_SIDE, _MAX_EXTENT, _MARGIN = 1800, 320.0, 30.0  # longest side, pixels; largest extent, metres; margin, metres
_GRID, _AXIS, _LEGEND = 10, 74, 350  # grid spacing, metres; width of the axes' labels and of the legend, pixels
_GRID_LINE, _PARKING = "#9aa3ab", "#2d7f78"
_VEHICLE, _PEDESTRIAN, _SENSOR = "#1f5fb0", "#c2571a", "#7a2a9b"
_TRAFFIC = "#ffd23f"
_CAST = ("#c01f3a", "#0a7d3c", "#0b63c9", "#a85b00", "#8a1f8f", "#00707a")


@dataclass(frozen=True)
class Spots:
    """The places where a town lets actors start: spawn points with headings, and parking places."""

    vehicles: Sequence[Pose]
    pedestrians: Sequence[Pose]
    parking: Sequence[Pose]
    bounds: tuple[tuple[float, float], tuple[float, float]]  # ranges of x and y, metres


def town_map(town: TownPlan, spots: Spots, title: str, scenario: ScenarioPlan | None = None) -> bytes:
    """Return a PNG with a map of a town, and the named actors and the sensors of a scenario.

    Of a town larger than 320 m, a part with all of the actors and sensors is shown, or the middle; the title says so.
    """
    cast = [a for a in scenario.scene.actors if not a.name.startswith("traffic.")] if scenario else []
    box, part = _shown(spots, scenario, cast)
    canvas = town_canvas(town, box, _MAX_SIDE)
    _grid(canvas)
    _spots(canvas, spots)
    if scenario:
        for actor in scenario.scene.actors:
            if actor.name.startswith("traffic."):
                _traffic(canvas, actor)
        for n, actor in enumerate(cast):
            _actor(canvas, actor, _CAST[n % len(_CAST)])
        for sensor in scenario.rig.sensors:
            _sensor(canvas, sensor, scenario)
    return codecs.png(np.asarray(_page(canvas, f"{title} (a part)" if part else title, scenario is not None)), level=6)


def _shown(spots: Spots, scenario: ScenarioPlan | None, cast: Sequence[ActorPlan]) -> tuple[Box, bool]:
    """Return what to draw, all spawn points or the surroundings of actors and sensors, and whether that is a part."""
    points = [(p.x, p.y) for p in (*spots.vehicles, *spots.pedestrians)]
    interest = [(a.start.x, a.start.y) for a in cast]
    if scenario:
        interest += [(s.poses[0].x, s.poses[0].y) for s in scenario.rig.sensors if s.on is None]
    ends, part = [], False
    for axis in (0, 1):
        low, high = spots.bounds[axis]
        values = [p[axis] for p in points] or [low, high]
        low, high = max(low, min(values) - _MARGIN), min(high, max(values) + _MARGIN)
        if high - low > _MAX_EXTENT:
            here = [min(max(p[axis], low), high) for p in interest] or [(low + high) / 2]
            length = min(max(_MAX_EXTENT, max(here) - min(here) + 2 * _MARGIN), high - low)
            start = min(max((min(here) + max(here) - length) / 2, low), high - length)
            part |= length < high - low
            low, high = start, start + length
        ends.append((floor(low / _GRID) * _GRID, ceil(high / _GRID) * _GRID))
    return (float(ends[0][0]), float(ends[1][0]), float(ends[0][1]), float(ends[1][1])), part


# Actors, sensors and spawn points


def _grid(canvas: Canvas) -> None:
    x0, y0, x1, y1 = canvas.box
    for x in _multiples(x0, x1, _GRID):
        canvas.line([(x, y0), (x, y1)], _GRID_LINE, 1.4 if x == 0 else 0.4)
    for y in _multiples(y0, y1, _GRID):
        canvas.line([(x0, y), (x1, y)], _GRID_LINE, 1.4 if y == 0 else 0.4)


def _multiples(low: float, high: float, step: int) -> range:
    return range(ceil(low / step) * step, floor(high) + 1, step)


def _spots(canvas: Canvas, spots: Spots) -> None:
    for pose in spots.parking:
        _parking_place(canvas, pose)
    for pose in spots.vehicles:
        _vehicle_spot(canvas, pose)
    for pose in spots.pedestrians:
        canvas.disc((pose.x, pose.y), 0.45, _PEDESTRIAN)


def _parking_place(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(rectangle(pose, -2.3, 2.3, -0.9, 0.9), None, _PARKING, 1.5)


def _vehicle_spot(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(placed(pose, [(1.2, 0.0), (-0.8, 0.8), (-0.8, -0.8)]), _VEHICLE)


def _traffic(canvas: Canvas, actor: ActorPlan) -> None:
    if actor.category == "pedestrian":
        _traffic_pedestrian(canvas, actor.start)
    elif actor.name.startswith("traffic.parked."):
        _parked_car(canvas, actor.start)
    else:
        _traffic_vehicle(canvas, actor.start)


def _traffic_pedestrian(canvas: Canvas, pose: Pose) -> None:
    canvas.disc((pose.x, pose.y), 0.8, _TRAFFIC, INK, 1.5)


def _traffic_vehicle(canvas: Canvas, pose: Pose) -> None:
    corners = [(2.4, 0.0), (1.2, 1.0), (-2.2, 1.0), (-2.2, -1.0), (1.2, -1.0)]
    canvas.polygon(placed(pose, corners), _TRAFFIC, INK, 1.5)


def _parked_car(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(rectangle(pose, -2.0, 2.0, -0.8, 0.8), _PARKING, INK, 1.0)


def _actor(canvas: Canvas, actor: ActorPlan, colour: str) -> None:
    """Draw the start, the heading and the route of an actor."""
    start = (actor.start.x, actor.start.y)
    _way(canvas, [start, *((p.x, p.y) for p in actor.route)], colour)
    canvas.line([start, *placed(actor.start, [(1.5, 0.0)])], colour, 3.0)
    canvas.text(start, actor.name, colour, 21)


def _way(canvas: Canvas, way: Sequence[Point], colour: str) -> None:
    """Draw a route from a disc to a cross."""
    if len(way) > 1:
        canvas.line(way, colour, 2.5)
        x, y = way[-1]
        for k in (1, -1):
            canvas.line([(x - 0.7, y - 0.7 * k), (x + 0.7, y + 0.7 * k)], colour, 2.5)
    canvas.disc(way[0], 0.9, colour, PAPER, 1.5)


def _sensor(canvas: Canvas, sensor: SensorPlan, scenario: ScenarioPlan) -> None:
    """Draw a sensor's position at the first frame and its horizontal field of view."""
    poses, carrier = sensor.poses, next((a.start for a in scenario.scene.actors if a.name == sensor.on), Pose())
    first = poses[0]
    ((x, y),) = placed(carrier, [(first.x, first.y)])
    ahead = 0.0 if sensor.arm is None else exact.atan2_deg(-first.y, -first.x)  # along the arm
    pose = Pose(x=x, y=y, yaw=carrier.yaw + ahead + first.yaw)
    edges = []
    for turn in (sensor.camera.fov / 2, 0.0, -sensor.camera.fov / 2):
        s, c = exact.sin_cos_deg(turn)
        edges.append((9.0 * c, 9.0 * s))
    fan = placed(pose, [(0.0, 0.0), *edges])
    canvas.polygon(fan, None, _SENSOR, 2.0)
    canvas.line(placed(carrier, [(p.x, p.y) for p in poses] * (2 if len(poses) == 1 else 1)), _SENSOR, 2.0)
    canvas.polygon(rectangle(pose, -0.8, 0.8, -0.8, 0.8), _SENSOR)
    canvas.text((x, y), sensor.name, _SENSOR, 21)


# Axes, title and legend


def _page(canvas: Canvas, title: str, cast: bool) -> Image.Image:
    """Return the map with axes, a title and a legend."""
    picture = canvas.finished()
    left, top = _AXIS + 16, 64
    size = left + canvas.size[0] + 24 + _LEGEND, max(top + canvas.size[1] + _AXIS, 760)
    page = Image.new("RGB", size, PAPER)
    page.paste(picture, (left, top))
    pen = ImageDraw.Draw(page)
    pen.text((left + 40, 12), title, fill=INK, font=ImageFont.load_default(30))
    pen.rectangle((left - 1, top - 1, left + canvas.size[0], top + canvas.size[1]), outline=INK)
    _axes(pen, canvas, (left, top))
    page.paste(_legend(canvas.scale, cast), (left + canvas.size[0] + 24, top))
    return page


def _axes(pen: ImageDraw.ImageDraw, canvas: Canvas, corner: tuple[int, int]) -> None:
    """Draw coordinates at the grid lines, every 10 or 20 m, and the names of the axes."""
    x0, y0, x1, y1 = canvas.box
    step, font = _GRID if canvas.scale * _GRID > 60 else 2 * _GRID, ImageFont.load_default(19)
    (left, top), bottom = corner, corner[1] + canvas.size[1]
    for x in _multiples(x0, x1, step):
        at = left + canvas.pixel((x, y0))[0]
        pen.line((at, bottom, at, bottom + 6), fill=INK)
        pen.text((at, bottom + 9), f"{x}", fill=INK, font=font, anchor="ma")
    for y in _multiples(y0, y1, step):
        at = top + canvas.pixel((x0, y))[1]
        pen.line((left - 7, at, left - 1, at), fill=INK)
        pen.text((left - 10, at), f"{y}", fill=INK, font=font, anchor="rm")
    pen.text((left + canvas.size[0] / 2, bottom + 36), "x, metres", fill=INK, font=font, anchor="ma")
    pen.text((10, top - 34), "y, metres", fill=INK, font=font)


def _legend(scale: float, cast: bool) -> Image.Image:
    """Draw the legend; each symbol is drawn by the function that draws it on the map."""
    rows: list[tuple[str, Callable[[Canvas, Pose], None]]] = [
        ("lane, with its direction", _sample_lane),
        ("crossing", _sample_crossing),
        ("sidewalk", lambda c, p: c.polygon(rectangle(p, -3, 3, -1, 1), WALK, THING)),
        ("footpath, driveway", lambda c, p: c.polygon(rectangle(p, -3, 3, -1, 1), PATH)),
        ("building", lambda c, p: c.polygon(rectangle(p, -3, 3, -1, 1), BUILDING, WALL)),
        ("wall, fence, guard rail", lambda c, p: c.line(placed(p, [(-3.0, 0.0), (3.0, 0.0)]), WALL, 2.5)),
        ("tree, hedge", lambda c, p: c.disc((p.x, p.y), 1.2, GREEN)),
        ("street furniture", lambda c, p: c.polygon(rectangle(p, -0.8, 0.8, -0.5, 0.5), THING)),
        ("traffic light", traffic_light),
        ("stop sign", stop_sign),
        ("parking place", _parking_place),
        ("vehicle's spawn point", _vehicle_spot),
        ("pedestrian's spawn point", lambda c, p: c.disc((p.x, p.y), 0.5, _PEDESTRIAN)),
    ]
    if cast:
        rows += [
            ("actor: start and route", _sample_actor),
            ("traffic: vehicle at the start", _traffic_vehicle),
            ("traffic: pedestrian at the start", _traffic_pedestrian),
            ("parked car", _parked_car),
            ("sensor and field of view", _sample_sensor),
        ]
    high, metre = 3.4, 10.0
    canvas = Canvas((0.0, 0.0, _LEGEND / metre, high * (len(rows) + 1.5)), metre, PAPER)
    for n, (_, draw) in enumerate(rows):
        draw(canvas, Pose(x=3.5, y=canvas.box[3] - high * (n + 0.7)))
    picture = canvas.finished()
    pen, font = ImageDraw.Draw(picture), ImageFont.load_default(19)
    for n, (words, _) in enumerate(rows):
        pen.text((82, metre * high * (n + 0.7)), words, fill=INK, font=font, anchor="lm")
    y, wide = metre * high * (len(rows) + 0.8), (20 if 20 * scale < _LEGEND - 90 else 10) * scale
    pen.line((8, y, 8 + wide, y), fill=INK, width=3)
    pen.text((18 + wide, y), f"{wide / scale:.0f} m", fill=INK, font=font, anchor="lm")
    return picture


def _sample_lane(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(rectangle(pose, -3.0, 3.0, -1.2, 1.2), ASPHALT)
    canvas.arrow(pose, 3.4, LANE)


def _sample_crossing(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(rectangle(pose, -3.0, 3.0, -1.2, 1.2), ASPHALT)
    for k in range(6):
        canvas.polygon(rectangle(pose, k - 2.75, k - 2.25, -1.2, 1.2), MARK)


def _sample_actor(canvas: Canvas, pose: Pose) -> None:
    _way(canvas, placed(pose, [(-2.0, 0.0), (2.6, 0.0)]), _CAST[0])


def _sample_sensor(canvas: Canvas, pose: Pose) -> None:
    canvas.polygon(rectangle(pose, -2.6, -1.2, -0.7, 0.7), _SENSOR)
    canvas.polygon(placed(pose, [(-1.9, 0.0), (2.9, 1.4), (2.9, -1.4)]), None, _SENSOR, 2.0)
