"""PyBullet's TinyRenderer as an independent witness: the same bodies, poses and camera, drawn by other code.

It runs in a fresh process, draws once to warm up (a first picture can differ from later ones, because it renormalises
normals in place), and passes every argument. Its samples are moved from a pixel's corner to its centre. `rgb` is
plain; `depth` is metres along the optical axis; `instance` holds class * 1000 + instance of actors, 0 elsewhere.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import AppearancePlan, CameraPlan, ScenePlan
from recipe_runtime.core.trace import Trace
from recipe_runtime.core.transforms import Array, part_transforms

_BATCH = 2500  # triangles in one visual shape; larger ones overflow PyBullet's shared memory


def tiny_render(
    scene: ScenePlan,
    trace: Trace,
    frame: int,
    camera: CameraPlan,
    world_from_sensor: Array,
    looks: dict[str, dict[str, str]] | None = None,
    within: float = 60.0,
) -> dict[str, NDArray[Any]]:
    """`rgb` [H, W, 3] uint8, `depth` [H, W] float32 and `instance` [H, W] int32 of one frame.

    Only the town's elements whose middle lies within that many metres of the camera are drawn, for speed.
    """
    request = {
        "scene": scene.document(),
        "frame": frame,
        "camera": camera.document(),
        "sensor": np.asarray(world_from_sensor).tolist(),
        "looks": looks or {},
        "within": within,
        "trace": trace.to_bytes().hex(),
    }
    done = subprocess.run(
        [sys.executable, __file__], input=json.dumps(request).encode(), capture_output=True, check=False
    )
    if done.returncode:
        raise AssertionError(done.stderr.decode()[-2000:])
    start = done.stdout.index(b"PK\x03\x04")  # after PyBullet's build line
    with np.load(io.BytesIO(done.stdout[start:])) as arrays:
        return {name: arrays[name] for name in ("rgb", "depth", "instance")}


def looks_of(appearance: AppearancePlan) -> dict[str, dict[str, str]]:
    """Colours for `tiny_render`."""
    return appearance.looks.root


def _quaternion(m: NDArray[np.float64]) -> tuple[float, float, float, float]:
    w = np.sqrt(max(0.0, 1 + m[0, 0] + m[1, 1] + m[2, 2])) / 2
    x = np.copysign(np.sqrt(max(0.0, 1 + m[0, 0] - m[1, 1] - m[2, 2])) / 2, m[2, 1] - m[1, 2])
    y = np.copysign(np.sqrt(max(0.0, 1 - m[0, 0] + m[1, 1] - m[2, 2])) / 2, m[0, 2] - m[2, 0])
    z = np.copysign(np.sqrt(max(0.0, 1 - m[0, 0] - m[1, 1] + m[2, 2])) / 2, m[1, 0] - m[0, 1])
    return float(x), float(y), float(z), float(w)


def _colour(text: str) -> list[float]:
    return [int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)] + [1.0]


def _serve(source: IO[bytes], answer: IO[bytes]) -> None:
    import pybullet as p
    from recipe_runtime.meshes import actor_body, town_bodies
    from recipe_runtime.meshes.mesh import Mesh

    request = json.load(source)
    scene, camera = ScenePlan.model_validate(request["scene"]), CameraPlan.model_validate(request["camera"])
    trace, frame = Trace.from_bytes(bytes.fromhex(request["trace"])), request["frame"]
    p.connect(p.DIRECT)
    ids: dict[int, int] = {}

    def put(mesh: Mesh, look: dict[str, str], instance: int, pose: NDArray[np.float64] | None) -> None:
        for number, surface in enumerate(mesh.surfaces):
            triangles = mesh.triangles[mesh.surface == number]
            for start in range(0, len(triangles), _BATCH):
                index = triangles[start : start + _BATCH].reshape(-1)
                shape = p.createVisualShape(
                    p.GEOM_MESH,
                    vertices=mesh.vertices[index].tolist(),
                    normals=mesh.normals[index].tolist(),
                    indices=list(range(len(index))),
                    rgbaColor=_colour(look.get(surface.slot, "#999999")),
                    specularColor=[0, 0, 0],
                )
                position = (0, 0, 0) if pose is None else pose[:, 3].tolist()
                orientation = (0, 0, 0, 1) if pose is None else _quaternion(pose)
                ids[p.createMultiBody(0, -1, shape, position, orientation)] = instance

    looks = request["looks"]
    sensor = np.array(request["sensor"])
    for element, body in zip(scene.town.elements, town_bodies(scene.town), strict=True):
        dx, dy = element.pose.x - sensor[0, 3], element.pose.y - sensor[1, 3]
        if dx * dx + dy * dy < request["within"] ** 2:
            put(body.parts[0][1], looks.get(body.name, {}), 0, None)
    poses, row = part_transforms(trace, frame), 0
    for actor in scene.actors:
        body = actor_body(actor)
        for _, mesh in body.parts:
            put(mesh, looks.get(actor.name, {}), body.instance, poses[row])
            row += 1

    eye, forward, up = sensor[:, 3], sensor[:, 0], sensor[:, 2]
    near, far = camera.near, min(camera.far, 1000.0)
    half = np.tan(np.radians(camera.fov) / 2) * near
    tall = half * camera.height / camera.width
    view = p.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist())
    # TinyRenderer takes its samples at whole pixels counted from the picture's lower left corner, so at pixels' lower
    # left corners; moving the picture by half a pixel puts them at pixels' centres.
    right, lift = half / camera.width, tall / camera.height
    projection = p.computeProjectionMatrix(right - half, right + half, lift - tall, lift + tall, near, far)
    for _ in range(2):
        _, _, rgba, depth, segments = p.getCameraImage(
            camera.width,
            camera.height,
            viewMatrix=view,
            projectionMatrix=projection,
            lightDirection=(-30, -40, 60),
            lightColor=(1, 1, 1),
            lightDistance=100,
            shadow=0,
            lightAmbientCoeff=0.5,
            lightDiffuseCoeff=0.6,
            lightSpecularCoeff=0.0,
            renderer=p.ER_TINY_RENDERER,
            flags=p.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        )
    size = (camera.height, camera.width)
    buffer = np.reshape(np.asarray(depth, np.float64), size)
    metres = far * near / (far - (far - near) * buffer)
    segment = np.reshape(np.asarray(segments), size)
    table = np.zeros(max(ids, default=0) + 2, np.int32)
    for body_id, instance in ids.items():
        table[body_id] = instance
    found = np.where(segment >= 0, segment & ((1 << 24) - 1), len(table) - 1)
    rgb = np.reshape(np.asarray(rgba, np.uint8), (*size, 4))[:, :, :3]
    np.savez(answer, rgb=rgb, depth=metres.astype(np.float32), instance=table[found])


if __name__ == "__main__":
    out = io.BytesIO()
    _serve(sys.stdin.buffer, out)
    sys.stdout.flush()
    sys.stdout.buffer.write(out.getvalue())
