"""Lowering: from a variant to its plans. Presets, globs, spawn points, routes and angles become numbers.

Parts that variants share are lowered once and are the same objects in each plan, so their digests are computed once.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from recipe_compiler.expand import Variant
from recipe_compiler.ir import exact
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import (
    ActorPlan,
    AppearancePlan,
    CameraPlan,
    CameraResponse,
    Clock,
    Looks,
    Point,
    Pose,
    RigPlan,
    ScenarioPlan,
    ScenePlan,
    SensorPlan,
    Sun,
    TexturePlan,
    Weather,
)
from recipe_compiler.ir.streams import Stream
from recipe_compiler.library import blueprints, towns, weather
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.library.towns import Town
from recipe_compiler.library.towns.town import Category
from recipe_compiler.lowering import camera_motion, enclosures, lint, placement, props, sun
from recipe_compiler.lowering.asset_files import Brought
from recipe_compiler.schema import models
from recipe_compiler.schema.messages import nearest
from recipe_compiler.schema.models import Base
from recipe_compiler.source.yaml_reader import Value, show

T = TypeVar("T")
MODALITIES = ("rgb", "depth", "instance", "semantic")
MAX_ROUTE = 20_000.0  # metres; a longer way is never walked
_TRAFFIC = {"vehicle": "vehicle.*", "pedestrian": "walker.pedestrian.*"}


@dataclass(frozen=True)
class _Scene:
    plan: ScenePlan
    looks: Looks
    textures: dict[str, dict[str, TexturePlan]]


class Lowering:
    """Lowers the variants of one recipe, and gathers problems and warnings with their places."""

    def __init__(self, instances: Mapping[str, int], assets: Mapping[str, Brought] | None = None) -> None:
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self._instances, self._assets = instances, assets or {}
        self._made: dict[Any, tuple[Any, Any]] = {}

    def _once(self, key: tuple[Any, ...], holding: Any, make: Callable[[], T]) -> T:
        """What `make` gives for a key. Keys hold ids, so what they identify is held as long as they are."""
        if key not in self._made:
            self._made[key] = (holding, make())
        return self._made[key][1]  # type: ignore[no-any-return]

    @property
    def towns(self) -> dict[str, Town]:
        """The towns of the variants lowered so far, by their plans' digests."""
        return {made.plan.digest: made for _, made in self._made.values() if isinstance(made, Town)}

    def _noting(self, key: tuple[Any, ...], holding: Any, make: Callable[[], T]) -> T:
        """As `_once`; the problems and warnings that it found are noted again for each variant that shares it."""

        def noted() -> tuple[T, list[Problem], list[Problem]]:
            problems, warnings = len(self.problems), len(self.warnings)
            made = make()
            found = self.problems[problems:], self.warnings[warnings:]
            del self.problems[problems:], self.warnings[warnings:]
            return made, *found

        made, problems, warnings = self._once(key, holding, noted)
        self.problems += problems
        self.warnings += warnings
        return made

    def scenario(self, variant: Variant, base: Base) -> ScenarioPlan | None:
        """The variant's plans; None if it has problems."""
        cast = (base.clock, base.town, base.actors, base.traffic, base.props)
        key = ("scene", *map(id, cast), variant.seed)
        scene = self._noting(key, cast, lambda: self._scene(variant, base))
        if scene is None:
            return None
        rig = self._once(
            ("rig", id(base.clock), id(base.sensors), variant.seed),
            (base.clock, base.sensors),
            lambda: self._rig(variant, base),
        )
        town = self._town(base.town)
        seen = ("cameras", id(base.town), id(base.sensors), id(base.clock), variant.seed)
        parts = (base.town, base.sensors, base.clock)
        self._noting(seen, parts, lambda: self.warnings.extend(lint.of_cameras(variant.base, rig, town)))
        numbers, where = self._sky(variant, base)
        appearance = AppearancePlan(
            seed=variant.seed,
            weather=numbers,
            sun=where,
            looks=scene.looks,
            textures=scene.textures,
            responses={name: _response(sensor.camera) for name, sensor in base.sensors.items()},
        )
        return ScenarioPlan(variant=variant.name, scene=scene.plan, rig=rig, appearance=appearance)

    def _report(self, root: Value, path: tuple[str | int, ...], message: str) -> None:
        self.problems.append(Problem(message, root.place_of(*path), code=Code.NO_ROOM))

    # Scene

    def _scene(self, variant: Variant, base: Base) -> _Scene | None:
        town = self._town(base.town)
        cast = _Cast(self, variant, base, town)
        actors = cast.actors()
        stage = props.lower(base.props, self._assets, variant.base, town)
        self.problems += stage.problems
        if actors is None or stage.problems:
            return None
        given = [actor for actor in actors if actor.name in base.actors and base.actors[actor.name].start is not None]
        routed = {name for name, actor in base.actors.items() if actor.goal is not None or actor.route is not None}
        self.warnings += lint.of_starts(variant.base, given, town)
        self.warnings += enclosures.of_enclosed_starts(variant.base, given, routed, town)
        clock = Clock(fps=base.clock.fps, frames=base.clock.frames, physics=base.clock.physics)
        # Every colour is a palette's or has been checked; to check and copy a town's again would take the longest here.
        looks = Looks.model_construct(root={**town.looks, **cast.looks, **stage.looks})
        plan = ScenePlan(clock=clock, town=town.plan, actors=actors, props=stage.plans)
        return _Scene(plan, looks, stage.textures)

    def _town(self, spec: models.Town) -> Town:
        key = (spec.name, spec.seed, json.dumps(spec.model_extra or {}, sort_keys=True))
        return self._once(("town", *key), None, lambda: _built(*key))

    # Rig

    def _rig(self, variant: Variant, base: Base) -> RigPlan:
        sensors = []
        for name, sensor in base.sensors.items():
            poses = camera_motion.poses(name, sensor, seed=variant.seed, fps=base.clock.fps, frames=base.clock.frames)
            sensors.append(
                SensorPlan(
                    name=name,
                    on=sensor.mount.on,
                    camera=CameraPlan(**{field: getattr(sensor.camera, field) for field in CameraPlan.model_fields}),
                    capture=tuple(m for m in MODALITIES if m in sensor.capture),
                    poses=poses,
                )
            )
        return RigPlan(sensors=tuple(sensors))

    # Sky

    def _sky(self, variant: Variant, base: Base) -> tuple[Weather, Sun]:
        given = base.weather
        by_hand = {p: value for p in weather.PARAMETERS if (value := getattr(given, p)) is not None}
        numbers = weather.preset(given.preset) | by_hand
        where = sun.from_carla(numbers.pop("sun_azimuth_angle"), numbers.pop("sun_altitude_angle"))
        if base.time is not None:
            azimuth, altitude = self._told(base.time, base.place)
            where = Sun(
                azimuth=where.azimuth if "sun_azimuth_angle" in by_hand else azimuth,
                altitude=where.altitude if "sun_altitude_angle" in by_hand else altitude,
            )
            self._warn_of_sun(variant, base.time)
        return Weather(**numbers), where

    def _told(self, time: str, place: models.Geography) -> tuple[float, float]:
        return self._once(
            ("sun", time, place),
            None,
            lambda: sun.from_time(
                time,
                date=place.date,
                latitude=place.latitude,
                longitude=place.longitude,
                utc_offset=place.utc_offset,
            ),
        )

    def _warn_of_sun(self, variant: Variant, time: str) -> None:
        if variant.base.get("weather", "sun_altitude_angle") is not None:
            told = f"time {show(time)} of line {variant.base.place_of('time').line}"
            message = f"weather.sun_altitude_angle is set by hand and wins: {told} does not move the sun up or down"
            place = variant.base.place_of("weather", "sun_altitude_angle")
            self.warnings.append(Problem(message, place, "remove one of the two", Code.OVERRIDDEN))


@functools.lru_cache(maxsize=8)
def _built(name: str, seed: int, parameters: str) -> Town:
    return towns.build(name, seed, json.loads(parameters))


_EFFECTS = (
    "noise",
    "vignette_intensity",
    "lens_circle_multiplier",
    "chromatic_aberration_intensity",
    "bloom_intensity",
    "motion_blur_intensity",
)


def _response(camera: models.Camera) -> CameraResponse:
    response = CameraResponse(**{field: getattr(camera, field) for field in CameraResponse.model_fields})
    return response if camera.enable_postprocess_effects else response.model_copy(update=dict.fromkeys(_EFFECTS, 0.0))


class _Cast:
    """The actors of one scene: chosen, dressed, placed and sent on their way."""

    def __init__(self, lowering: Lowering, variant: Variant, base: Base, town: Town) -> None:
        self.looks: dict[str, dict[str, str]] = {}
        self._lowering, self._variant, self._base, self._town = lowering, variant, base, town
        self._spots = placement.Spots(town.spots)
        self._parking = placement.Parking(town.parking)
        self._numbers = lowering._instances
        self._before = len(lowering.problems)

    def _stream(self, name: str, *purpose: str) -> Stream:
        return Stream(self._variant.seed, "actor", name, *purpose)

    def actors(self) -> tuple[ActorPlan, ...] | None:
        """All actors: the named ones in file order, then traffic; None if there are problems."""
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
        if len(self._lowering.problems) > self._before:
            return None
        return tuple(plan for plan in plans if plan is not None)

    def _choose(self, name: str, actor: models.Actor) -> Blueprint:
        blueprint = self._stream(name, "blueprint").choice(blueprints.match(actor.blueprint))
        parent = self._variant.base.get("actors", name, "look")
        for slot in actor.look:
            if slot not in blueprint.palette and parent:
                message = f"actors.{name}.look: {blueprint.id} has no {show(slot)}"
                remedy = nearest(slot, blueprint.palette)
                self._lowering.problems.append(Problem(message, parent.key_place(slot), remedy, Code.UNKNOWN_NAME))
        return blueprint

    def _dress(self, name: str, blueprint: Blueprint, look: Mapping[str, str]) -> None:
        self.looks[name] = {
            slot: look[slot].lower() if slot in look else self._stream(name, "look", slot).choice(colours)
            for slot, colours in sorted(blueprint.palette.items())
        }

    def _named(self, name: str, actor: models.Actor, blueprint: Blueprint) -> ActorPlan | None:
        start = self._spots.take(blueprint.category, self._stream(name, "start")) if actor.start is None else None
        if actor.start is None and start is None:
            self._lowering._report(
                self._variant.base, ("actors", name), f"actors.{name}: {self._full(blueprint.category)}"
            )
            return None
        if actor.start is not None:
            start = Pose(x=actor.start.x, y=actor.start.y, yaw=actor.start.yaw or 0.0)
        assert start is not None
        speed = blueprint.default_speed if actor.speed is None else actor.speed
        waypoints = actor.route if actor.route is not None else (actor.goal,) if actor.goal is not None else None
        if waypoints is not None:
            route = tuple(Point(x=point.x, y=point.y) for point in waypoints)
        else:
            route = self._wander(name, blueprint, start, speed)
        if actor.start is not None and actor.start.yaw is None and route:
            heading = exact.atan2_deg(route[0].y - start.y, route[0].x - start.x)
            start = Pose(x=start.x, y=start.y, yaw=heading)
        self._dress(name, blueprint, actor.look)
        return self._plan(name, self._numbers[name], blueprint, start, route if speed > 0 else (), speed)

    def _traffic(self, category: Category, index: int) -> ActorPlan | None:
        name = f"traffic.{category}.{index}"
        start = self._spots.take(category, self._stream(name, "start"))
        if start is None:
            key = "vehicles" if category == "vehicle" else "pedestrians"
            if not self._reported(f"traffic.{key}"):
                self._lowering._report(self._variant.base, ("traffic", key), f"traffic.{key}: {self._full(category)}")
            return None
        allowed = [b for b in blueprints.match(_TRAFFIC[category]) if not b.id.startswith(self._town.barred)]
        blueprint = self._stream(name, "blueprint").choice(allowed)
        speed = blueprint.default_speed * self._stream(name, "speed").uniform(0.85, 1.15)
        speed *= self._town.pace if category == "vehicle" else 1.0
        self._dress(name, blueprint, {})
        block = placement.VEHICLE_NUMBERS if category == "vehicle" else placement.PEDESTRIAN_NUMBERS
        return self._plan(name, block + index, blueprint, start, self._wander(name, blueprint, start, speed), speed)

    def _parked(self, index: int) -> ActorPlan | None:
        """A car that stands in a parking place, and goes nowhere."""
        name = f"traffic.parked.{index}"
        place = self._parking.take(self._stream(name, "start"))
        if place is None:
            if not self._reported("traffic.parked"):
                places = len(self._town.parking)
                message = f"traffic.parked: no free place left to park, of the {places} that the town has"
                message += "; lower it, or choose a larger town"
                self._lowering._report(self._variant.base, ("traffic", "parked"), message)
            return None
        fitting = [b for b in blueprints.match(_TRAFFIC["vehicle"]) if blueprints.parks(b)]
        blueprint = self._stream(name, "blueprint").choice(fitting)
        self._dress(name, blueprint, {})
        return self._plan(name, placement.PARKED_NUMBERS + index, blueprint, place, (), 0.0)

    def _reported(self, key: str) -> bool:
        """Whether a problem of this cast names a key."""
        return any(key in problem.message for problem in self._lowering.problems[self._before :])

    def _full(self, category: Category) -> str:
        places = len(self._town.spots[category])
        remedy = "lower `traffic`, give a start, or ask for a larger town"
        return f"no free spot left for a {category}, of the {places} that the town has; {remedy}"

    def _wander(self, name: str, blueprint: Blueprint, start: Pose, speed: float) -> tuple[Point, ...]:
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
