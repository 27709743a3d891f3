"""Views of a scene's flat surfaces, each covered by the placeholder: where a patch could be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir import exact
from recipe_compiler.ir.patches import GREEN, PatchPlan, PatchTexture
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, CameraResponse, Looks, Pose, ScenePlan, Sun

from recipe_runtime.core.asset_files import Assets
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import from_pose
from recipe_runtime.frames.portrait import DAYLIGHT
from recipe_runtime.frames.scene_motion import SceneMotion
from recipe_runtime.meshes import scene_bodies

_FIELD = 75.0  # degrees
_ROOM = 1.5  # how much more than a surface its view holds
_LOWER = 20.0  # degrees by which a view of the ground or of a roof is turned down from straight ahead
_NEAREST, _FARTHEST = 2.5, 40.0  # metres


def surface_views(
    scene: ScenePlan,
    looks: Looks,
    patches: Sequence[PatchPlan],
    width: int = 400,
    height: int = 300,
    assets: Assets | None = None,
) -> Iterator[NDArray[np.uint8]]:
    """Yield a picture [H, W, 3] of each patch, a rectangle on the static scene, as the placeholder by day.

    Args:
        scene: the scene; its actors are left out.
        looks: its colours.
        patches: the patches.
        width: of a picture, in pixels.
        height: the same.
        assets: the files of its props; None if they have none.
    """
    from recipe_runtime.render.renderer import Renderer

    empty = scene.model_copy(update={"actors": ()})
    assets = assets or Assets()
    renderer = Renderer(scene_bodies(empty, assets), images=assets.image)
    parts = SceneMotion(empty, _still()).parts(0)
    camera = CameraPlan(width=width, height=height, fov=_FIELD)
    for patch in patches:
        shown = patch.model_copy(update={"texture": PatchTexture(colour=GREEN), "mode": "green"})
        seen = renderer.observe(camera, from_pose(_standpoint(patch)), parts)
        yield renderer.shade(seen, _daylight(looks, shown), "view", 0, 0.0)


def _still() -> Trace:
    """The motion of a scene without actors."""
    position, rotation = np.zeros((1, 0, 3), np.int64), np.zeros((1, 0, 4), np.int32)
    return Trace((), (), position, rotation, position, position)


def _standpoint(patch: PatchPlan) -> Pose:
    """Return the pose of a camera in front of the middle of a rectangle; obliquely above a level one."""
    face = patch.faces[0]
    middle = [sum(corner[axis] for corner in face.corners) / 4 for axis in range(3)]
    sine, cosine = exact.sin_cos_deg(_FIELD / 2.0)
    away = min(max(_ROOM * max(face.width, 1.34 * face.height) / 2.0 * cosine / sine, _NEAREST), _FARTHEST)
    x, y, z = face.normal
    pitch = 0.0
    if z > 0.7:  # seen from its foot
        fall, rise = exact.sin_cos_deg(_LOWER)
        x, y, z = face.down[0] * rise, face.down[1] * rise, fall
        pitch = _LOWER
    yaw = exact.atan2_deg(-y, -x)
    return Pose(x=middle[0] + away * x, y=middle[1] + away * y, z=max(middle[2] + away * z, 0.5), yaw=yaw, pitch=pitch)


def _daylight(looks: Looks, patch: PatchPlan) -> AppearancePlan:
    return AppearancePlan(
        seed=0,
        weather=DAYLIGHT,
        sun=Sun(azimuth=130.0, altitude=50.0),
        looks=looks,
        patches=(patch,),
        responses={"view": CameraResponse(noise=0.0)},
    )
