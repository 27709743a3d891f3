"""Vehicle agents: they follow the lane, yield at junctions, and stop behind obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, TownPlan

from recipe_runtime.body import riding
from recipe_runtime.body.kinematics import PartPose, Quaternion, axis_rotation, compose
from recipe_runtime.body.skeleton import Bike, axle_shift, has_rider, is_parked, is_person
from recipe_runtime.simulation.agent import Agent, move_towards
from recipe_runtime.simulation.bullet import World
from recipe_runtime.simulation.path import Path

_ACCELERATION, _BRAKING, _SIDEWAYS = 2.0, 3.0, 2.2  # m/s2
_STEERING = 90.0  # steering rate of the front wheels, degrees/s
_LOCK = 0.27  # largest curvature of any vehicle's path, 1/m
_SLOPE = 1.3  # tangent of the largest steering angle
_NEAREST = 1.7  # shortest look-ahead distance from the rear axle, metres
_BEHIND, _PREPARE = 1.5, 6.0  # metres behind the rear axle and ahead of the front axle where bends count
_TIP = 50.0  # lean rate of a two-wheeler, degrees/s


class JunctionReservations:
    """Right of way: a junction is reserved for one vehicle at a time, first come, first served."""

    def __init__(self, town: TownPlan) -> None:
        reach = 4.5  # from the junction's edge to the waiting position, clear of a turning bus
        self._areas = [
            (e.pose.x, e.pose.y, e.size[0] / 2 + reach, e.size[1] / 2 + reach)
            for e in town.elements
            if e.kind == "junction"
        ]
        self._holders: dict[int, VehicleAgent] = {}

    def distance_to_stop_line(self, driver: VehicleAgent) -> float:
        """Return the distance in metres to the stop line at which a vehicle must wait, or infinity if there is none.

        Free junctions within the vehicle's stopping distance are reserved for it.
        """
        way = math.inf
        for n, (x, y, half_x, half_y) in enumerate(self._areas):
            dx, dy = x - driver.x, y - driver.y
            mine = self._holders.get(n) is driver
            if abs(dx) > half_x + 60.0 or abs(dy) > half_y + 60.0:
                continue
            ahead = dx * driver.heading[0] + dy * driver.heading[1]
            aside = abs(dx * driver.heading[1] - dy * driver.heading[0])
            half = half_x if abs(driver.heading[0]) > abs(driver.heading[1]) else half_y
            line = ahead - half - driver.reach
            inside = abs(dx) < half_x and abs(dy) < half_y
            leaving = max(abs(dx) - half_x, abs(dy) - half_y) > driver.reach - 1.0 and ahead < 0.0
            if mine and (leaving or driver.arrived):
                del self._holders[n]
            elif inside and not driver.arrived:
                self._holders.setdefault(n, driver)
            elif not mine and -1.0 < line < driver.stopping_distance + 3.0 and aside < 4.0:
                owner = self._holders.setdefault(n, driver)
                way = way if owner is driver else min(way, max(0.0, line))
        return way


class VehicleAgent(Agent):
    """A vehicle that follows its route, with the kinematic bicycle model."""

    def __init__(self, world: World, actor: ActorPlan, dt: float, junctions: JunctionReservations) -> None:
        super().__init__(world, actor, world.add_vehicle(actor, fixed=is_parked(actor)), dt)
        self._junctions = junctions
        shape = actor.shape
        self._base = shape["wheelbase"]
        self._rear = shape["wheelbase"] / 2 - axle_shift(shape)  # the rear axle lies this far behind the origin
        self._max_curvature = min(_LOCK, _SLOPE / self._base)
        self._route.insert(0, (self.x, self.y))
        self._rear_path, self._front_path = Path(self._route), Path(self._route)
        self._limits = _speed_limits(self._route, actor.speed)
        self._desired = self._speed = self._curvature = self._distance = self._steer = 0.0
        self._steer_target = 0.0  # degrees

    @property
    def arrived(self) -> bool:
        """Whether it has reached the end of its route."""
        return self._next >= len(self._route) - 1

    @property
    def stopping_distance(self) -> float:
        """Distance of a comfortable stop from the current speed, metres."""
        return self._speed * self._speed / 4.0

    def choose_motion(self, others: Sequence[Agent]) -> None:
        """Choose the desired speed and steering angle."""
        way = self._junctions.distance_to_stop_line(self)
        self.waiting = way < 60.0
        if self.arrived:
            self._desired = 0.0
            return
        self._steer_target = self._steering()
        self._desired = min(
            self._braking_limit(self._remaining_on_leg()), self._following_speed(others), math.sqrt(4.0 * min(way, 1e6))
        )

    def _steering(self) -> float:
        """Return the target steering angle in degrees.

        In a bend, the rear wheels take a tighter path than the front wheels. In left bends, which have road on the
        inside, the front axle follows the lane. In right bends, which have the kerb on the inside, the rear axle does.
        """
        hx, hy = self.heading
        x, y = self.x - self._rear * hx, self.y - self._rear * hy
        here = self._rear_path.project(x, y)
        steer = self._steer_by_stanley(x + self._base * hx, y + self._base * hy)
        if self._next_curvature(here) < 0.0:
            steer = self._steer_by_pursuit(x, y, here)
        lock = exact.atan2_deg(self._base * self._max_curvature, 1.0)
        return max(-lock, min(lock, steer))

    def _next_curvature(self, here: float) -> float:
        """Return the curvature of the first bend from the rear axle to the preparation distance; 0 if there is none."""
        ahead = -_BEHIND
        while ahead < self._base + _PREPARE:
            bend, _ = self._rear_path.curvature(here + ahead)
            if abs(bend) > 0.03:
                return bend
            ahead += 1.0
        return 0.0

    def _steer_by_stanley(self, x: float, y: float) -> float:
        """Steer the front axle along the path, after S. Thrun et al., Stanley (Journal of Field Robotics, 2006)."""
        here = self._front_path.project(x, y)
        _, left = self._rear_path.curvature(here + 0.3)
        px, py = self._rear_path.at(here)
        aside = (px - x) * left[0] + (py - y) * left[1]
        tx, ty = left[1], -left[0]
        hx, hy = self.heading
        return exact.atan2_deg(hx * ty - hy * tx, hx * tx + hy * ty) + exact.atan2_deg(1.5 * aside, self._speed + 1.0)

    def _steer_by_pursuit(self, x: float, y: float, here: float) -> float:
        """Steer the rear axle to a point of the path ahead: pure pursuit (R. C. Coulter, 1992)."""
        ahead = here + max(_NEAREST, 0.45 * self._speed)
        px, py = self._rear_path.at(ahead)
        dx, dy = px - x, py - y
        lateral = self.heading[0] * dy - self.heading[1] * dx
        return exact.atan2_deg(self._base * 2.0 * lateral, max(dx * dx + dy * dy, 1.0))

    def _remaining_on_leg(self) -> float:
        """Return the distance in metres to the end of the current leg of the route."""
        while True:
            (ax, ay), (bx, by) = self._route[self._next], self._route[self._next + 1]
            length = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
            done = ((self.x - ax) * (bx - ax) + (self.y - ay) * (by - ay)) / max(length, 1e-9)
            if done < length or self._next >= len(self._route) - 2:
                return length - done
            self._next += 1

    def _braking_limit(self, along: float) -> float:
        """Return the highest speed from which the vehicle can brake to the speed limit at the end of the leg.

        Args:
            along: distance to the end of the leg, metres.
        """
        if self._next >= len(self._route) - 2 and along < 0.05:
            self._next = len(self._route)
            return 0.0
        end = self._limits[self._next + 1]
        return min(self.actor.speed, math.sqrt(end * end + 2.0 * 1.6 * max(0.0, along)))

    def _following_speed(self, others: Sequence[Agent]) -> float:
        """Return the highest speed from which the vehicle can stop behind every agent in its path, m/s."""
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
                continue  # the other vehicle waits at a stop line until this one has passed
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

    def apply_velocity(self) -> None:
        """Set the velocity along the current curve. Gravity and contacts determine the vertical motion and the tilt."""
        faster = self._desired > self._speed
        self._speed = move_towards(self._speed, self._desired, (_ACCELERATION if faster else 1.6 * _BRAKING) * self._dt)
        self._steer = move_towards(self._steer, self._steer_target, _STEERING * self._dt)
        sine, cosine = exact.sin_cos_deg(self._steer)
        self._curvature = sine / (cosine * self._base)
        turn = self._speed * self._curvature
        hx, hy = self.heading
        aside = turn * self._rear
        (_, _, vz), _ = self._world.velocity(self.body)
        lean = self._tilt
        self._world.set_velocity(
            self.body,
            (self._speed * hx - aside * hy, self._speed * hy + aside * hx, min(vz, 0.5)),
            (8.0 * lean[1], -8.0 * lean[0], turn),
        )

    def update_distance(self) -> None:
        """Add the distance covered in the last step."""
        self._distance += (self.velocity[0] * self.heading[0] + self.velocity[1] * self.heading[1]) * self._dt

    def _joint_rotations(self) -> Sequence[Quaternion]:
        """Return the rotations of the wheels: rolling and, in front, steering with Ackermann geometry."""
        shape = self.actor.shape
        rolled = self._distance / (2.0 * math.pi * shape["wheel"])
        spin = axis_rotation("y", 360.0 * (rolled - math.floor(rolled)))
        half = shape["width"] / 2 - 0.13
        steered = [
            axis_rotation("z", exact.atan2_deg(self._base * self._curvature, 1.0 - s * half * self._curvature))
            for s in (1, -1)
        ]
        return [compose(steered[0], spin), compose(steered[1], spin), spin, spin]


class ParkedVehicle(VehicleAgent):
    """A vehicle that never moves."""

    def choose_motion(self, others: Sequence[Agent]) -> None:
        """Do nothing."""

    def apply_velocity(self) -> None:
        """Do nothing."""


class TwoWheeler(VehicleAgent):
    """A two-wheeler with its rider: it is steered like a car and leans into bends."""

    def __init__(self, world: World, actor: ActorPlan, dt: float, junctions: JunctionReservations) -> None:
        super().__init__(world, actor, dt, junctions)
        self._bike = Bike.of(actor.shape)
        self._foot_weight = riding.foot_down(0.0)
        self._lean = riding.resting_lean(self._bike, self._foot_weight)  # degrees to the left

    def update_distance(self) -> None:
        """Add the distance covered, and lean towards the angle that balances weight and centrifugal force."""
        super().update_distance()
        force = self._speed * self._speed * self._curvature / 9.81
        self._foot_weight = move_towards(self._foot_weight, riding.foot_down(self._speed), 2.0 * self._dt)
        lean = exact.atan2_deg(force, 1.0) + riding.resting_lean(self._bike, self._foot_weight)
        self._lean = move_towards(self._lean, lean, _TIP * self._dt)

    def _base_pose(self) -> PartPose:
        """Return the pose of the base, which leans about the contact line of the tyres."""
        (x, y, z), orientation = super()._base_pose()
        lift = self._bike.tyre * (1.0 - exact.cos_deg(self._lean))
        return (x, y, z + lift), compose(orientation, axis_rotation("x", -self._lean))

    def _joint_rotations(self) -> Sequence[Quaternion]:
        return riding.pose(self._bike, steer=self._steer, distance=self._distance, foot_weight=self._foot_weight)


def create_vehicle(world: World, actor: ActorPlan, dt: float, junctions: JunctionReservations) -> VehicleAgent:
    """Create the agent of a vehicle."""
    kind = TwoWheeler if has_rider(actor.shape) else ParkedVehicle if is_parked(actor) else VehicleAgent
    return kind(world, actor, dt, junctions)


def _speed_limits(route: Sequence[tuple[float, float]], speed: float) -> list[float]:
    """Return the speed limit at each waypoint in m/s: 0 at the goal, elsewhere by curvature and by later limits."""
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
