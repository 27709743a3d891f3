"""PyBullet's TinyRenderer as an independent renderer of the same bodies, poses and camera.

It runs in a fresh process, one for all views of a scene, and passes every argument. Its samples are moved from a
pixel's corner to its centre. `depth` is metres along the optical axis; `instance` holds class * 1000 + instance of
actors, 0 elsewhere.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import CameraPlan, ScenePlan
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, part_transforms

_BATCH = 2500  # triangles in one visual shape; larger ones overflow PyBullet's shared memory


@dataclass(frozen=True)
class TinyView:
    """A frame of the Trace and a camera with its world-from-sensor transform [3, 4]."""

    frame: int
    camera: CameraPlan
    world_from_sensor: Array


def tiny_render(
    scene: ScenePlan, trace: Trace, views: Sequence[TinyView], within: float = 60.0
) -> list[dict[str, NDArray[Any]]]:
    """Return `depth` [H, W] float32 and `instance` [H, W] int32 of each view.

    Only the town's elements whose middle lies within that many metres of some view's camera are drawn, for speed.
    """
    request = {
        "scene": scene.document(),
        "views": [[v.frame, v.camera.document(), np.asarray(v.world_from_sensor).tolist()] for v in views],
        "within": within,
        "trace": trace.to_bytes().hex(),
    }
    done = subprocess.run(
        [sys.executable, __file__], input=json.dumps(request).encode(), capture_output=True, check=False
    )
    if done.returncode:
        raise AssertionError(done.stderr.decode()[-2000:])
    start = done.stdout.index(b"PK\x03\x04")  # after the line that PyBullet prints on import
    with np.load(io.BytesIO(done.stdout[start:])) as arrays:
        return [{name: arrays[f"{name}{n}"] for name in ("depth", "instance")} for n in range(len(views))]


def _quaternion(m: NDArray[np.float64]) -> tuple[float, float, float, float]:
    w = np.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    x = np.copysign(np.sqrt(max(0.0, 1 + m[0, 0] - m[1, 1] - m[2, 2])) / 2, m[2, 1] - m[1, 2])
    y = np.copysign(np.sqrt(max(0.0, 1 - m[0, 0] + m[1, 1] - m[2, 2])) / 2, m[0, 2] - m[2, 0])
    z = np.copysign(np.sqrt(max(0.0, 1 - m[0, 0] - m[1, 1] + m[2, 2])) / 2, m[1, 0] - m[0, 1])
    return float(x), float(y), float(z), float(w)


def _serve(source: IO[bytes], answer: IO[bytes]) -> None:
    import pybullet as p
    from recipe_runtime.meshes import actor_body, town_bodies
    from recipe_runtime.meshes.mesh import Mesh

    request = json.load(source)
    scene = ScenePlan.model_validate(request["scene"])
    trace = Trace.from_bytes(bytes.fromhex(request["trace"]))
    views = [TinyView(k, CameraPlan.model_validate(c), np.array(pose)) for k, c, pose in request["views"]]
    p.connect(p.DIRECT)
    ids: dict[int, int] = {}

    def put(mesh: Mesh, instance: int) -> list[int]:
        """Create the bodies of a mesh, without its surfaces."""
        made = []
        for start in range(0, len(mesh.triangles), _BATCH):
            index = mesh.triangles[start : start + _BATCH].reshape(-1)
            shape = p.createVisualShape(
                p.GEOM_MESH,
                vertices=mesh.vertices[index].tolist(),
                normals=mesh.normals[index].tolist(),
                indices=list(range(len(index))),
                rgbaColor=[0.6, 0.6, 0.6, 1.0],
                specularColor=[0, 0, 0],
            )
            made.append(p.createMultiBody(0, -1, shape))
        ids.update(dict.fromkeys(made, instance))
        return made

    eyes = np.array([view.world_from_sensor[:2, 3] for view in views])
    for element, body in zip(scene.town.elements, town_bodies(scene.town), strict=True):
        reach = ((eyes - (element.pose.x, element.pose.y)) ** 2).sum(axis=1).min()
        if reach < request["within"] ** 2:
            put(body.parts[0][1], 0)
    bodies = [actor_body(actor) for actor in scene.actors]
    parts = [put(mesh, body.instance) for body in bodies for _, mesh in body.parts]
    arrays = {}
    for number, view in enumerate(views):
        for made, pose in zip(parts, part_transforms(trace, view.frame), strict=True):
            for body_id in made:
                p.resetBasePositionAndOrientation(body_id, pose[:, 3].tolist(), _quaternion(pose))
        depth, segment = _drawn(p, view)
        table = np.zeros(max(ids, default=0) + 2, np.int32)
        for body_id, instance in ids.items():
            table[body_id] = instance
        found = np.where(segment >= 0, segment & ((1 << 24) - 1), len(table) - 1)
        arrays[f"depth{number}"], arrays[f"instance{number}"] = depth.astype(np.float32), table[found]
    np.savez(answer, **arrays)  # type: ignore[arg-type]  # numpy's types take an array for `allow_pickle`


def _drawn(engine: Any, view: TinyView) -> tuple[NDArray[np.float64], NDArray[np.int_]]:
    """Return depth in metres and PyBullet's segmentation mask."""
    camera, sensor = view.camera, view.world_from_sensor
    eye, forward, up = sensor[:, 3], sensor[:, 0], sensor[:, 2]
    near, far = camera.near, min(camera.far, 1000.0)
    half = np.tan(np.radians(camera.fov) / 2) * near
    tall = half * camera.height / camera.width
    # TinyRenderer takes its samples at whole pixels counted from the picture's lower left corner, so at pixels' lower
    # left corners; moving the picture by half a pixel puts them at pixels' centres.
    right, lift = half / camera.width, tall / camera.height
    _, _, _, depth, segments = engine.getCameraImage(
        camera.width,
        camera.height,
        viewMatrix=engine.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist()),
        projectionMatrix=engine.computeProjectionMatrix(
            right - half, right + half, lift - tall, lift + tall, near, far
        ),
        lightDirection=(-30, -40, 60),
        lightColor=(1, 1, 1),
        lightDistance=100,
        shadow=0,
        lightAmbientCoeff=0.5,
        lightDiffuseCoeff=0.6,
        lightSpecularCoeff=0.0,
        renderer=engine.ER_TINY_RENDERER,
        flags=engine.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
    )
    size = (camera.height, camera.width)
    buffer = np.reshape(np.asarray(depth, np.float64), size)
    return far * near / (far - (far - near) * buffer), np.reshape(np.asarray(segments), size)


if __name__ == "__main__":
    out = io.BytesIO()
    _serve(sys.stdin.buffer, out)
    sys.stdout.flush()
    sys.stdout.buffer.write(out.getvalue())
