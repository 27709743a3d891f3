"""Lowers actors: chooses blueprints, colours, start poses and routes of named actors, traffic and parked cars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from recipe_compiler.expand import Variant
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.ground.path_planner import BODY
from recipe_compiler.ir.plan import ActorPlan, DriverPlan, Point, Pose, TexturePlan
from recipe_compiler.ir.plan_bounds import POSE, SITTING, TALKING
from recipe_compiler.ir.plurals import count
from recipe_compiler.ir.semantic_tags import Category
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering import drivers, pedestrian_traffic, placement, traffic
from recipe_compiler.lowering.placement import Footprint
from recipe_compiler.schema.messages import nearest
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Actor, Start
from recipe_compiler.source.yaml_reader import show

MAX_ROUTE = 20_000.0  # length limit of generated routes, metres
_AHEAD = {"vehicle": 150.0, "pedestrian": 20.0}  # metres of a route beyond the farthest place that an actor can reach


POSES = {"talk": {POSE: float(TALKING)}, "sit": {POSE: float(SITTING)}, "telephone": {"phone": 1.0}}
"""What a pose of the recipe changes in the shape of a pedestrian."""
STAYING = ("talk", "sit")


class ActorLowering:
    """Lowers the actors of one scene.

    Attributes:
        looks: colours, by actor and slot.
        textures: images, by actor and slot.
        problems: problems found so far.
    """

    def __init__(
        self, variant: Variant, base: Base, town: Town, instances: Mapping[str, int], own: Sequence[Blueprint] = ()
    ) -> None:
        self.looks: dict[str, dict[str, str]] = {}
        self.textures: dict[str, dict[str, TexturePlan]] = {}
        self._own = own
        self.problems: list[Problem] = []
        self._variant, self._base, self._town, self._instances = variant, base, town, instances
        self._spots = placement.Spots(town.spots)
        self._parking = placement.Parking(self._places())
        self._warmup = traffic.warmup(base)
        self._chosen = {name: self._choose(name, actor) for name, actor in base.actors.items()}
        self._made: dict[str, ActorPlan | None] = {}
        self._view: traffic.SensorView | None = None

    def _stream(self, name: str, *purpose: str) -> Stream:
        own = self._base.traffic.seed if name.startswith("traffic.") else None
        return Stream(self._variant.seed if own is None else own, "actor", name, *purpose)

    def plans(self) -> tuple[ActorPlan, ...] | None:
        """Return the plans of all actors, named actors in file order and then traffic; None if there are problems."""
        for name, actor in self._base.actors.items():
            if actor.start is not None:
                x, y = actor.start.x, actor.start.y
                self._spots.occupy(Footprint.of(self._chosen[name], x, y, actor.start.yaw or 0.0))
                self._parking.occupy(x, y)
        for sensor in self._base.sensors.values():
            if sensor.carrier is None:
                self._parking.occupy(sensor.mount.x, sensor.mount.y)
        numbers = traffic.counts(self._base)
        names = [f"traffic.{category}.{index}" for category in numbers for index in range(numbers[category])]
        names += [f"traffic.parked.{index}" for index in range(self._base.traffic.parked)]
        self._view = self._view_near()
        crowd = [self._plan_of(name) for name in names]
        plans = [*(self._plan_of(name) for name in self._base.actors), *crowd]
        if self.problems:
            return None
        return tuple(plan for plan in plans if plan is not None)

    def _plan_of(self, name: str) -> ActorPlan | None:
        """The plan of an actor, made once; None if it has problems."""
        if name not in self._made:
            self._made[name] = self._lower(name)
        return self._made[name]

    def _lower(self, name: str) -> ActorPlan | None:
        if name in self._base.actors:
            return self._named(name, self._base.actors[name], self._chosen[name])
        _, kind, index = name.split(".")
        if kind == "parked":
            return self._parked(int(index))
        return self._traffic("vehicle" if kind == "vehicle" else "pedestrian", int(index))

    def _places(self) -> list[Pose]:
        """Return the town's parking places, first those near the sensor of `traffic.near` or else near the origin."""
        near = self._base.sensors.get(self._base.traffic.near or "")
        fixed = near is not None and near.carrier is None
        x, y = (near.mount.x, near.mount.y) if near is not None and fixed else (0.0, 0.0)
        return sorted(self._town.parking, key=lambda p: (p.x - x) * (p.x - x) + (p.y - y) * (p.y - y))

    def _view_near(self) -> traffic.SensorView | None:
        """What the sensor of `traffic.near` sees; None without one. The actor that it is mounted on is placed first."""
        near = self._base.traffic.near
        if near is None or near not in self._base.sensors:
            return None
        sensor = self._base.sensors[near]
        carrier = self._plan_of(sensor.carrier) if sensor.carrier is not None else None
        way = None if carrier is None else (carrier.start, carrier.route, carrier.speed)
        return traffic.SensorView.of(self._base, sensor, way)

    def _choose(self, name: str, actor: Actor) -> Blueprint:
        """Draw the blueprint of a named actor from those that its glob pattern matches."""
        blueprint = self._stream(name, "blueprint").choice(blueprints.match(actor.blueprint, self._own))
        parent = self._variant.base.get("actors", name, "look")
        for slot in actor.look:
            if slot not in blueprint.palette and parent:
                message = f"actors.{name}.look: {blueprint.id} has no {show(slot)}"
                remedy = nearest(slot, blueprint.palette)
                self.problems.append(Problem(message, parent.key_place(slot), remedy, Code.UNKNOWN_NAME))
        return blueprint

    def _colour(self, name: str, blueprint: Blueprint, look: Mapping[str, str]) -> None:
        self.looks[name] = {
            slot: look[slot].lower() if slot in look else self._stream(name, "look", slot).choice(colours)
            for slot, colours in sorted(blueprint.palette.items())
        }
        if blueprint.textures:
            self.textures[name] = dict(sorted(blueprint.textures.items()))

    def _named(self, name: str, actor: Actor, blueprint: Blueprint) -> ActorPlan | None:
        start = self._spots.take(blueprint, self._stream(name, "start")) if actor.start is None else None
        if actor.start is None and start is None:
            message = f"actors.{name}: the town has no room for another {blueprint.category}"
            message += "; lower `traffic`, give a start, or choose a larger town"
            self._report_no_room(("actors", name), message)
            return None
        if actor.start is not None:
            start = Pose(x=actor.start.x, y=actor.start.y, yaw=self._direction(actor.start, blueprint.category))
        assert start is not None
        speed, driver = self._driven(name, actor, blueprint)
        waypoints = actor.route if actor.route is not None else (actor.goal,) if actor.goal is not None else None
        if waypoints is not None:
            route = tuple(Point(x=point.x, y=point.y) for point in waypoints)
        else:
            route = self._route(name, blueprint, start, speed)
        if actor.start is not None and actor.start.yaw is None and route:
            heading = exact.atan2_deg(route[0].y - start.y, route[0].x - start.x)
            start = Pose(x=start.x, y=start.y, yaw=heading)
        self._colour(name, blueprint, actor.look)
        entry = self._town.streets.entry(start) if waypoints is None and blueprint.category == "vehicle" else None
        plan = self._plan(name, self._instances[name], blueprint, start, route if speed > 0 else (), speed)
        if actor.pose is not None:
            plan = plan.model_copy(update={"shape": {**plan.shape, **POSES[actor.pose]}})
        held = actor.start is not None and self._warmup > 0.0
        obeys = not self._happens(name, "lights", actor.driver.ignore_lights_percentage if actor.driver else None)
        return plan.model_copy(update={"held": held, "entry": entry, "driver": driver, "obeys": obeys})

    def _driven(self, name: str, actor: Actor, blueprint: Blueprint) -> tuple[float, DriverPlan | None]:
        """Return the speed of a named actor, m/s, and its driver if the recipe describes one."""
        speed = blueprint.default_speed if actor.speed is None else actor.speed
        if actor.pose in STAYING:
            speed = 0.0
        if actor.driver is None:
            return speed, None
        if blueprint.category == "pedestrian":
            message = f"actors.{name}.driver: {blueprint.id} is a pedestrian, who does not drive"
            place = self._variant.base.place_of("actors", name, "driver")
            self.problems.append(Problem(message, place, "remove the key", Code.INVALID_VALUE))
        speed = drivers.given_speed(actor.driver, blueprint, self._town.limit, speed)
        return speed, drivers.given(actor.driver, DriverPlan(), lambda purpose: self._stream(name, purpose))

    def _happens(self, name: str, purpose: str, percentage: float | None) -> bool:
        """Draw whether something happens to an actor that has a probability in percent."""
        return drivers.happens(self._stream(name, purpose), percentage or 0.0)

    def _direction(self, start: Start, category: Category) -> float:
        """Return the direction in which a random route sets out, degrees: for a vehicle, that of the lane's traffic."""
        if start.yaw is not None:
            return start.yaw
        return self._town.streets.lane_yaw(start.x, start.y) if category == "vehicle" else 0.0

    def _traffic(self, category: Category, index: int) -> ActorPlan | None:
        name = f"traffic.{category}.{index}"
        blueprint = traffic.blueprint(
            category, self._base.traffic, self._town, self._stream(name, "blueprint"), self._own
        )
        keys, driver = self._base.traffic.driver, None
        if category == "vehicle":
            speed, driver = self._drawn_driver(name, blueprint)
        else:
            speed = blueprint.default_speed * self._stream(name, "speed").uniform(0.85, 1.15)
            pair = self._beside_previous(name, index, blueprint)
            if pair is not None:
                return pair
            speed = pedestrian_traffic.running_speed(blueprint, self._stream(name, "run")) or speed

        def score(pose: Pose) -> float:
            assert self._view is not None
            route = self._route(name, blueprint, pose, speed)
            return self._view.score(pose, route, speed, self._warmup)

        start = self._spots.take(blueprint, self._stream(name, "start"), score if self._view is not None else None)
        if start is None:
            self._report_full("vehicles" if category == "vehicle" else "pedestrians", category, index)
            return None
        self._colour(name, blueprint, {})
        block = placement.VEHICLE_NUMBERS if category == "vehicle" else placement.PEDESTRIAN_NUMBERS
        plan = self._plan(name, block + index, blueprint, start, self._route(name, blueprint, start, speed), speed)
        own = None if keys is None or category == "pedestrian" else keys.ignore_lights_percentage
        percentage = self._base.traffic.ignore_lights_percentage if own is None else own
        update: dict[str, object] = {"obeys": not self._happens(name, "lights", percentage), "driver": driver}
        if category == "vehicle":
            return plan.model_copy(update={**update, "entry": self._town.streets.entry(start)})
        route, pauses = pedestrian_traffic.with_pauses(start, plan.route, self._stream(name, "pauses"))
        return plan.model_copy(update={**update, "route": route, "pauses": pauses})

    def _drawn_driver(self, name: str, blueprint: Blueprint) -> tuple[float, DriverPlan]:
        """Return the speed of a vehicle of the traffic, m/s, and its driver."""
        keys, limit = self._base.traffic.driver, self._town.limit

        def stream(purpose: str) -> Stream:
            return self._stream(name, purpose)

        speed, driver = drivers.drawn(blueprint, limit, stream)
        if keys is None:
            return speed, driver
        return drivers.given_speed(keys, blueprint, limit, speed), drivers.given(keys, driver, stream)

    def _beside_previous(self, name: str, index: int, blueprint: Blueprint) -> ActorPlan | None:
        """The plan of a pedestrian who accompanies the previous one of the traffic; None for all others."""
        stream = self._stream(name, "companion")
        if index == 0 or not pedestrian_traffic.is_paired(stream):
            return None
        leader = self._plan_of(f"traffic.pedestrian.{index - 1}")
        if leader is None:
            return None
        beside = Footprint.of(blueprint, leader.start.x, leader.start.y, leader.start.yaw)
        for start in pedestrian_traffic.places_beside(leader, stream):
            body = Footprint.of(blueprint, start.x, start.y, start.yaw)
            if self._spots.free(body, beside) and self._town.obstacles.at(start.x, start.y, BODY) is None:
                self._spots.occupy(body)
                self._colour(name, blueprint, {})
                number = placement.PEDESTRIAN_NUMBERS + index
                plan = self._plan(name, number, blueprint, start, leader.route, leader.speed)
                return plan.model_copy(update={"obeys": leader.obeys, "companion": leader.name})
        return None

    def _parked(self, index: int) -> ActorPlan | None:
        """Return the plan of a parked car in a free parking place; None, with a problem, if no place is free."""
        name = f"traffic.parked.{index}"
        place = self._parking.take(self._stream(name, "start"))
        if place is None:
            self._report_full("parked", "parked car", index)
            return None
        fitting = [b for b in blueprints.match("vehicle.*", self._own) if blueprints.parks(b)]
        blueprint = self._stream(name, "blueprint").choice(fitting)
        self._colour(name, blueprint, {})
        return self._plan(name, placement.PARKED_NUMBERS + index, blueprint, place, (), 0.0)

    def _report_no_room(self, path: tuple[str, str], message: str) -> None:
        self.problems.append(Problem(message, self._variant.base.place_of(*path), code=Code.NO_ROOM))

    def _report_full(self, key: str, noun: str, number: int) -> None:
        """Report once that the town has room for only some of the traffic.

        Args:
            key: Of the section `traffic`.
            noun: What the key counts.
            number: How many found a place before the first that did not. Fewer do not change their places, so that as
                many as this fit.
        """
        if not any(problem.message.startswith(f"traffic.{key}:") for problem in self.problems):
            most = count(number, noun)
            remedy = "lower it, or choose a larger town" if number else "remove it, or choose another town"
            self._report_no_room(("traffic", key), f"traffic.{key}: the town has room for {most}; {remedy}")

    def _route(self, name: str, blueprint: Blueprint, start: Pose, speed: float) -> tuple[Point, ...]:
        seconds = self._warmup + self._base.clock.frames / self._base.clock.fps
        length = min(speed * seconds * 1.1 + _AHEAD[blueprint.category], MAX_ROUTE)
        return self._town.route(blueprint.category, start, length, self._stream(name, "route"))

    def _plan(
        self, name: str, number: int, blueprint: Blueprint, start: Pose, route: tuple[Point, ...], speed: float
    ) -> ActorPlan:
        z = self._town.ground(start.x, start.y)
        return ActorPlan(
            name=name,
            blueprint=blueprint.id,
            category=blueprint.category,
            tag=blueprint.tag,
            instance=number,
            shape=dict(blueprint.shape),
            start=Pose(x=start.x, y=start.y, z=z, yaw=start.yaw),
            route=route,
            speed=speed,
            mesh=blueprint.mesh,
        )
