"""Ground truth of one frame for every visible actor: visible pixels and position.

An actor is annotated in a frame if at least one of its pixels is visible. `annotate.records.LabelRecord` lists the
fields of a record. All numbers come from exact arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import CameraPlan, ScenePlan
from recipe_compiler.ir.plan_types import fixed

from recipe_runtime.annotate.actor_boxes import Extent, GroundedBoxes, TightBoxes
from recipe_runtime.annotate.calibration import calibration
from recipe_runtime.annotate.masks import masks
from recipe_runtime.annotate.records import Box3d, Boxes, LabelledFrame, LabelRecord
from recipe_runtime.body.kinematics import quaternion_of_matrix
from recipe_runtime.core.interfaces import Observed
from recipe_runtime.core.trace import METRE, Trace
from recipe_runtime.core.transforms import Array, compose, invert, part_transforms, transform_points
from recipe_runtime.meshes.mesh import Body


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
        self._fps = scene.clock.fps
        self._grounded, self._tight = GroundedBoxes(scene.actors, trace), TightBoxes(trace, bodies)

    def labels(self, seen: Observed, camera: CameraPlan, world_from_sensor: Array, frame: int) -> LabelledFrame:
        """Return the labels of a frame: a record for every visible object, sorted by instance.

        Args:
            seen: The observation of the frame.
            camera: The camera that observed it.
            world_from_sensor: Pose of the sensor, [3, 4], x forward, y left, z up, metres.
            frame: Number of the frame.
        """
        parts, velocities = part_transforms(self._trace, frame), self._trace.linear[frame].tolist()
        views = {view.instance: view for view in seen.objects}
        records: list[LabelRecord] = []
        for mask in masks(seen.instance):
            actor, view = self._by_instance[mask.instance], views[mask.instance]
            boxes = self._boxes(actor, parts, world_from_sensor)
            x, y, z = boxes["box3d"]["centre"]
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
                    **boxes,
                    "distance": fixed(math.sqrt(x * x + y * y + z * z)),
                    "velocity": [fixed(v / METRE) for v in velocities[self._numbers[actor]]],
                }
            )
        return {
            "frame": frame,
            "time": fixed(frame / self._fps),
            "calibration": calibration(camera, world_from_sensor),
            "objects": records,
        }

    def _boxes(self, actor: str, parts: Array, world_from_sensor: Array) -> Boxes:
        """Return the boxes of an actor, in the frames of sensor and world.

        Args:
            actor: Name of the actor.
            parts: World-from-part transforms, [P, 3, 4].
            world_from_sensor: Pose of the sensor, [3, 4].
        """
        base = self._trace.base_part(actor)
        in_sensor = compose(invert(world_from_sensor), parts[base])
        body, tight = self._grounded.extent(actor, parts, base), self._tight.extent(actor, parts)
        return {
            "box3d": box3d(in_sensor, body),
            "box3d_world": box3d(parts[base], body),
            "tight3d": box3d(in_sensor, tight),
            "tight3d_world": box3d(parts[base], tight),
        }


def box3d(frame_from_base: Array, extent: Extent) -> Box3d:
    """Return a box in another frame.

    Args:
        frame_from_base: Transform from the frame of the base part, [3, 4].
        extent: Lowest and highest corner in the frame of the base part.
    """
    low, high = extent
    r = frame_from_base
    centre = transform_points(r, ((low + high) / 2.0)[None])[0]
    return {
        "centre": [fixed(v) for v in centre.tolist()],
        "size": [fixed(v) for v in (high - low).tolist()],
        "rotation": [fixed(v) for v in quaternion(r)],
        "yaw": fixed(exact.atan2_deg(float(r[1, 0]), float(r[0, 0]))),
    }


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
