"""How actors move: pedestrians walk and step aside, vehicles drive their lane and brake for what is ahead.

An actor decides thirty times a second, from where everyone is, and acts at every step by giving its base a velocity.
Plain arithmetic and `sqrt` only; no angle is measured where a cross product will do.
"""

from __future__ import annotations

import math
import zlib
from abc import ABC, abstractmethod
from collections.abc import Sequence

from recipe_compiler import exact
from recipe_compiler.plan import ActorPlan, ScenePlan, TownPlan

from recipe_runtime import gait
from recipe_runtime.bullet import GRAVITY, Quaternion, Vector, World
from recipe_runtime.meshes.skeleton import Figure, axle_shift, wheel_joints

_DEGREE = math.pi / 180.0
_WALK_ACCELERATION, _TURN_RATE, _STEP_RATE = 3.5, 6.0, 0.9  # m/s2, rad/s, m/s up and down kerbs
_SIDESTEP, _ROOM, _FORESIGHT = 0.55, 0.78, 2.5  # m/s, metres between two walkers' middles, seconds
_DRIVE_ACCELERATION, _BRAKING, _SIDEWAYS = 2.0, 3.0, 2.2  # m/s2


def _towards(value: float, target: float, most: float) -> float:
    return value + max(-most, min(most, target - value))


class Mover(ABC):
    """An actor's body in the world, and what drives it."""

    def __init__(self, world: World, actor: ActorPlan, body: int, links: tuple[int, ...], dt: float) -> None:
        self.actor, self.body, self.links = actor, body, links
        self._world, self._dt = world, dt
        self._route = [(point.x, point.y) for point in actor.route]
        self._next = 0
        self.x = self.y = self.z = 0.0
        self.heading = (1.0, 0.0)
        self.velocity = (0.0, 0.0)
        self._upright: tuple[float, float] = (0.0, 0.0)
        self.sense()

    def sense(self) -> None:
        """Read where the base is, which way it looks and how it moves."""
        (self.x, self.y, self.z), (qx, qy, qz, qw) = self._world.base(self.body)
        hx, hy = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qz * qw)
        length = math.sqrt(hx * hx + hy * hy)
        self.heading = (hx / length, hy / length)
        self._upright = (2.0 * (qx * qz + qy * qw), 2.0 * (qy * qz - qx * qw))  # where its z axis leans to
        (vx, vy, _), _ = self._world.velocity(self.body)
        self.velocity = (vx, vy)

    @property
    def moving(self) -> bool:
        """Whether it goes faster than 1 m/s."""
        return self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1] > 1.0

    @property
    def radius(self) -> float:
        """Half its width, metres."""
        return 0.13 * self.actor.shape["height"] if "hair" in self.actor.shape else self.actor.shape["width"] / 2

    @property
    def reach(self) -> float:
        """Half its length, metres."""
        return self.radius if "hair" in self.actor.shape else self.actor.shape["length"] / 2

    def parts(self) -> list[tuple[Vector, Quaternion]]:
        """Position and orientation of every part, the base first."""
        named = self.links[-(len(part_names(self.actor)) - 1) :]  # a vehicle's steering is no part
        return [self._world.base(self.body), *self._world.links(self.body, named)]

    @abstractmethod
    def decide(self, others: Sequence[Mover]) -> None:
        """Choose what to do, from where the others are."""

    @abstractmethod
    def act(self) -> None:
        """Give the base its velocity for the next step."""

    @abstractmethod
    def place_limbs(self) -> None:
        """Place joints by the distance covered in the last step."""


class Walker(Mover):
    """A pedestrian."""

    def __init__(self, world: World, actor: ActorPlan, dt: float) -> None:
        super().__init__(world, actor, *world.add_pedestrian(actor), dt)
        self._figure = Figure.of(actor.shape)
        self._phase = zlib.crc32(actor.name.encode()) / 2.0**32
        self._wish = (0.0, 0.0)
        self._going = (0.0, 0.0)
        self._sink = 0.0
        self.place_limbs()

    def decide(self, others: Sequence[Mover]) -> None:
        """Walk towards the next waypoint, slower before the goal, aside from whoever comes."""
        wish = self._towards_goal()
        if wish == (0.0, 0.0):
            self._wish = wish
            return
        if self._must_wait(wish, others):
            self._wish = (0.0, 0.0)
            return
        speed = math.sqrt(wish[0] * wish[0] + wish[1] * wish[1])
        ahead = (wish[0] / speed, wish[1] / speed)
        aside, slow = 0.0, 1.0
        for other in others:
            step, pace = self._yield_to(other, ahead, speed)
            aside = step if abs(step) > abs(aside) else aside
            slow = min(slow, pace)
        right = (ahead[1], -ahead[0])
        self._wish = (slow * wish[0] + aside * right[0], slow * wish[1] + aside * right[1])

    def _must_wait(self, wish: tuple[float, float], others: Sequence[Mover]) -> bool:
        """Whether, standing on a sidewalk, it would walk in front of a moving vehicle."""
        if self._world.ground.height(self.x, self.y) < 0.1:
            return False
        for other in others:
            dx, dy = self.x - other.x, self.y - other.y
            if not isinstance(other, Driver) or abs(dx) > 30.0 or abs(dy) > 30.0 or not other.moving:
                continue
            hx, hy = other.heading
            for k in range(1, 6):
                t = 0.5 * k
                px, py = dx + (wish[0] - other.velocity[0]) * t, dy + (wish[1] - other.velocity[1]) * t
                if abs(px * hx + py * hy) < other.reach + 0.8 and abs(py * hx - px * hy) < other.radius + 0.5:
                    return True
        return False

    def _towards_goal(self) -> tuple[float, float]:
        """Velocity towards the next waypoint, passing those that are reached."""
        while self._next < len(self._route):
            dx, dy = self._route[self._next][0] - self.x, self._route[self._next][1] - self.y
            distance = math.sqrt(dx * dx + dy * dy)
            last = self._next == len(self._route) - 1
            if distance > (0.02 if last else 0.5):
                speed = self.actor.speed
                if last:
                    speed = min(speed, 2.5 * distance, math.sqrt(2.0 * 1.8 * distance))
                return dx / distance * speed, dy / distance * speed
            self._next += 1
        return 0.0, 0.0

    def _yield_to(self, other: Mover, ahead: tuple[float, float], speed: float) -> tuple[float, float]:
        """A step to the right in m/s (negative: to the left), and a factor for the pace."""
        dx, dy = other.x - self.x, other.y - self.y
        if abs(dx) > 12.0 or abs(dy) > 12.0:
            return 0.0, 1.0
        gap = dx * ahead[0] + dy * ahead[1]
        side = dx * ahead[1] - dy * ahead[0]  # to the right of the way
        ux, uy = ahead[0] * speed - other.velocity[0], ahead[1] * speed - other.velocity[1]
        closing = ux * ahead[0] + uy * ahead[1]
        room = _ROOM + other.radius - 0.23
        if gap < -0.3 or closing < 0.05 or gap > max(2.5, _FORESIGHT * closing):
            return 0.0, 1.0
        time = max(gap, 0.0) / closing
        miss = side - (ux * ahead[1] - uy * ahead[0]) * time
        if abs(miss) >= room:
            return 0.0, 1.0
        left = miss > 0.12 and not isinstance(other, Driver)
        need = (room - abs(miss)) * (0.5 if isinstance(other, Walker) else 1.0)
        step = min(_SIDESTEP, need / max(time - 0.3, 0.35))
        near = gap < 0.7 and abs(side) < 0.45
        return (-step if left else step), (0.35 if near else 1.0)

    def act(self) -> None:
        """Walk upright, look where it goes, and keep the feet on the ground."""
        most = _WALK_ACCELERATION * self._dt
        self._going = (_towards(self._going[0], self._wish[0], most), _towards(self._going[1], self._wish[1], most))
        vx, vy = self._going
        speed = math.sqrt(vx * vx + vy * vy)
        turn = 0.0
        if speed > 0.15:
            sine = (self.heading[0] * vy - self.heading[1] * vx) / speed
            cosine = (self.heading[0] * vx + self.heading[1] * vy) / speed
            turn = 7.0 * (sine if cosine > 0 else (1.0 if sine >= 0 else -1.0))
            turn = max(-_TURN_RATE, min(_TURN_RATE, turn))
        target = self._world.ground.height(self.x, self.y) - self._sink
        rise = (target - self.z) / self._dt
        rise = max(-_STEP_RATE, min(_STEP_RATE, rise)) + GRAVITY * self._dt
        lean = self._upright
        self._world.set_velocity(self.body, (vx, vy, rise), (20.0 * lean[1], -20.0 * lean[0], turn))

    def place_limbs(self) -> None:
        """Advance the gait by the distance covered."""
        speed = math.sqrt(self.velocity[0] * self.velocity[0] + self.velocity[1] * self.velocity[1])
        self._phase += speed * self._dt / gait.stride(self._figure, speed)
        pose = gait.pose(self._figure, self._phase, speed)
        self._sink = pose.sink
        self._world.set_joints(self.body, self.links, pose.angles)


class Crossroads:
    """Right of way: a junction belongs to one vehicle at a time, to whoever comes near enough first."""

    def __init__(self, town: TownPlan) -> None:
        reach = 3.0  # from a junction's edge to the stop lines
        self._places = [(e.pose.x, e.pose.y, e.size[0] / 2 + reach) for e in town.elements if e.kind == "junction"]
        self._owners: dict[int, Driver] = {}

    def free_way(self, driver: Driver) -> float:
        """Metres that a vehicle may go before it must wait; it takes what it is near enough to take."""
        way = math.inf
        for n, (x, y, half) in enumerate(self._places):
            dx, dy = x - driver.x, y - driver.y
            mine = self._owners.get(n) is driver
            if abs(dx) > half + 60.0 or abs(dy) > half + 60.0:
                continue
            ahead = dx * driver.heading[0] + dy * driver.heading[1]
            aside = abs(dx * driver.heading[1] - dy * driver.heading[0])
            line = ahead - half - driver.reach
            inside = abs(dx) < half and abs(dy) < half
            leaving = max(abs(dx), abs(dy)) > half + driver.reach - 1.0 and ahead < 0.0
            if mine and (leaving or driver.arrived):
                del self._owners[n]
            elif inside and not driver.arrived:
                self._owners.setdefault(n, driver)
            elif not mine and -1.0 < line < driver.stopping + 3.0 and aside < 4.0:
                owner = self._owners.setdefault(n, driver)
                way = way if owner is driver else min(way, max(0.0, line))
        return way


class Driver(Mover):
    """A vehicle, steered as a bicycle towards a point of its route ahead."""

    def __init__(self, world: World, actor: ActorPlan, dt: float, crossroads: Crossroads) -> None:
        super().__init__(world, actor, *world.add_vehicle(actor), dt)
        self._crossroads, self.waiting = crossroads, False
        shape = actor.shape
        self._base = shape["wheelbase"]
        self._rear = shape["wheelbase"] / 2 - axle_shift(shape)  # the rear axle lies this far behind the origin
        self._route.insert(0, (self.x, self.y))
        self._limits = _speed_limits(self._route, actor.speed)
        self._wish = self._speed = self._curvature = self._rolled = self._steer = 0.0
        self.place_limbs()

    @property
    def arrived(self) -> bool:
        """Whether its route is behind it."""
        return self._next >= len(self._route) - 1

    @property
    def stopping(self) -> float:
        """Metres that it needs to stop gently."""
        return self._speed * self._speed / 4.0

    def decide(self, others: Sequence[Mover]) -> None:
        """Choose speed and steering."""
        way = self._crossroads.free_way(self)
        self.waiting = way < 60.0
        if self.arrived:
            self._wish = 0.0
            return
        along, aim = self._look_ahead()
        rx, ry = self.x - self._rear * self.heading[0], self.y - self._rear * self.heading[1]
        dx, dy = aim[0] - rx, aim[1] - ry
        square = dx * dx + dy * dy
        lateral = self.heading[0] * dy - self.heading[1] * dx
        tightest = 0.26 if self._base < 4 else 0.17
        self._curvature = max(-tightest, min(tightest, 2.0 * lateral / max(square, 1.0)))
        self._wish = min(self._limit(along), self._clear(others), math.sqrt(4.0 * min(way, 1e6)))

    def _look_ahead(self) -> tuple[float, tuple[float, float]]:
        """Metres to the end of the current leg, and the route's point to steer for."""
        while True:
            (ax, ay), (bx, by) = self._route[self._next], self._route[self._next + 1]
            length = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
            done = ((self.x - ax) * (bx - ax) + (self.y - ay) * (by - ay)) / max(length, 1e-9)
            if done < length or self._next >= len(self._route) - 2:
                break
            self._next += 1
        left, n = max(1.6, 0.45 * self._speed) - (length - done), self._next + 1
        while left > 0 and n < len(self._route) - 1:
            (ax, ay), (bx, by) = self._route[n], self._route[n + 1]
            length_n = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
            if left <= length_n:
                t = left / length_n
                return length - done, (ax + (bx - ax) * t, ay + (by - ay) * t)
            left, n = left - length_n, n + 1
        (ax, ay), (bx, by) = self._route[n - 1], self._route[n]
        size = max(math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay)), 1e-9)
        return length - done, (bx + left * (bx - ax) / size, by + left * (by - ay) / size)

    def _limit(self, along: float) -> float:
        """Speed that still allows every slower place ahead to be reached slowly enough."""
        if self._next >= len(self._route) - 2 and along < 0.05:
            self._next = len(self._route)
            return 0.0
        end = self._limits[self._next + 1]
        return min(self.actor.speed, math.sqrt(end * end + 2.0 * 1.6 * max(0.0, along)))

    def _clear(self, others: Sequence[Mover]) -> float:
        """Speed at which it can stop behind whatever stands or moves in its path."""
        wish = self.actor.speed
        for other in others:
            dx, dy = other.x - self.x, other.y - self.y
            if abs(dx) > 40.0 or abs(dy) > 40.0:
                continue
            gap = dx * self.heading[0] + dy * self.heading[1]
            bend = 0.5 * self._curvature * gap * gap if abs(gap) < 6 else 0.0
            side = self.heading[0] * dy - self.heading[1] * dx - bend
            same = other.heading[0] * self.heading[0] + other.heading[1] * self.heading[1]
            if isinstance(other, Driver) and other.waiting and same < 0.5:
                continue  # it stands at a stop line until this one has passed
            along = abs(same)
            wide = along * other.radius + (1.0 - along) * other.reach
            deep = along * other.reach + (1.0 - along) * other.radius
            if isinstance(other, Walker):
                side += (other.velocity[1] * self.heading[0] - other.velocity[0] * self.heading[1]) * 0.8
                wide += 0.5
            if gap > 0 and abs(side) < self.radius + wide + 0.35:
                free = gap - self.reach - deep - 1.8
                away = max(0.0, other.velocity[0] * self.heading[0] + other.velocity[1] * self.heading[1])
                wish = min(wish, math.sqrt(2.0 * _BRAKING * max(0.0, free) + away * away) if free > 0 else 0.0)
        return wish

    def act(self) -> None:
        """Roll along the curve; gravity, wheels and kerbs decide the rest."""
        faster = self._wish > self._speed
        self._speed = _towards(self._speed, self._wish, (_DRIVE_ACCELERATION if faster else 1.6 * _BRAKING) * self._dt)
        turn = self._speed * self._curvature
        hx, hy = self.heading
        aside = turn * self._rear
        (_, _, vz), _ = self._world.velocity(self.body)
        lean = self._upright
        self._world.set_velocity(
            self.body,
            (self._speed * hx - aside * hy, self._speed * hy + aside * hx, min(vz, 0.5)),
            (8.0 * lean[1], -8.0 * lean[0], turn),
        )

    def place_limbs(self) -> None:
        """Turn the wheels by the distance covered, and steer those in front."""
        forward = self.velocity[0] * self.heading[0] + self.velocity[1] * self.heading[1]
        self._rolled += forward * self._dt / self.actor.shape["wheel"]
        self._steer = _towards(self._steer, exact.atan2_deg(self._base * self._curvature, 1.0), 120.0 * self._dt)
        steer = self._steer * _DEGREE
        spin = self._rolled - 2.0 * math.pi * math.floor(self._rolled / (2.0 * math.pi) + 0.5)
        self._world.set_joints(self.body, self.links, [steer, steer, spin, spin, spin, spin])


def _speed_limits(route: Sequence[tuple[float, float]], speed: float) -> list[float]:
    """Speed at each waypoint: 0 at the goal, elsewhere what the bend there allows, and what braking later needs."""
    limits = [speed] * len(route)
    limits[-1] = 0.0
    for n in range(1, len(route) - 1):
        (ax, ay), (bx, by), (cx, cy) = route[n - 1], route[n], route[n + 1]
        ux, uy, wx, wy = bx - ax, by - ay, cx - bx, cy - by
        lu, lw = math.sqrt(ux * ux + uy * uy), math.sqrt(wx * wx + wy * wy)
        if lu < 1e-6 or lw < 1e-6:
            continue
        sine, cosine = abs(ux * wy - uy * wx) / (lu * lw), (ux * wx + uy * wy) / (lu * lw)
        bend = sine if cosine > 0 else 2.0 - sine
        curvature = bend / min(4.0, max(lu, lw, 1.0)) if bend > 0.02 else 0.0
        if curvature > 0.0:
            limits[n] = min(speed, max(1.2, math.sqrt(_SIDEWAYS / curvature)))
    for n in range(len(route) - 2, -1, -1):
        dx, dy = route[n + 1][0] - route[n][0], route[n + 1][1] - route[n][1]
        limits[n] = min(limits[n], math.sqrt(limits[n + 1] * limits[n + 1] + 3.2 * math.sqrt(dx * dx + dy * dy)))
    return limits


def movers(world: World, scene: ScenePlan) -> list[Mover]:
    """All actors, set into the world in plan order."""
    dt, crossroads = 1.0 / scene.clock.physics, Crossroads(scene.town)
    return [
        Walker(world, actor, dt) if actor.category == "pedestrian" else Driver(world, actor, dt, crossroads)
        for actor in scene.actors
    ]


def part_names(actor: ActorPlan) -> tuple[str, ...]:
    """Names of an actor's parts in the Trace's order, its base first."""
    if actor.category == "pedestrian":
        return ("pelvis", *(joint.part for joint in Figure.of(actor.shape).joints))
    return ("chassis", *(joint.part for joint in wheel_joints(actor.shape)))
