"""Portraits: renders of one actor on a plain ground in soft sunlight.

A portrait is a pure function of the actor, its colours and the view, so it has the same bytes on every host.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import ActorPlan, AppearancePlan, CameraPlan, CameraResponse, Looks, Pose, Sun, Weather
from recipe_compiler.ir.semantic_tags import Tag
from recipe_compiler.ir.weather import PARAMETERS

from recipe_runtime.body import riding, walk_cycle
from recipe_runtime.body.kinematics import IDENTITY, PartPose, forward_kinematics, rotate
from recipe_runtime.body.skeleton import Bike, Figure, has_rider, is_person, joints_of
from recipe_runtime.core.transforms import Array, from_pose
from recipe_runtime.meshes.actors import actor_body
from recipe_runtime.meshes.builder import Builder
from recipe_runtime.meshes.mesh import Body, Pattern, Surface
from recipe_runtime.meshes.skin import BodyVertices

_FIELD = 24.0  # degrees: a long lens, so that near and far keep their proportions
_MARGIN = 1.1
DAYLIGHT = Weather.model_validate({name: PARAMETERS[name].usual for name in Weather.model_fields} | {"cloudiness": 30})
"""Dry weather with a few clouds, for pictures of single actors and surfaces."""
_PHASE = 0.1  # of the stride in which a walker is shown: one foot flat, one about to leave


@dataclass(frozen=True)
class Viewpoint:
    """The viewpoint of a portrait: degrees to the left of the body's front, and above the ground."""

    side: float = 38.0
    above: float = 11.0
    width: int = 480
    height: int = 360
    sun_altitude: float = 42.0


def portrait(actor: ActorPlan, look: Mapping[str, str], view: Viewpoint | None = None) -> NDArray[np.uint8]:
    """Render an actor as it walks, drives or rides.

    Args:
        actor: The actor.
        look: The colour of each slot, as `#rrggbb`.
        view: The viewpoint, by default from the front left.

    Returns:
        uint8 [H, W, 3], sRGB.
    """
    from recipe_runtime.render.renderer import Renderer

    view = view or Viewpoint()
    body, parts = actor_body(actor), matrices(stance(actor))
    camera = CameraPlan(width=view.width, height=view.height, fov=_FIELD)
    eye = from_pose(_standpoint(_points(body, parts), camera, view))
    renderer = Renderer([_floor(), body])
    seen = renderer.observe(camera, eye, parts)
    looks = {actor.name: dict(look), "floor": {"floor": "#a7a59f"}}
    return renderer.shade(seen, _daylight(looks, view), "studio", 0, 0.0)


def stance(actor: ActorPlan) -> list[PartPose]:
    """Return the pose of every part of an actor at the origin, in a typical moment of its motion."""
    shape, joints = actor.shape, joints_of(actor.shape)
    if is_person(shape):
        return walk_cycle.steady_pose(Figure.of(shape), _PHASE, actor.speed)
    if has_rider(shape):
        return riding.steady_pose(Bike.of(shape), 0.7)
    return forward_kinematics(((0.0, 0.0, 0.0), IDENTITY), joints, [IDENTITY] * len(joints))


def matrices(parts: Sequence[PartPose]) -> Array:
    """Convert part poses to world-from-part transforms [P, 3, 4]."""
    rows = []
    for origin, turn in parts:
        axes = [rotate(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        rows.append([[axes[0][k], axes[1][k], axes[2][k], origin[k]] for k in range(3)])
    return np.array(rows)


def _points(body: Body, parts: Array) -> Array:
    return BodyVertices.of(body.parts).placed(parts).T


def _standpoint(points: Array, camera: CameraPlan, view: Viewpoint) -> Pose:
    """Return the nearest camera pose in the view's direction that has all points in the image, with a margin."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    turn = from_pose(Pose(yaw=view.side + 180.0, pitch=view.above))
    forward, left, up = turn[:, 0], turn[:, 1], turn[:, 2]
    p = points - middle
    along, aside, above = (p[:, 0] * a[0] + p[:, 1] * a[1] + p[:, 2] * a[2] for a in (forward, left, up))
    s, c = exact.sin_cos_deg(_FIELD / 2.0)
    wide = s / c / _MARGIN
    away = float(
        np.maximum(np.abs(aside) / wide - along, np.abs(above) / (wide * camera.height / camera.width) - along).max()
    )
    x, y, z = (float(m - away * f) for m, f in zip(middle, forward, strict=True))
    return Pose(x=x, y=y, z=z, yaw=view.side + 180.0, pitch=view.above)


def _floor() -> Body:
    builder = Builder()
    size = 200.0
    corners = [(-size, -size, 0.0), (size, -size, 0.0), (size, size, 0.0), (-size, size, 0.0)]
    builder.quads(Surface("floor", Pattern.PLAIN, Tag.GROUND), [corners])
    return Body("floor", 0, (("static", builder.mesh()),))


def _daylight(looks: dict[str, dict[str, str]], view: Viewpoint) -> AppearancePlan:
    return AppearancePlan(
        seed=0,
        weather=DAYLIGHT,
        sun=Sun(azimuth=view.side + 50.0, altitude=view.sun_altitude),
        looks=Looks(looks),
        responses={"studio": CameraResponse(exposure_compensation=-0.7, noise=0.0)},
    )
