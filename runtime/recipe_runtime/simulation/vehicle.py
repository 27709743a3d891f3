"""Vehicles: they drive the lane, take turns at junctions, and stop behind what stands before them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, TownPlan

from recipe_runtime.body import riding
from recipe_runtime.body.kinematics import Placed, Quaternion, about, then
from recipe_runtime.body.skeleton import Bike, axle_shift, has_rider, is_parked, is_person
from recipe_runtime.simulation.agent import Mover, towards
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.path import Way

_ACCELERATION, _BRAKING, _SIDEWAYS = 2.0, 3.0, 2.2  # m/s2
_STEERING = 90.0  # degrees a second that the front wheels turn
_LOCK = 0.27  # 1/m, the tightest curve of whatever drives, and ...
_SLOPE = 1.3  # ... the tangent of the steepest angle of its front wheels
_NEAREST = 1.7  # metres ahead of the rear axle that it steers for at least
_BEHIND, _PREPARE = 1.5, 6.0  # metres from the rear axle back, from the front axle on, where bends matter
_TIP = 50.0  # degrees a second that a two-wheeler leans over


class Crossroads:
    """Right of way: a junction belongs to one vehicle at a time, to whoever comes near enough first."""

    def __init__(self, town: TownPlan) -> None:
        reach = 4.5  # from a junction's edge to where one waits: behind the stop line, clear of a bus that turns in
        self._places = [
            (e.pose.x, e.pose.y, e.size[0] / 2 + reach, e.size[1] / 2 + reach)
            for e in town.elements
            if e.kind == "junction"
        ]
        self._owners: dict[int, Driver] = {}

    def free_way(self, driver: Driver) -> float:
        """Metres that a vehicle may go before it must wait; it takes what it is near enough to take."""
        way = math.inf
        for n, (x, y, half_x, half_y) in enumerate(self._places):
            dx, dy = x - driver.x, y - driver.y
            mine = self._owners.get(n) is driver
            if abs(dx) > half_x + 60.0 or abs(dy) > half_y + 60.0:
                continue
            ahead = dx * driver.heading[0] + dy * driver.heading[1]
            aside = abs(dx * driver.heading[1] - dy * driver.heading[0])
            half = half_x if abs(driver.heading[0]) > abs(driver.heading[1]) else half_y
            line = ahead - half - driver.reach
            inside = abs(dx) < half_x and abs(dy) < half_y
            leaving = max(abs(dx) - half_x, abs(dy) - half_y) > driver.reach - 1.0 and ahead < 0.0
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
        super().__init__(world, actor, world.add_vehicle(actor, fixed=is_parked(actor)), dt)
        self._crossroads = crossroads
        shape = actor.shape
        self._base = shape["wheelbase"]
        self._rear = shape["wheelbase"] / 2 - axle_shift(shape)  # the rear axle lies this far behind the origin
        self._tightest = min(_LOCK, _SLOPE / self._base)
        self._route.insert(0, (self.x, self.y))
        self._way, self._front_way = Way(self._route), Way(self._route)
        self._limits = _speed_limits(self._route, actor.speed)
        self._wish = self._speed = self._curvature = self._gone = self._steer = 0.0
        self._aimed = 0.0  # degrees that the front wheels are to be turned to

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
        self._aimed = self._steering()
        self._wish = min(self._limit(self._left_of_leg()), self._clear(others), math.sqrt(4.0 * min(way, 1e6)))

    def _steering(self) -> float:
        """Degrees to turn the front wheels to.

        In a bend the rear wheels run inside of the front ones. To the left, where there is road inside, the front
        axle keeps to the lane and the rear cuts in; to the right, where the kerb is, the front swings out.
        """
        hx, hy = self.heading
        x, y = self.x - self._rear * hx, self.y - self._rear * hy
        here = self._way.reached(x, y)
        steer = self._by_front(x + self._base * hx, y + self._base * hy)
        if self._next_bend(here) < 0.0:
            steer = self._by_rear(x, y, here)
        lock = exact.atan2_deg(self._base * self._tightest, 1.0)
        return max(-lock, min(lock, steer))

    def _next_bend(self, here: float) -> float:
        """Curvature of the first bend from the rear axle on, as far as a turn must be prepared; 0 if there is none."""
        ahead = -_BEHIND
        while ahead < self._base + _PREPARE:
            bend, _ = self._way.bend(here + ahead)
            if abs(bend) > 0.03:
                return bend
            ahead += 1.0
        return 0.0

    def _by_front(self, x: float, y: float) -> float:
        """Steer the front axle along the way, after S. Thrun et al., Stanley (Journal of Field Robotics, 2006)."""
        here = self._front_way.reached(x, y)
        _, left = self._way.bend(here + 0.3)
        px, py = self._way.at(here)
        aside = (px - x) * left[0] + (py - y) * left[1]
        tx, ty = left[1], -left[0]
        hx, hy = self.heading
        return exact.atan2_deg(hx * ty - hy * tx, hx * tx + hy * ty) + exact.atan2_deg(1.5 * aside, self._speed + 1.0)

    def _by_rear(self, x: float, y: float, here: float) -> float:
        """Steer the rear axle to a point of the way ahead: pure pursuit (R. C. Coulter, 1992)."""
        ahead = here + max(_NEAREST, 0.45 * self._speed)
        px, py = self._way.at(ahead)
        dx, dy = px - x, py - y
        lateral = self.heading[0] * dy - self.heading[1] * dx
        return exact.atan2_deg(self._base * 2.0 * lateral, max(dx * dx + dy * dy, 1.0))

    def _left_of_leg(self) -> float:
        """Metres to the end of the route's leg that it is on."""
        while True:
            (ax, ay), (bx, by) = self._route[self._next], self._route[self._next + 1]
            length = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
            done = ((self.x - ax) * (bx - ax) + (self.y - ay) * (by - ay)) / max(length, 1e-9)
            if done < length or self._next >= len(self._route) - 2:
                return length - done
            self._next += 1

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
            if other.waiting and same < 0.5:
                continue  # it stands at a stop line until this one has passed
            along = abs(same)
            wide = along * other.radius + (1.0 - along) * other.reach
            deep = along * other.reach + (1.0 - along) * other.radius
            if is_person(other.actor.shape):
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
        self._speed = towards(self._speed, self._wish, (_ACCELERATION if faster else 1.6 * _BRAKING) * self._dt)
        self._steer = towards(self._steer, self._aimed, _STEERING * self._dt)
        sine, cosine = exact.sin_cos_deg(self._steer)
        self._curvature = sine / (cosine * self._base)
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

    def advance(self) -> None:
        """Count the distance rolled."""
        self._gone += (self.velocity[0] * self.heading[0] + self.velocity[1] * self.heading[1]) * self._dt

    def _turns(self) -> Sequence[Quaternion]:
        """The wheels roll the distance gone, each about its steered axle: the inner one is turned more (Ackermann)."""
        shape = self.actor.shape
        rolled = self._gone / (2.0 * math.pi * shape["wheel"])
        spin = about("y", 360.0 * (rolled - math.floor(rolled)))
        half = shape["width"] / 2 - 0.13
        steered = [
            about("z", exact.atan2_deg(self._base * self._curvature, 1.0 - s * half * self._curvature)) for s in (1, -1)
        ]
        return [then(steered[0], spin), then(steered[1], spin), spin, spin]


class Parked(Driver):
    """A vehicle that nobody drives: it stands where it was put, whatever touches it."""

    def decide(self, others: Sequence[Mover]) -> None:
        """Nobody decides."""

    def act(self) -> None:
        """Nothing moves it."""


class Rider(Driver):
    """A two-wheeler and who rides it: steered like a car, and leaning into its curves."""

    def __init__(self, world: World, actor: ActorPlan, dt: float, crossroads: Crossroads) -> None:
        super().__init__(world, actor, dt, crossroads)
        self._bike = Bike.of(actor.shape)
        self._halt = riding.halting(0.0)
        self._lean = riding.resting_lean(self._bike, self._halt)  # degrees to the left

    def advance(self) -> None:
        """Count the distance rolled, and lean until weight and centrifugal force balance."""
        super().advance()
        force = self._speed * self._speed * self._curvature / 9.81
        self._halt = towards(self._halt, riding.halting(self._speed), 2.0 * self._dt)
        lean = exact.atan2_deg(force, 1.0) + riding.resting_lean(self._bike, self._halt)
        self._lean = towards(self._lean, lean, _TIP * self._dt)

    def _stance(self) -> Placed:
        """Leaning about its tyres, which stay on the ground."""
        (x, y, z), orientation = super()._stance()
        lift = self._bike.tyre * (1.0 - exact.cos_deg(self._lean))
        return (x, y, z + lift), then(orientation, about("x", -self._lean))

    def _turns(self) -> Sequence[Quaternion]:
        return riding.pose(self._bike, steer=self._steer, gone=self._gone, halt=self._halt)


def driver(world: World, actor: ActorPlan, dt: float, crossroads: Crossroads) -> Driver:
    """Who drives a vehicle."""
    kind = Rider if has_rider(actor.shape) else Parked if is_parked(actor) else Driver
    return kind(world, actor, dt, crossroads)


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
