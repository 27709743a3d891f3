"""Ground truth of one frame for every visible actor: visible pixels and position.

An actor is annotated in a frame if at least one of its pixels is visible. `annotate.records.LabelRecord` lists the
fields of a record. All numbers come from exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraPlan, ScenePlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.annotate.masks import masks
from recipe_runtime.annotate.records import Box3d, LabelRecord
from recipe_runtime.body.kinematics import quaternion_of_matrix
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.transforms import Array, compose, invert, part_transforms
from recipe_runtime.meshes.mesh import Body

_PART_FRAMES = 1 << 13  # number of poses (parts times frames) in one batch
_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


class Annotator:
    """Makes the records of the actors of one scene.

    Args:
        scene: The plan of the scene.
        trace: The motion of the scene.
        bodies: The meshes of the actors. Bodies that are not actors of the scene are ignored.
    """

    def __init__(self, scene: ScenePlan, trace: Trace, bodies: Sequence[Body]) -> None:
        self._trace = trace
        self._by_instance = {a.tag * 1000 + a.instance: a.name for a in scene.actors}
        self._numbers = {actor: number for number, actor in enumerate(trace.actors)}
        meshes = {body.name: body for body in bodies}
        self._extents = _extents(trace, [meshes[a.name] for a in scene.actors])

    def records(self, seen: Observed, camera: CameraPlan, world_from_sensor: Array, frame: int) -> list[LabelRecord]:
        """Return a record for every visible object, sorted by instance.

        Args:
            seen: The observation of the frame.
            camera: The camera that observed it.
            world_from_sensor: Pose of the sensor, [3, 4], x forward, y left, z up, metres.
            frame: Number of the frame.
        """
        sensor_from_world = invert(world_from_sensor)
        parts, velocities = part_transforms(self._trace, frame), self._trace.linear[frame].tolist()
        views = {view.instance: view for view in seen.objects}
        records: list[LabelRecord] = []
        for mask in masks(seen.instance):
            actor, view = self._by_instance[mask.instance], views[mask.instance]
            base = compose(sensor_from_world, parts[self._trace.base_part(actor)])
            box, distance = self._box(actor, base)
            x0, y0, x1, y1 = (int(v) for v in view.amodal_box)
            records.append(
                {
                    "instance": mask.instance,
                    "actor": actor,
                    "bbox": list(mask.box),
                    "area": mask.area,
                    "counts": mask.counts,
                    "amodal_bbox": [x0, y0, x1 - x0, y1 - y0],
                    "amodal_area": int(view.amodal),
                    "visible_fraction": fixed(mask.area / int(view.amodal)),
                    "truncation": truncation(view.projected, camera),
                    "box3d": box,
                    "distance": distance,
                    "velocity": [fixed(v / METRE) for v in velocities[self._numbers[actor]]],
                }
            )
        return records

    def _box(self, actor: str, sensor_from_base: Array) -> tuple[Box3d, float]:
        """The box of an actor in the sensor's frame, and the distance to its centre in metres."""
        low, high = self._extents[actor]
        centre = _apply(sensor_from_base, ((low + high) / 2.0)[None])[0]
        r = sensor_from_base
        box: Box3d = {
            "centre": [fixed(float(v)) for v in centre],
            "size": [fixed(float(v)) for v in high - low],
            "rotation": [fixed(v) for v in quaternion(r)],
            "yaw": fixed(exact.atan2_deg(float(r[1, 0]), float(r[0, 0]))),
        }
        distance = np.sqrt(centre[0] * centre[0] + centre[1] * centre[1] + centre[2] * centre[2])
        return box, fixed(float(distance))


def quaternion(transform: Array) -> tuple[float, float, float, float]:
    """Return the rotation of a rigid transform [3, 4] as a unit quaternion w, x, y, z.

    The first component that is not 0 is positive.
    """
    return quaternion_of_matrix([[float(transform[i, j]) for j in range(3)] for i in range(3)])


def truncation(projected: Sequence[float], camera: CameraPlan) -> float:
    """Return the share of the area of a projected box that lies outside the image.

    Args:
        projected: x0, y0, x1, y1 in pixels, not clipped to the image.
        camera: The camera; gives the size of the image.
    """
    x0, y0, x1, y1 = (float(v) for v in projected)
    whole = (x1 - x0) * (y1 - y0)
    wide = min(x1, float(camera.width)) - max(x0, 0.0)
    high = min(y1, float(camera.height)) - max(y0, 0.0)
    return fixed(1.0 - max(wide, 0.0) * max(high, 0.0) / whole) if whole > 0.0 else 0.0


def _extents(trace: Trace, bodies: Sequence[Body]) -> dict[str, tuple[Array, Array]]:
    """Return the lowest and highest corner of each actor's bounding box over all frames, in its base part's frame."""
    rows, bases, corners, owners = [], [], [], []
    for number, body in enumerate(bodies):
        for row in trace.actor_parts(body.name):
            vertices = body.mesh(trace.parts[row].rpartition("/")[2]).vertices.astype(np.float64)
            if len(vertices):
                low, high = vertices.min(axis=0), vertices.max(axis=0)
                rows.append(row)
                bases.append(trace.base_part(body.name))
                corners.append(low + _CORNERS * (high - low))
                owners.append(number)
    lows, highs = np.full((len(rows), 3), np.inf), np.full((len(rows), 3), -np.inf)
    step = max(1, _PART_FRAMES // max(1, len(trace.parts)))
    for start in range(0, trace.frames if rows else 0, step):
        poses = part_transforms(trace, slice(start, start + step))
        moved = _apply(compose(invert(poses)[:, bases], poses[:, rows]), np.array(corners))
        lows = np.minimum(lows, moved.min(axis=(0, 2)))
        highs = np.maximum(highs, moved.max(axis=(0, 2)))
    parts = {body.name: [i for i, owner in enumerate(owners) if owner == n] for n, body in enumerate(bodies)}
    return {name: (lows[mine].min(axis=0), highs[mine].max(axis=0)) for name, mine in parts.items()}


def _apply(transform: Array, points: Array) -> Array:
    """Apply transforms [..., 3, 4] to points [..., N, 3]."""
    t = transform[..., None, :, :]
    x, y, z = points[..., 0:1], points[..., 1:2], points[..., 2:3]
    moved: Array = t[..., 0] * x + t[..., 1] * y + t[..., 2] * z + t[..., 3]
    return moved
