"""Computes the workload of a variant, the input of the cost model in `limits`, before or after lowering."""

from __future__ import annotations

import dataclasses
import json
import math
from itertools import pairwise
from typing import Protocol

from recipe_compiler import limits
from recipe_compiler.expand import Variant
from recipe_compiler.ir import exact, optics, plan_bounds
from recipe_compiler.ir.patches import INSERTED, STATIC, WITH_CHART
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_compiler.ir.rig.arm import history
from recipe_compiler.library import towns
from recipe_compiler.lowering import traffic
from recipe_compiler.lowering.actors import MAX_ROUTE
from recipe_compiler.lowering.patches import lower as patch_lowering
from recipe_compiler.lowering.sensors import arms
from recipe_compiler.schema.motion import Motion
from recipe_compiler.schema.recipe import Base
from recipe_compiler.schema.scene import Actor
from recipe_compiler.schema.tick import interval_of

_BOXES = 0.45  # share of the elements of a town that shorten arms, at most
_METRES_A_SECOND, _METRES_A_POINT = 5.0, 25.0  # of generated routes: mean speed, mean distance between waypoints


def estimated(variant: Variant, base: Base, changes: int, texels: int = 0) -> limits.Load:
    """Estimate the workload of a variant before lowering, from its checked models.

    Args:
        variant: the variant.
        base: its checked base. Sections that are the same object in several variants count as shared.
        changes: the number of axes and draws merged over the base.
        texels: of all images of the recipe.
    """
    parts = base.clock, base.town, base.actors, base.traffic, base.props
    scene = (*map(id, parts), patch_lowering.board_key(base.patches), variant.seed)
    rig = (id(base.sensors), variant.seed)
    parameters = base.town.model_extra or {}
    elements = towns.elements(base.town.name, parameters)
    views = tuple(
        limits.Clip(
            len(range(0, base.clock.frames, interval_of(s.tick, base.clock.fps))),
            s.camera.width * s.camera.height,
            _samples(s.camera, s.camera.supersample),
            s.capture,
            base.clock.frames if s.motion != Motion() else 1,
            s.motion == Motion() and s.mount.on is None,
            _has_image_filters(s.camera),
            interval_of(s.tick, base.clock.fps),
            round(elements * _BOXES) if arms.is_shortened(s) else 0,
            arms.earlier_frames(s, base.clock.fps),
        )
        for s in base.sensors.values()
    )
    clock = base.clock
    crowd = sum(traffic.counts(base).values())
    seconds = clock.frames / clock.fps + traffic.warmup(base)
    wandering = crowd + sum(actor.route is None and actor.goal is None for actor in base.actors.values())
    points = wandering * min(seconds * _METRES_A_SECOND, MAX_ROUTE) / _METRES_A_POINT
    return limits.Load(
        scene=scene,
        rig=rig,
        appearance=variant.name,
        steps=math.ceil(seconds * clock.physics),
        actors=len(base.actors) + crowd + base.traffic.parked,
        views=views,
        town=(base.town.name, base.town.seed, json.dumps(parameters, sort_keys=True)),
        elements=elements,
        points=round(points) + sum(len(actor.route or ()) for actor in base.actors.values()),
        metres=sum(map(_given_metres, base.actors.values())),
        changes=changes,
        texels=texels,
        sequences=any(p.texture is not None and p.texture.frames is not None for p in base.patches.values()),
        patches=len(base.patches),
        moving_patches=sum(patch.on.actor is not None for patch in base.patches.values()),
        inserted_patches=sum(patch.mode in INSERTED for patch in base.patches.values()),
        charts=sum(p.mode == "color_transfer" and p.color_transfer.method in WITH_CHART for p in base.patches.values()),
    )


def _given_metres(actor: Actor) -> float:
    """The length of the way that the recipe gives a vehicle, in metres."""
    points = [p for p in (actor.start, *(actor.route or ()), actor.goal) if p is not None]
    if not actor.blueprint.startswith("vehicle."):
        return 0.0
    return sum(exact.distance(a.x, a.y, b.x, b.y) for a, b in pairwise(points))


class _ImageFilters(Protocol):
    """The settings of the filters applied to the shaded picture."""

    @property
    def motion_blur_intensity(self) -> float: ...
    @property
    def bloom_intensity(self) -> float: ...


def _has_image_filters(camera: _ImageFilters) -> bool:
    return camera.motion_blur_intensity > 0.0 or camera.bloom_intensity > 0.0


def _samples(camera: optics.Lens, supersample: int) -> int:
    width, height, _ = optics.undistorted_size(camera, supersample)
    return width * height


def measured(plan: ScenarioPlan, texels: int = 0) -> limits.Load:
    """Compute the workload of a variant from its plan. Plans with the same digest count as shared.

    Args:
        plan: the plan.
        texels: of all images, whose sizes plans do not have.
    """
    clock = plan.scene.clock
    responses, patches = plan.appearance.responses, plan.appearance.patches
    views = tuple(
        limits.Clip(
            len(s.frames(clock.frames)),
            s.camera.width * s.camera.height,
            _samples(s.camera, responses[s.name].supersample),
            s.capture,
            len(s.poses),
            len(s.poses) == 1 and s.on is None,
            _has_image_filters(responses[s.name]),
            s.interval,
            0 if s.arm is None else len(s.arm.obstacles),
            0 if s.arm is None else history(s.arm.decay),
        )
        for s in plan.rig.sensors
    )
    return limits.Load(
        scene=plan.scene.digest,
        rig=plan.rig.digest,
        appearance=plan.appearance.digest,
        steps=clock.warmup_steps + clock.frames * clock.steps_per_frame,
        actors=len(plan.scene.actors),
        views=views,
        elements=len(plan.scene.town.elements),
        metres=plan_bounds.route_metres(plan.scene.actors),
        texels=texels,
        sequences=any(patch.changes for patch in patches),
        patches=len(patches),
        moving_patches=sum(not patch.whole and patch.faces[0].part != STATIC for patch in patches),
        inserted_patches=sum(patch.inserted for patch in patches),
        charts=sum(patch.transfer in WITH_CHART for patch in patches),
    )


def plan_cost(plan: DatasetPlan) -> limits.Cost:
    """Return the cost of building an existing plan, such as one from a dataset's folder, without compiling it."""
    cost = limits.total(map(measured, plan.variants), plan.depth)
    memory = cost.main_memory - cost.compile_bytes
    return dataclasses.replace(cost, compile_seconds=0.0, compile_bytes=0, main_memory=memory)
