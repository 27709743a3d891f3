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
from recipe_runtime.meshes.mesh import Mesh

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

    request = json.load(source)
    scene = ScenePlan.model_validate(request["scene"])
    trace = Trace.from_bytes(bytes.fromhex(request["trace"]))
    views = [TinyView(k, CameraPlan.model_validate(c), np.array(pose)) for k, c, pose in request["views"]]
    p.connect(p.DIRECT)
    ids: dict[int, int] = {}

    def put(vertices: NDArray[Any], normals: NDArray[Any], triangles: NDArray[Any], instance: int) -> list[int]:
        """Create bodies of the triangles, without their surfaces."""
        made = []
        for start in range(0, len(triangles), _BATCH):
            index = triangles[start : start + _BATCH].reshape(-1)
            shape = p.createVisualShape(
                p.GEOM_MESH,
                vertices=vertices[index].tolist(),
                normals=normals[index].tolist(),
                indices=list(range(len(index))),
                rgbaColor=[0.6, 0.6, 0.6, 1.0],
                specularColor=[0, 0, 0],
            )
            made.append(p.createMultiBody(0, -1, shape))
        ids.update(dict.fromkeys(made, instance))
        return made

    eyes = np.array([view.world_from_sensor[:2, 3] for view in views])
    still = np.eye(4)[:3]
    in_levels: list[Mesh] = []
    for element, body in zip(scene.town.elements, town_bodies(scene.town), strict=True):
        reach = ((eyes - (element.pose.x, element.pose.y)) ** 2).sum(axis=1).min()
        if reach < request["within"] ** 2:
            mesh = body.parts[0][1]
            put(mesh.vertices, mesh.normals, mesh.triangles[_always(mesh)], 0)
            if mesh.levels:
                in_levels.append(mesh)
    bodies = [actor_body(actor) for actor in scene.actors]
    rigid = [
        [] if mesh.skin else put(mesh.vertices, mesh.normals, mesh.triangles[_always(mesh)], body.instance)
        for body in bodies
        for _, mesh in body.parts
    ]
    arrays = {}
    for number, view in enumerate(views):
        poses = list(part_transforms(trace, view.frame))
        for made, pose in zip(rigid, poses, strict=True):
            for body_id in made:
                p.resetBasePositionAndOrientation(body_id, pose[:, 3].tolist(), _quaternion(pose))
        once: list[int] = []  # bodies of this view
        for mesh in in_levels:
            once += put(mesh.vertices, mesh.normals, mesh.triangles[_shown(mesh, view, still) & ~_always(mesh)], 0)
        for body in bodies:
            parts, poses = poses[: len(body.parts)], poses[len(body.parts) :]
            for (_, mesh), pose in zip(body.parts, parts, strict=True):
                shown = mesh.triangles[_shown(mesh, view, parts[0]) & ~(_always(mesh) & (mesh.skin is None))]
                vertices = _bent(mesh, parts) if mesh.skin else mesh.vertices @ pose[:, :3].T
                origin = parts[0][:, 3] if mesh.skin else pose[:, 3]
                for body_id in (made := put(vertices, mesh.normals, shown, body.instance)):
                    p.resetBasePositionAndOrientation(body_id, origin.tolist(), (0, 0, 0, 1))
                once += made
        depth, segment = _drawn(p, view)
        table = np.zeros(max(ids, default=0) + 2, np.int32)
        for body_id, instance in ids.items():
            table[body_id] = instance
        for body_id in once:
            p.removeBody(body_id)
        found = np.where(segment >= 0, segment & ((1 << 24) - 1), len(table) - 1)
        arrays[f"depth{number}"], arrays[f"instance{number}"] = depth.astype(np.float32), table[found]
    np.savez(answer, **arrays)  # type: ignore[arg-type]  # numpy's types take an array for `allow_pickle`


def _always(mesh: Mesh) -> NDArray[np.bool_]:
    """Return which triangles are shown at any distance, [T]."""
    return np.ones(len(mesh.triangles), bool) if mesh.level is None else mesh.level < 0


def _shown(mesh: Mesh, view: TinyView, world_from_base: Array) -> NDArray[np.bool_]:
    """Return the triangles that a view shows, [T]: by the distance that a focal length of 640 pixels would need."""
    focal = view.camera.width / 2 / np.tan(np.radians(view.camera.fov) / 2)
    shown = _always(mesh)
    for number, level in enumerate(mesh.levels):
        anchor = world_from_base[:, :3] @ np.array(level.anchor) + world_from_base[:, 3]
        distance = np.linalg.norm(anchor - view.world_from_sensor[:, 3]) * 640.0 / focal
        shown |= (mesh.level == number) & bool(level.near <= distance < level.far)
    return shown


def _bent(mesh: Mesh, parts: list[Array]) -> NDArray[np.float64]:
    """Return the vertices of a skin in a frame, from the origin of the base part, along the axes of the world."""
    assert mesh.skin is not None
    vertices = np.zeros((len(mesh.vertices), 3))
    for followed, weight in zip(mesh.skin.parts.T, mesh.skin.weights.T / 255.0, strict=True):
        poses = np.array(parts)[followed]
        offsets = mesh.vertices - mesh.skin.origins[followed]
        places = np.einsum("vij,vj->vi", poses[:, :, :3], offsets) + poses[:, :, 3]
        vertices += weight[:, None] * (places - parts[0][:, 3])
    return vertices


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
