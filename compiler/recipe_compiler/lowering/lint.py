"""Warns of probable mistakes: overlapping bodies, blocked routes, places far from the town, cameras in buildings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.ground.obstacles import ObstacleMap
from recipe_compiler.ir.plan import ActorPlan, Clock, Element, Point, Pose, RigPlan
from recipe_compiler.library.towns import Town
from recipe_compiler.schema.scene import Actor
from recipe_compiler.source.yaml_reader import Value

FAR = 100.0  # distance from the town's bounds that causes a warning, metres
_SHOULDER = 0.25  # half a pedestrian's width, metres

Disc = tuple[float, float, float]  # x, y, radius


def of_starts(base: Value, actors: Sequence[ActorPlan], town: Town) -> Iterator[Problem]:
    """Yield warnings for starts that overlap the start of an earlier actor, or that are far from the town.

    Args:
        base: the recipe's base, for the places of its values.
        actors: the actors whose start is given in the recipe.
        town: the town.
    """
    (x0, x1), (y0, y1) = town.streets.bounds
    before: list[tuple[str, list[Disc]]] = []
    for actor in actors:
        place = base.place_of("actors", actor.name, "start")
        x, y = actor.start.x, actor.start.y
        if max(x0 - x, x - x1, y0 - y, y - y1) > FAR:
            spans = f"x {x0:g} to {x1:g} and y {y0:g} to {y1:g}"
            message = f"actors.{actor.name}.start: is far outside the town, whose bounds are {spans}"
            yield Problem(message, place, "move it into the town", Code.PLACEMENT)
        discs = _discs(actor)
        other = next((name for name, others in before if _touch(discs, others)), None)
        if other is not None:
            message = f"actors.{actor.name}.start: its body overlaps the body of {other}"
            yield Problem(message, place, "move one of them", Code.PLACEMENT)
        before.append((actor.name, discs))


def of_goals(base: Value, actors: Mapping[str, Actor], town: Town) -> Iterator[Problem]:
    """Yield warnings for goals and waypoints that are far from the town.

    Args:
        base: the recipe's base, for the places of its values.
        actors: the named actors.
        town: the town.
    """
    (x0, x1), (y0, y1) = town.streets.bounds
    for name, actor in actors.items():
        key, points = ("goal", (actor.goal,)) if actor.goal is not None else ("route", actor.route or ())
        if any(max(x0 - p.x, p.x - x1, y0 - p.y, p.y - y1) > FAR for p in points):
            spans = f"x {x0:g} to {x1:g} and y {y0:g} to {y1:g}"
            message = f"actors.{name}.{key}: leads far out of the town, whose bounds are {spans}"
            place = base.place_of("actors", name, key)
            yield Problem(message, place, "end it within the town", Code.PLACEMENT)


def of_vehicle_routes(
    base: Value, given: Mapping[str, Actor], actors: Sequence[ActorPlan], solid: ObstacleMap, clock: Clock
) -> Iterator[Problem]:
    """Yield warnings for vehicles that would meet something solid on a straight line of their route during the clip.

    Args:
        base: the recipe's base, for the places of its values.
        given: the named actors.
        actors: the plans of all actors.
        solid: the town's obstacles and the props that block the way.
        clock: the clock, which limits how far a vehicle gets.
    """
    routed = [
        actor
        for actor in actors
        if actor.category == "vehicle"
        and actor.route
        and actor.name in given
        and (given[actor.name].goal is not None or given[actor.name].route is not None)
    ]
    if not routed:
        return
    wide = solid.with_more((), reach=max(actor.shape["width"] for actor in routed) / 2)
    for actor in routed:
        seconds = clock.frames / clock.fps + (0.0 if actor.held else clock.warmup)
        met = _first_met(actor, wide, seconds)
        if met is not None:
            leg, name, x, y = met
            path: tuple[str | int, ...] = ("goal",) if given[actor.name].goal is not None else ("route", leg)
            label = "goal" if path == ("goal",) else f"route[{leg}]"
            message = f"actors.{actor.name}.{label}: the straight line to it meets {name} at x: {x:.1f}, y: {y:.1f}"
            place = base.place_of("actors", actor.name, *path)
            yield Problem(message, place, "lead it round, with waypoints as `route`", Code.PLACEMENT)


def of_directions(
    base: Value, given: Mapping[str, Actor], actors: Sequence[ActorPlan], town: Town
) -> Iterator[Problem]:
    """Yield warnings for vehicles that set out on a random route against the traffic of their side of the street.

    Args:
        base: the recipe's base, for the places of its values.
        given: the named actors.
        actors: the plans of all actors.
        town: the town.
    """
    for actor in actors:
        named = given.get(actor.name)
        if named is None or named.start is None or named.start.yaw is None or actor.category != "vehicle":
            continue
        if actor.route and named.goal is None and named.route is None:
            against = _against_traffic(town, actor.start, actor.route[0])
            if against is not None:
                message = f"actors.{actor.name}.start.yaw: with {named.start.yaw:g}, it sets out {against[0]}"
                place = base.place_of("actors", actor.name, "start", "yaw")
                yield Problem(message, place, f"{against[1]}, or leave it out", Code.PLACEMENT)


def _against_traffic(town: Town, start: Pose, ahead: Pose | Point) -> tuple[str, str] | None:
    """Return the end of a message and a remedy if the way to a point is against the traffic at its start, else None."""
    lane = town.streets.lane_yaw(start.x, start.y)
    s, c = exact.sin_cos_deg(lane)
    if c * (ahead.x - start.x) + s * (ahead.y - start.y) >= 0.0:
        return None
    yaw = lane if lane <= 180.0 else lane - 360.0
    return f"against the traffic on this side of the street, whose yaw is {yaw:g}", f"write yaw: {yaw:g}"


def _first_met(actor: ActorPlan, solid: ObstacleMap, seconds: float) -> tuple[int, str, float, float] | None:
    """Return the first obstacle that a vehicle meets on the lines of its route, as far as it can get in some seconds.

    Returns:
        The number of the line, the obstacle's name, and x and y of the vehicle's middle where half its width
            reaches it; None if all lines are free.
    """
    half, x0, y0 = actor.shape["width"] / 2, actor.start.x, actor.start.y
    left = actor.speed * seconds + actor.shape["length"] / 2
    for leg, point in enumerate(actor.route):
        dx, dy = point.x - x0, point.y - y0
        line, length = (x0, y0, point.x, point.y), math.sqrt(dx * dx + dy * dy)
        found = [(obstacle.entry(line, half), obstacle.name) for obstacle in solid.across(line, half)]
        if found:
            part, name = min(found)
            near = part * length <= left
            return (leg, name, x0 + part * (point.x - x0), y0 + part * (point.y - y0)) if near else None
        left, x0, y0 = left - length, point.x, point.y
    return None


def of_cameras(base: Value, rig: RigPlan, town: Town) -> Iterator[Problem]:
    """Yield warnings for cameras in places that are probably mistakes.

    These are cameras that are at any frame below the ground or inside a building, which has no interior, that are at
    every frame farther from the town than they see, or that set out along a road against its traffic. For a camera
    mounted on an actor, the ground is the height of the actor's origin.

    Args:
        base: the recipe's base, for the places of its values.
        rig: the sensors and their poses.
        town: the town.
    """
    houses = [element for element in town.plan.elements if element.kind in ("building", "house")]
    (x0, x1), (y0, y1) = town.streets.bounds
    for sensor in rig.sensors:
        poses = [] if sensor.on is not None else sensor.poses
        far = sensor.camera.far
        if poses and all(max(x0 - pose.x, pose.x - x1, y0 - pose.y, pose.y - y1) > far for pose in poses):
            spans = f"x {x0:g} to {x1:g} and y {y0:g} to {y1:g}"
            message = f"sensors.{sensor.name}: it is more than {far:g} m, its `far`, outside the town's bounds, {spans}"
            yield Problem(message, base.place_of("sensors", sensor.name, "mount"), "move the mount", Code.PLACEMENT)
        near = _about(houses, poses)
        inside = ((n, house) for n, pose in enumerate(poses) for house in near if _within(house, pose))
        frame, house = next(inside, (0, None))
        if house is not None:
            when = f" at frame {frame}" if frame else ""
            message = f"sensors.{sensor.name}: it is inside {house.name}{when}, which has no interior"
            place = base.place_of("sensors", sensor.name, "mount")
            yield Problem(message, place, "move the mount", Code.PLACEMENT)
        road = base.get("sensors", sensor.name, "motion", "route", "road")
        if poses and road is not None and road.plain is True:
            against = _against_traffic(town, poses[0], poses[min(len(poses) - 1, 10)])
            if against is not None:
                place = base.place_of("sensors", sensor.name, "mount")
                yield Problem(f"sensors.{sensor.name}: it sets out {against[0]}", place, against[1], Code.PLACEMENT)
        for frame, pose in enumerate(sensor.poses):
            ground = town.ground(pose.x, pose.y) if sensor.on is None else 0.0
            if pose.z <= ground:
                when = f" at frame {frame}" if frame else ""
                what = "the ground" if sensor.on is None else f"{sensor.on}'s feet"
                message = f"sensors.{sensor.name}: z is {pose.z:g}{when}, not above {what}, which is at {ground:g}"
                follows = base.get("sensors", sensor.name, "motion", "follow") is not None
                key = ("motion", "follow", "height") if follows else ("mount", "z")
                place = base.place_of("sensors", sensor.name, *key)
                yield Problem(message, place, "raise the mount", Code.PLACEMENT)
                break


def _about(houses: Sequence[Element], poses: Sequence[Pose]) -> list[Element]:
    """Return the houses whose enlarged bounding box intersects the bounding box of the poses."""
    if not poses:
        return []
    west, east = min(pose.x for pose in poses), max(pose.x for pose in poses)
    south, north = min(pose.y for pose in poses), max(pose.y for pose in poses)

    def meets(house: Element) -> bool:
        reach = house.size[0] + house.size[1]
        x, y = house.pose.x, house.pose.y
        return west - reach < x < east + reach and south - reach < y < north + reach

    return [house for house in houses if meets(house)]


def _within(house: Element, pose: Pose) -> bool:
    """Whether a pose is inside a building, below the eaves. The building's origin is the middle of its front."""
    depth, width, height = house.size
    dx, dy, up = pose.x - house.pose.x, pose.y - house.pose.y, pose.z - house.pose.z
    if abs(dx) + abs(dy) > depth + width or not 0.0 < up < height:
        return False
    s, c = exact.sin_cos_deg(house.pose.yaw)
    x, y = c * dx + s * dy, c * dy - s * dx
    return -depth < x < 0.0 and abs(y) < width / 2


def _discs(actor: ActorPlan) -> list[Disc]:
    """Approximate the ground plan of a body by discs in a row."""
    x, y = actor.start.x, actor.start.y
    if actor.category == "pedestrian":
        return [(x, y, _SHOULDER)]
    radius, length = actor.shape["width"] / 2, actor.shape["length"]
    count = max(2, math.ceil(length / (2 * radius)))
    s, c = exact.sin_cos_deg(actor.start.yaw)
    at = [(length / 2 - radius) * (2 * k / (count - 1) - 1) for k in range(count)]
    return [(x + c * a, y + s * a, radius) for a in at]


def _touch(one: Sequence[Disc], other: Sequence[Disc]) -> bool:
    ax, ay, _ = one[0]
    bx, by, _ = other[0]
    if abs(ax - bx) > 25.0 or abs(ay - by) > 25.0:  # longer than two buses
        return False
    return any((x - u) * (x - u) + (y - v) * (y - v) < (r + q) * (r + q) for x, y, r in one for u, v, q in other)
