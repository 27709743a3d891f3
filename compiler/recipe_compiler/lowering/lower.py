"""Lowers variants to plans: resolves presets, glob patterns, spawn points, routes and angles to numbers.

Parts that variants share are lowered once. Their plans are the same objects, so their digests are computed once too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

from recipe_compiler.expand import Variant
from recipe_compiler.ir import plan_bounds
from recipe_compiler.ir.errors import Code, Problem
from recipe_compiler.ir.plan import (
    AppearancePlan,
    CameraResponse,
    Clock,
    Looks,
    PatchPlan,
    RigPlan,
    ScenarioPlan,
    ScenePlan,
    Sun,
    TexturePlan,
    Weather,
)
from recipe_compiler.ir.weather import PARAMETERS
from recipe_compiler.library import weather
from recipe_compiler.library.blueprints import Blueprint
from recipe_compiler.library.seasons import Season, in_season
from recipe_compiler.library.towns import Town
from recipe_compiler.lowering import lint, plausibility, props, sun, traffic
from recipe_compiler.lowering.actors import ActorLowering
from recipe_compiler.lowering.asset_files import AssetFile
from recipe_compiler.lowering.patches import lower as patch_lowering
from recipe_compiler.lowering.patches.texture_files import Key
from recipe_compiler.lowering.sensors import arms
from recipe_compiler.lowering.sensors import rig as rigs
from recipe_compiler.lowering.walking_routes import RecipeWork, WalkingRoutes
from recipe_compiler.schema.camera import Camera
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Town as TownSpec
from recipe_compiler.schema.weather import Geography
from recipe_compiler.source.yaml_reader import show

T = TypeVar("T")


@dataclass(frozen=True)
class _Scene:
    plan: ScenePlan
    looks: Looks
    textures: dict[str, dict[str, TexturePlan]]


class Lowering:
    """Lowers the variants of one recipe, and collects problems and warnings."""

    def __init__(
        self,
        instances: Mapping[str, int],
        assets: Mapping[str, AssetFile] | None = None,
        textures: Mapping[Key, Sequence[AssetFile]] | None = None,
        own: Sequence[Blueprint] = (),
        *,
        allow_large: bool = False,
    ) -> None:
        self._work = RecipeWork(unlimited=allow_large)
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []
        self._instances, self._assets, self._textures = instances, assets or {}, textures or {}
        self._own = own  # the blueprints of the recipe
        self._made: dict[tuple[object, ...], tuple[object, object]] = {}

    def _once(self, key: tuple[object, ...], holding: object, make: Callable[[], T]) -> T:
        """Return the cached result of `make` for a key.

        Args:
            key: may contain `id()` values.
            holding: the objects with these ids. The cache keeps them alive, so that no id is reused.
            make: called if the key is new.
        """
        if key not in self._made:
            self._made[key] = (holding, make())
        return cast("T", self._made[key][1])

    @property
    def towns(self) -> dict[str, Town]:
        """The towns of the variants lowered so far, by their plans' digests."""
        return {made.plan.digest: made for _, made in self._made.values() if isinstance(made, Town)}

    def _once_reporting(self, key: tuple[object, ...], holding: object, make: Callable[[], T]) -> T:
        """As `_once`, but reports the problems and warnings again for each variant that shares the result."""

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
        """Return the plans of a variant; None, with entries in `problems`, if it cannot be lowered."""
        sections = [base.clock, base.town, base.actors, base.traffic, base.props]
        if base.traffic.near is not None:
            sections.append(base.sensors)
        key = ("scene", *map(id, sections), patch_lowering.board_key(base.patches), variant.seed)
        scene = self._once_reporting(key, sections, lambda: self._scene(variant, base))
        if scene is None or not self._carriers_exist(variant, base, scene):
            return None
        town = self._town(base.town)
        rig = self._rig(variant, base, town)
        if rig is None:
            return None
        seen = ("cameras", id(base.town), id(base.sensors), id(base.clock), variant.seed)
        parts = (base.town, base.sensors, base.clock)
        self._once_reporting(seen, parts, lambda: self.warnings.extend(lint.of_cameras(variant.base, rig, town)))
        viewed = ("mounts", id(base.actors), id(base.traffic), *seen[1:])
        shared = (*parts, base.actors, base.traffic)
        of_views = plausibility.of_views(variant.base, rig, scene.plan.actors, base.clock.frames)
        self._once_reporting(viewed, shared, lambda: self.warnings.extend(of_views))
        patches = self._patches(variant, base, scene.plan)
        if patches is None:
            return None
        numbers, where = self._weather_and_sun(variant, base)
        appearance = AppearancePlan(
            seed=variant.seed,
            weather=numbers,
            sun=where,
            looks=self._looks(scene, base.season),
            textures=scene.textures,
            patches=patches,
            responses={name: _response(sensor.camera) for name, sensor in base.sensors.items()},
        )
        return ScenarioPlan(variant=variant.name, scene=scene.plan, rig=rig, appearance=appearance)

    def _rig(self, variant: Variant, base: Base, town: Town) -> RigPlan | None:
        """Return the plan of the sensors; None, with entries in `problems`, if one cannot be lowered."""
        parts: list[object] = [base.clock, base.sensors]
        if any(arms.needs_town(sensor) for sensor in base.sensors.values()):
            parts.append(town)

        def make() -> RigPlan | None:
            rig, problems = rigs.lower(variant, base, town)
            self.problems += problems
            return rig

        return self._once_reporting(("rig", *map(id, parts), variant.seed), parts, make)

    def _patches(self, variant: Variant, base: Base, scene: ScenePlan) -> tuple[PatchPlan, ...] | None:
        """The patches of a variant; None, with entries in `problems`, if there are any problems."""
        if not base.patches:
            return ()
        town = scene.town
        elements = self._once(("patchable", id(town)), town, lambda: patch_lowering.patchable(town))
        lowered = self._once(
            ("patches", id(base.patches), id(scene)),
            (base.patches, scene),
            lambda: patch_lowering.lower(base.patches, self._textures, variant.base, scene, elements),
        )
        self.problems += lowered.problems
        return None if lowered.problems else lowered.plans

    def _carriers_exist(self, variant: Variant, base: Base, scene: _Scene) -> bool:
        """Report each sensor whose pose depends on an actor that the scene does not have."""
        names = {actor.name for actor in scene.plan.actors}
        missing = [name for name, sensor in base.sensors.items() if sensor.carrier not in {None, *names}]
        for name in missing:
            sensor = base.sensors[name]
            key = ("mount", "on") if sensor.motion.follow is None else ("motion", "follow", "actor")
            message = f"sensors.{name}.{'.'.join(key)}: there is no actor {show(sensor.carrier)}; the traffic has fewer"
            place = variant.base.place_of("sensors", name, *key)
            self.problems.append(
                Problem(message, place, "raise `traffic.density`, or choose another actor", Code.UNKNOWN_NAME)
            )
        return not missing

    # Scene

    def _scene(self, variant: Variant, base: Base) -> _Scene | None:
        town = self._town(base.town)
        actor_lowering = ActorLowering(variant, base, town, self._instances, self._own)
        actors = actor_lowering.plans()
        self.problems += actor_lowering.problems
        stage = props.lower(base.props, self._assets, variant.base, town)
        patch_lowering.add_boards(stage, base.patches, variant.base, town)
        self.problems += stage.problems
        if actors is None or stage.problems:
            return None
        given = [actor for actor in actors if actor.name in base.actors and base.actors[actor.name].start is not None]
        self.warnings += lint.of_starts(variant.base, given, town)
        self.warnings += lint.of_goals(variant.base, base.actors, town)
        self.warnings += lint.of_directions(variant.base, base.actors, actors, town)
        self.warnings += plausibility.of_speeds(variant.base, actors)
        routes = WalkingRoutes(variant.base, base.actors, town, stage.plans, actors, self._work)
        actors = routes.planned()
        self.problems += routes.problems
        self.warnings += routes.warnings
        if routes.problems:
            return None
        faults = ((plan_bounds.routes_fault, "shorten the routes"), (plan_bounds.starts_fault, "move them apart"))
        found = [(fault, remedy) for check, remedy in faults if (fault := check(actors)) is not None]
        if found:
            place = variant.base.place_of("actors")
            self.problems += [Problem(f"actors: {fault}", place, remedy, Code.OUT_OF_RANGE) for fault, remedy in found]
            return None
        seconds = traffic.warmup(base)
        clock = Clock(fps=base.clock.fps, frames=base.clock.frames, physics=base.clock.physics, warmup=seconds)
        self.warnings += lint.of_vehicle_routes(variant.base, base.actors, actors, routes.solid, clock)
        # All colours come from a palette or are validated. Validating a town's again would be the slowest step here.
        looks = Looks.model_construct(root={**town.looks, **actor_lowering.looks, **stage.looks})
        plan = ScenePlan(clock=clock, town=town.plan, actors=actors, props=stage.plans)
        return _Scene(plan, looks, {**actor_lowering.textures, **stage.textures})

    def _looks(self, scene: _Scene, season: Season) -> Looks:
        """Return the colours of a scene in a season."""
        if season == "summer":
            return scene.looks

        def made() -> Looks:
            return Looks.model_construct(root=in_season(scene.looks.root, scene.plan.town.elements, season))

        return self._once(("season", id(scene), season), scene, made)

    def _town(self, spec: TownSpec) -> Town:
        key = (spec.name, spec.seed, json.dumps(spec.model_extra or {}, sort_keys=True))
        return self._once(("town", *key), None, lambda: traffic.built(*key))

    # Sky

    def _weather_and_sun(self, variant: Variant, base: Base) -> tuple[Weather, Sun]:
        given = base.weather
        by_hand = {p: value for p in PARAMETERS if (value := getattr(given, p)) is not None}
        numbers = weather.preset(given.preset) | by_hand
        where = sun.from_carla(numbers.pop("sun_azimuth_angle"), numbers.pop("sun_altitude_angle"))
        if base.time is not None:
            azimuth, altitude = self._sun_angles(base.time, base.place)
            where = Sun(
                azimuth=where.azimuth if "sun_azimuth_angle" in by_hand else azimuth,
                altitude=where.altitude if "sun_altitude_angle" in by_hand else altitude,
            )
            self._warn_of_sun(variant, base, altitude)
        return Weather(**numbers), where

    def _sun_angles(self, time: str, place: Geography) -> tuple[float, float]:
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

    def _warn_of_sun(self, variant: Variant, base: Base, altitude: float) -> None:
        """Warn of a sun that two settings set: an angle and the time, or a dark preset and a time of day.

        `altitude` is that of the time, in degrees. A bright preset with the time of a dusk or night is usual.
        """
        source = variant.base
        by_time = f"time {show(base.time)} of line {source.place_of('time').line}"
        if source.get("weather", "sun_altitude_angle") is not None:
            message = f"weather.sun_altitude_angle overrides the altitude that follows from {by_time}"
            place, remedy = source.place_of("weather", "sun_altitude_angle"), "remove one of the two"
        elif altitude > max(0.0, 2.0 * weather.preset(base.weather.preset)["sun_altitude_angle"]):
            message = f"weather: {by_time} overrides the sun of the preset {show(base.weather.preset)}, so it is day"
            place = source.place_of(*(("weather", "preset") if source.get("weather", "preset") else ("weather",)))
            remedy = "write a time when the sun is low, remove `time`, or exclude the variant"
        else:
            return
        self.warnings.append(Problem(message, place, remedy, Code.OVERRIDDEN))


_EFFECTS = (
    "noise",
    "vignette_intensity",
    "lens_circle_multiplier",
    "chromatic_aberration_intensity",
    "bloom_intensity",
    "motion_blur_intensity",
)


def _response(camera: Camera) -> CameraResponse:
    response = CameraResponse(**{field: getattr(camera, field) for field in CameraResponse.model_fields})
    off: dict[str, object] = {**dict.fromkeys(_EFFECTS, 0.0), "sensor": None}
    return response if camera.enable_postprocess_effects else response.model_copy(update=off)
