"""Lowers actors: chooses blueprints, colours, start poses and routes of named actors, traffic and parked cars."""

from __future__ import annotations

from collections.abc import Mapping

from recipe_compiler.expand import Variant
from recipe_compiler.ir import exact
from recipe_compiler.ir.actor_kinds import Category
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import ActorPlan, Point, Pose
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering import placement
from recipe_compiler.schema.messages import nearest
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Actor
from recipe_compiler.source.yaml_reader import show

MAX_ROUTE = 20_000.0  # length limit of generated routes, metres
_TRAFFIC = {"vehicle": "vehicle.*", "pedestrian": "walker.pedestrian.*"}


class ActorLowering:
    """Lowers the actors of one scene.

    Attributes:
        looks: colours, by actor and slot.
        problems: problems found so far.
    """

    def __init__(self, variant: Variant, base: Base, town: Town, instances: Mapping[str, int]) -> None:
        self.looks: dict[str, dict[str, str]] = {}
        self.problems: list[Problem] = []
        self._variant, self._base, self._town, self._instances = variant, base, town, instances
        self._spots = placement.Spots(town.spots)
        self._parking = placement.Parking(town.parking)

    def _stream(self, name: str, *purpose: str) -> Stream:
        return Stream(self._variant.seed, "actor", name, *purpose)

    def plans(self) -> tuple[ActorPlan, ...] | None:
        """Return the plans of all actors, named actors in file order and then traffic; None if there are problems."""
        chosen = {name: self._choose(name, actor) for name, actor in self._base.actors.items()}
        for name, actor in self._base.actors.items():
            if actor.start is not None:
                self._spots.occupy(chosen[name].category, actor.start.x, actor.start.y)
                self._parking.occupy(actor.start.x, actor.start.y)
        traffic = [
            *(self._traffic("vehicle", index) for index in range(self._base.traffic.vehicles)),
            *(self._traffic("pedestrian", index) for index in range(self._base.traffic.pedestrians)),
        ]
        traffic += [self._parked(index) for index in range(self._base.traffic.parked)]
        named = [self._named(name, actor, chosen[name]) for name, actor in self._base.actors.items()]
        plans = [*named, *traffic]
        if self.problems:
            return None
        return tuple(plan for plan in plans if plan is not None)

    def _choose(self, name: str, actor: Actor) -> Blueprint:
        """Draw the blueprint of a named actor from those that its glob pattern matches."""
        blueprint = self._stream(name, "blueprint").choice(blueprints.match(actor.blueprint))
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

    def _named(self, name: str, actor: Actor, blueprint: Blueprint) -> ActorPlan | None:
        start = self._spots.take(blueprint.category, self._stream(name, "start")) if actor.start is None else None
        if actor.start is None and start is None:
            self._report_no_room(("actors", name), f"actors.{name}: {self._full(blueprint.category)}")
            return None
        if actor.start is not None:
            start = Pose(x=actor.start.x, y=actor.start.y, yaw=actor.start.yaw or 0.0)
        assert start is not None
        speed = blueprint.default_speed if actor.speed is None else actor.speed
        waypoints = actor.route if actor.route is not None else (actor.goal,) if actor.goal is not None else None
        if waypoints is not None:
            route = tuple(Point(x=point.x, y=point.y) for point in waypoints)
        else:
            route = self._route(name, blueprint, start, speed)
        if actor.start is not None and actor.start.yaw is None and route:
            heading = exact.atan2_deg(route[0].y - start.y, route[0].x - start.x)
            start = Pose(x=start.x, y=start.y, yaw=heading)
        self._colour(name, blueprint, actor.look)
        return self._plan(name, self._instances[name], blueprint, start, route if speed > 0 else (), speed)

    def _traffic(self, category: Category, index: int) -> ActorPlan | None:
        name = f"traffic.{category}.{index}"
        start = self._spots.take(category, self._stream(name, "start"))
        if start is None:
            key = "vehicles" if category == "vehicle" else "pedestrians"
            if not self._reported(f"traffic.{key}"):
                self._report_no_room(("traffic", key), f"traffic.{key}: {self._full(category)}")
            return None
        allowed = [b for b in blueprints.match(_TRAFFIC[category]) if not b.id.startswith(self._town.barred)]
        blueprint = self._stream(name, "blueprint").choice(allowed)
        speed = blueprint.default_speed * self._stream(name, "speed").uniform(0.85, 1.15)
        speed *= self._town.pace if category == "vehicle" else 1.0
        self._colour(name, blueprint, {})
        block = placement.VEHICLE_NUMBERS if category == "vehicle" else placement.PEDESTRIAN_NUMBERS
        return self._plan(name, block + index, blueprint, start, self._route(name, blueprint, start, speed), speed)

    def _parked(self, index: int) -> ActorPlan | None:
        """Return the plan of a parked car in a free parking place; None, with a problem, if no place is free."""
        name = f"traffic.parked.{index}"
        place = self._parking.take(self._stream(name, "start"))
        if place is None:
            if not self._reported("traffic.parked"):
                places = len(self._town.parking)
                message = f"traffic.parked: no free parking place is left; the town has {places} in total"
                message += "; lower it, or choose a larger town" if places else "; remove it, or choose another town"
                self._report_no_room(("traffic", "parked"), message)
            return None
        fitting = [b for b in blueprints.match(_TRAFFIC["vehicle"]) if blueprints.parks(b)]
        blueprint = self._stream(name, "blueprint").choice(fitting)
        self._colour(name, blueprint, {})
        return self._plan(name, placement.PARKED_NUMBERS + index, blueprint, place, (), 0.0)

    def _report_no_room(self, path: tuple[str, str], message: str) -> None:
        self.problems.append(Problem(message, self._variant.base.place_of(*path), code=Code.NO_ROOM))

    def _reported(self, key: str) -> bool:
        """Whether a problem that names this key has been reported."""
        return any(key in problem.message for problem in self.problems)

    def _full(self, category: Category) -> str:
        places = len(self._town.spots[category])
        remedy = "lower `traffic`, give a start, or choose a larger town"
        return f"no free spawn point is left for a {category}; the town has {places} in total; {remedy}"

    def _route(self, name: str, blueprint: Blueprint, start: Pose, speed: float) -> tuple[Point, ...]:
        seconds = self._base.clock.frames / self._base.clock.fps
        length = min(speed * seconds * 1.1 + 5.0, MAX_ROUTE)
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
        )
