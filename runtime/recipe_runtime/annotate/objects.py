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
from recipe_runtime.core.transforms import Array, compose, invert, part_transforms
from recipe_runtime.meshes.mesh import Body


class Annotator:
    """Computes the label records of the actors of one scene.

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
        views, sensor_from_world = {view.instance: view for view in seen.objects}, invert(world_from_sensor)
        records: list[LabelRecord] = []
        for mask in masks(seen.instance):
            actor, view = self._by_instance[mask.instance], views[mask.instance]
            boxes = self._boxes(actor, parts, sensor_from_world)
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

    def _boxes(self, actor: str, parts: Array, sensor_from_world: Array) -> Boxes:
        """Return the boxes of an actor, in the frames of sensor and world.

        Args:
            actor: Name of the actor.
            parts: World-from-part transforms, [P, 3, 4].
            sensor_from_world: The inverse of the sensor's pose, [3, 4].
        """
        base = self._trace.base_part(actor)
        world, sensor = _Axes(parts[base]), _Axes(compose(sensor_from_world, parts[base]))
        body, tight = self._grounded.extent(actor, parts, base), self._tight.extent(actor, parts)
        return {
            "box3d": sensor.box(body),
            "box3d_world": world.box(body),
            "tight3d": sensor.box(tight),
            "tight3d_world": world.box(tight),
        }


class _Axes:
    """The axes of an actor's base part in another frame of reference."""

    def __init__(self, frame_from_base: Array) -> None:  # [3, 4]
        self._rows: list[list[float]] = frame_from_base.tolist()
        self._rotation = [fixed(v) for v in quaternion_of_matrix([row[:3] for row in self._rows])]
        self._yaw = fixed(exact.atan2_deg(self._rows[1][0], self._rows[0][0]))

    def box(self, extent: Extent) -> Box3d:
        """Return a box, given by its lowest and highest corner in the frame of the base part."""
        low, high = (corner.tolist() for corner in extent)
        x, y, z = ((a + b) / 2.0 for a, b in zip(low, high, strict=True))
        return {
            "centre": [fixed(row[0] * x + row[1] * y + row[2] * z + row[3]) for row in self._rows],
            "size": [fixed(b - a) for a, b in zip(low, high, strict=True)],
            "rotation": list(self._rotation),
            "yaw": self._yaw,
        }


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
