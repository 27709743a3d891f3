"""Vehicle agents: they carry out a driver's commands within the limits of steering, engine, brakes and tyres."""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, Pose

from recipe_runtime.body import riding
from recipe_runtime.body.kinematics import IDENTITY, PartPose, Quaternion, Vector, axis_rotation, compose
from recipe_runtime.body.skeleton import Bike, axle_shift, has_rider, is_parked, is_person, wheel_joints
from recipe_runtime.simulation.agent import STANDSTILL, Agent, move_towards
from recipe_runtime.simulation.bullet import World, orientation
from recipe_runtime.simulation.chassis.kinds import GRIP, vehicle_kind, yaw_inertia
from recipe_runtime.simulation.chassis.steering import Steering
from recipe_runtime.simulation.chassis.suspension import Suspension, Wheels
from recipe_runtime.simulation.path import Path
from recipe_runtime.simulation.traffic.driver import Command, Driver
from recipe_runtime.simulation.traffic.reversing import REVERSE_SPEED

_STEERING = 1.57  # steering rate of the front wheels, rad/s
_STOPPING = 5.0  # m/s2, after a collision
_BACK = 3.0  # metres behind its rear from which it is projected onto the path while it reverses
_HARD, _HIT = 0.3, 0.01  # m/s, change of the speed that stops it: by anything, and by a person while it moves
_REVERSING = 0.8  # m/s2, acceleration when it reverses
_TIP = 50.0  # lean rate of a two-wheeler, degrees/s


class VehicleAgent(Agent):
    """A vehicle that follows its route: a kinematic bicycle model within the grip of the tyres.

    Attributes:
        path: What it follows: its start and its route.
        progress: Arc length of its middle on the path, metres.
        offset: Metres that its middle is to the left of the path.
        driver: Makes its decisions.
    """

    def __init__(self, world: World, actor: ActorPlan, control_dt: float, driver: Driver) -> None:
        shape = actor.shape
        self._kind = vehicle_kind(shape)
        inertia = yaw_inertia(self._kind.mass, shape["length"], shape["width"])
        super().__init__(world, actor, world.add_vehicle(actor, self.mass, inertia), control_dt)
        self.driver = driver
        self._base = shape["wheelbase"]
        self._rear = shape["wheelbase"] / 2 - axle_shift(shape)  # the rear axle lies this far behind the origin
        self._twist = GRIP * self._base / 2 * self._kind.mass / inertia  # rad/s2, the most by the tyres
        self._command = Command(0.0)
        self._steer = 0.0  # tangent of the angle
        self._stand: tuple[float, float, Quaternion] | None = (self.x, self.y, self._yaw())  # where it stands
        self._distance = 0.0  # metres that its wheels have rolled
        self._wheels = self._wheel_places()
        self._suspension = Suspension.on_ground(self._wheels, world.ground, (self.x, self.y), self.heading)
        self._tilt_rates = (0.0, 0.0)
        self.z = self._suspension.height
        self._follow_path(Path([(self.x, self.y), *((point.x, point.y) for point in actor.route)]))

    def _follow_path(self, path: Path) -> None:
        self.path = path
        self._leg = 0
        self._steering = Steering(path, self._base, self._rear)
        self.progress, self.offset, self._leg = path.locate(self.x, self.y, 0)

    @property
    def mass(self) -> float:
        """Kilograms, with driver and rider."""
        return self._kind.mass

    @property
    def curvature(self) -> float:
        """Curvature of the path that corresponds to the steering angle, 1/m, positive to the left."""
        return self._steer / self._base

    @property
    def halted(self) -> bool:
        """Whether it is stopped because of a collision."""
        return self._stands_until > -math.inf

    @property
    def arrived(self) -> bool:
        """Whether it is at the end of its path."""
        return self.progress >= self.path.length - 0.5

    @property
    def entry(self) -> Pose:
        """Where it enters the scene again: at the beginning of the lane in which it has left."""
        pose, aside = self.actor.entry, self.driver.lane_offset
        assert pose is not None
        sine, cosine = exact.sin_cos_deg(pose.yaw)
        return Pose(x=pose.x - aside * sine, y=pose.y + aside * cosine, yaw=pose.yaw)

    def enter(self, pose: Pose, speed: float) -> None:
        """Enter the scene again, and follow the rest of the route."""
        super().enter(pose, speed)
        self._suspension = Suspension.on_ground(self._wheels, self._world.ground, (self.x, self.y), self.heading)
        self.z = self._suspension.height
        self._steer, self._stand = 0.0, None
        aside = self.driver.lane_offset
        self.driver.lateral.stay(aside)
        hx, hy = self.heading
        route = [(p.x, p.y) for p in self.actor.route]
        ahead = next((n for n, (x, y) in enumerate(route) if (x - self.x) * hx + (y - self.y) * hy > 0.0), len(route))
        self._follow_path(Path([(self.x + aside * hy, self.y - aside * hx), *route[ahead:]]))

    def collide(self, other: Agent | None, impulse: float, seconds: float) -> None:
        """Brake and stop after a hard collision, or after hitting a person while it moves."""
        person = other is not None and is_person(other.actor.shape) and self.moving
        if impulse / self.mass > (_HIT if person else _HARD):
            self.stand_still(seconds + STANDSTILL)

    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Let the driver decide."""
        if seconds >= self._stands_until:
            self._stands_until = -math.inf
        self._command = self.driver.decide(self, others, seconds)
        self.waiting, self.sight = self.driver.waiting, self.driver.horizon

    def control(self) -> None:
        """Steer, accelerate and brake within the limits of engine and tyres until the next call."""
        hx, hy = self.heading
        vx, vy = self.velocity
        ahead, left, turn = vx * hx + vy * hy, vy * hx - vx * hy, self.yaw_rate
        speed = self._wanted_speed(ahead)
        if speed == 0.0 == ahead == left == turn:
            return
        self._steer_to_path(max(ahead, 0.0))
        wanted_turn = speed * self._steer / self._base
        new_turn = move_towards(turn, wanted_turn, self._twist * self._dt)
        half = 0.5 * new_turn * self._dt  # it turns by twice this angle before the next call
        aside = wanted_turn * self._rear
        change = self._limited(speed - aside * half - ahead, aside + speed * half - left)
        if change == (0.0, 0.0) and new_turn == turn:
            return
        ahead, left = ahead + change[0], left + change[1]
        if speed == ahead == left == new_turn == 0.0:  # from now on its tyres withstand what pushes it
            self._stand = self._stand or (self.x, self.y, self._yaw())
            self._world.place(self.body, *self._stand)
            return
        self._stand = None
        self._world.set_velocity(self.body, ahead * hx - left * hy, ahead * hy + left * hx, new_turn)

    def _wanted_speed(self, ahead: float) -> float:
        """Return the speed at the next call, m/s, from the speed along the heading now."""
        if self.held or not self.actor.route:
            return move_towards(ahead, 0.0, _STOPPING * self._dt)
        reverses = self._command.reverse
        if self._stands_until > -math.inf or (ahead < 0.0 and not reverses):
            return move_towards(ahead, 0.0, _STOPPING * self._dt)
        if reverses:
            return move_towards(ahead, -REVERSE_SPEED, _REVERSING * self._dt)
        kind = self._kind
        return max(0.0, ahead + max(-kind.brake, min(kind.drive, self._command.acceleration)) * self._dt)

    def _steer_to_path(self, speed: float) -> None:
        self.driver.lateral.advance(speed, self._dt)
        if self._stands_until == -math.inf:
            if self._command.reverse:
                self._leg = self._steering.go_back(self.progress - self.reach - _BACK)
            target = self._steering.target((self.x, self.y), self.heading, speed, self.driver.lateral)
            target = -target if self._command.reverse else target  # turns it as it would turn on its way forwards
            rate = (1.0 + self._steer * self._steer) * _STEERING
            self._steer = move_towards(self._steer, target, rate * self._dt)

    def _limited(self, ahead: float, left: float) -> tuple[float, float]:
        """Limit a desired change of velocity (m/s, ahead and to the left) to the grip of the tyres."""
        most, grip = self._kind.brake * self._dt, GRIP * self._dt
        if -most <= ahead <= most and ahead * ahead + left * left <= grip * grip:
            return ahead, left
        ahead = max(-most, min(most, ahead))
        most = math.sqrt(max(0.0, grip * grip - ahead * ahead))
        return ahead, max(-most, min(most, left))

    def velocities(self) -> tuple[Vector, Vector]:
        """Linear and angular velocity of the base; without a two-wheeler's lean."""
        linear, _ = super().velocities()
        (roll, pitch), (hx, hy) = self._tilt_rates, self.heading
        return linear, (roll * hx - pitch * hy, roll * hy + pitch * hx, self.yaw_rate)

    def _wheel_places(self) -> Wheels:
        return tuple((joint.offset[0], joint.offset[1]) for joint in wheel_joints(self.actor.shape))

    def _follow(self, dx: float, dy: float, seconds: float) -> bool:
        """Roll the wheels by the distance covered along the heading, and follow the ground."""
        self._distance += dx * self.heading[0] + dy * self.heading[1]
        before = self._suspension
        self._suspension = before.moved(self._world.ground, (self.x, self.y), self.heading, seconds)
        if self._suspension is before:
            self.vertical_speed, self._tilt_rates = 0.0, (0.0, 0.0)
        else:
            self.vertical_speed = (self._suspension.height - before.height) / seconds
            self._tilt_rates = self._suspension.tilt_rates(before, seconds)
            self.z = self._suspension.height
        self.progress, self.offset, self._leg = self.path.locate(self.x, self.y, self._leg)
        return self._suspension is before

    def base_pose(self) -> PartPose:
        """Return the position and orientation of the chassis."""
        tilt = self._suspension.tilt
        return (self.x, self.y, self.z), self._yaw() if tilt is IDENTITY else compose(self._yaw(), tilt)

    def pose_row(self) -> Sequence[float]:
        """Return the state from which its pose is computed."""
        place, turn = self.base_pose()
        return (*place, *turn, self._distance, self.curvature)


class ParkedVehicle(VehicleAgent):
    """A vehicle that never moves."""

    def __init__(self, world: World, actor: ActorPlan, control_dt: float, driver: Driver) -> None:
        super().__init__(world, actor, control_dt, driver)
        self.z = actor.start.z

    @property
    def mass(self) -> float:
        """0, which makes it a static body in the engine."""
        return 0.0

    def read(self, seconds: float) -> None:
        """Do nothing."""

    def decide(self, others: Sequence[Agent], seconds: float) -> None:
        """Do nothing."""

    def control(self) -> None:
        """Do nothing."""

    def collide(self, other: Agent | None, impulse: float, seconds: float) -> None:
        """Do nothing."""

    def base_pose(self) -> PartPose:
        """Return the pose where it is parked."""
        start = self.actor.start
        return (start.x, start.y, start.z), orientation(start)


class TwoWheeler(VehicleAgent):
    """A two-wheeler with its rider: it is steered like a car and leans into bends."""

    def __init__(self, world: World, actor: ActorPlan, control_dt: float, driver: Driver) -> None:
        super().__init__(world, actor, control_dt, driver)
        self._bike = Bike.of(actor.shape)
        self._foot_weight = riding.foot_down(0.0)
        self._lean = riding.resting_lean(self._bike, self._foot_weight)  # degrees to the left

    def _wheel_places(self) -> Wheels:
        half = self.actor.shape["wheelbase"] / 2
        return (half, 0.0), (-half, 0.0)

    def _follow(self, dx: float, dy: float, seconds: float) -> bool:
        """Also lean towards the angle at which weight and centrifugal force balance."""
        at_rest, before = super()._follow(dx, dy, seconds), (self._foot_weight, self._lean)
        speed = max(0.0, self.speed)
        force = speed * speed * self._steer / (self._base * 9.81)
        self._foot_weight = move_towards(self._foot_weight, riding.foot_down(speed), 2.0 * seconds)
        lean = exact.atan2_deg(force, 1.0) + riding.resting_lean(self._bike, self._foot_weight)
        self._lean = move_towards(self._lean, lean, _TIP * seconds)
        return at_rest and before == (self._foot_weight, self._lean)

    def base_pose(self) -> PartPose:
        """Return the pose of the base, leaning about the tyres, which stay on the ground."""
        (x, y, z), rotation = super().base_pose()
        lift = self._bike.tyre * (1.0 - exact.cos_deg(self._lean))
        return (x, y, z + lift), compose(rotation, axis_rotation("x", -self._lean))

    def pose_row(self) -> Sequence[float]:
        """Return the state from which the pose of vehicle and rider is computed."""
        place, turn = self.base_pose()
        return (*place, *turn, self._steer, self._distance, self._foot_weight)


def create_vehicle(world: World, actor: ActorPlan, control_dt: float, driver: Driver) -> VehicleAgent:
    """Create the agent of a vehicle."""
    kind = TwoWheeler if has_rider(actor.shape) else ParkedVehicle if is_parked(actor) else VehicleAgent
    return kind(world, actor, control_dt, driver)
