"""The plain script that Dataset Recipe is compared with: PyBullet simulates and renders, Pillow writes.

    python -m benchmarks.baseline STAGE OUT --renderer tiny --shadow 1 --frames 15

It is what a competent user would write for the same scene: meshes merged by colour and loaded once, physics stepped
between frames, one `getCameraImage` per frame for colour, depth and segmentation, three PNG files with Pillow's
default settings. No annotations, no digests. The last line of its output is a JSON object: seconds by stage, and `cpu`,
the CPU time of all but the loading.
"""

from __future__ import annotations

import argparse
import json
import pkgutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
from PIL import Image

GROUND = 0.15  # metres; the sidewalk that both walk on


def main() -> None:
    """Render the frames and print the time of each stage."""
    parser = argparse.ArgumentParser()
    parser.add_argument("stage", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--renderer", choices=["tiny", "egl"], default="tiny")
    parser.add_argument("--shadow", choices=["default", "1"], default="default")
    parser.add_argument("--frames", type=int, default=15)
    arguments = parser.parse_args()
    seconds = {"load": 0.0, "simulate": 0.0, "render": 0.0, "encode and write": 0.0}
    clock = time.perf_counter

    start = clock()
    stage = json.loads((arguments.stage / "stage.json").read_text())
    p.connect(p.DIRECT)
    if arguments.renderer == "egl":
        load_egl()
    parts, walkers = load(stage, arguments.stage)
    picture = camera(stage, arguments.renderer, arguments.shadow)
    arguments.out.mkdir(parents=True, exist_ok=True)
    picture(0)  # the first one also uploads meshes
    seconds["load"] = clock() - start

    total = len(stage["parts"][0]["positions"])
    cpu = time.process_time()
    for number in range(arguments.frames):
        frame = number * total // arguments.frames  # all along the clip, as people come near and go
        a = clock()
        step(stage, parts, walkers, frame)
        b = clock()
        rgba, depth, segments = picture(frame)
        c = clock()
        save(arguments.out, frame, rgba, depth, segments, stage["camera"])
        d = clock()
        seconds["simulate"] += b - a
        seconds["render"] += c - b
        seconds["encode and write"] += d - c
    print(json.dumps({"frames": arguments.frames, "seconds": seconds, "cpu": time.process_time() - cpu}))


def load_egl() -> None:
    """Load PyBullet's hardware renderer, which renders off screen through EGL."""
    found = pkgutil.get_loader("eglRenderer")  # type: ignore[attr-defined,unused-ignore]  # gone in 3.14
    if found is None or p.loadPlugin(found.get_filename(), "_eglRendererPlugin") < 0:  # type: ignore[attr-defined,unused-ignore]
        raise SystemExit("PyBullet's EGL plugin does not load")


def load(stage: dict[str, Any], folder: Path) -> tuple[list[list[int]], list[int]]:
    """Create the bodies of every part (one per colour), the pedestrians' capsules, the town and the ground."""
    p.setTimeStep(1 / stage["physics"])
    p.setGravity(0, 0, -9.81)
    unseen = p.createVisualShape(p.GEOM_SPHERE, radius=0.001)  # else a collision shape is drawn
    ground = p.createCollisionShape(p.GEOM_BOX, halfExtents=(200, 200, 1))
    p.createMultiBody(0, ground, unseen, (0, 0, GROUND - 1))

    def put(mesh: dict[str, Any]) -> int:
        shape = p.createVisualShape(p.GEOM_MESH, fileName=str(folder / mesh["file"]), rgbaColor=mesh["colour"])
        return int(p.createMultiBody(0, -1, shape))

    for mesh in stage["town"]:
        put(mesh)
    parts = [[put(mesh) for mesh in part["meshes"]] for part in stage["parts"]]
    capsule = p.createCollisionShape(p.GEOM_CAPSULE, radius=0.25, height=1.2)
    walkers = []
    for walker in stage["walkers"]:
        position = (walker["start"]["x"], walker["start"]["y"], GROUND + 0.86)
        walkers.append(p.createMultiBody(70, capsule, unseen, position))
        p.changeDynamics(walkers[-1], -1, localInertiaDiagonal=(0, 0, 0))
    return parts, walkers


def step(stage: dict[str, Any], parts: list[list[int]], walkers: list[int], frame: int) -> None:
    """Advance the simulation by one frame, and place the limbs."""
    for _ in range(stage["steps"]):
        for body, walker in zip(walkers, stage["walkers"], strict=True):
            (x, y, _z), _ = p.getBasePositionAndOrientation(body)
            dx, dy = walker["goal"]["x"] - x, walker["goal"]["y"] - y
            scale = walker["speed"] / max((dx * dx + dy * dy) ** 0.5, 0.1)
            p.resetBaseVelocity(body, (dx * scale, dy * scale, 0))
        p.stepSimulation()
    for bodies, part in zip(parts, stage["parts"], strict=True):
        for body in bodies:
            p.resetBasePositionAndOrientation(body, part["positions"][frame], part["rotations"][frame])


def camera(stage: dict[str, Any], renderer: str, shadow: str) -> Callable[[int], tuple[Any, Any, Any]]:
    """Return a function that renders one frame."""
    plan = stage["camera"]
    projection = p.computeProjectionMatrixFOV(plan["fov"], plan["width"] / plan["height"], plan["near"], plan["far"])
    options = {"shadow": 1, "lightDirection": (-3, -4, 2)} if shadow == "1" else {}
    kind = p.ER_TINY_RENDERER if renderer == "tiny" else p.ER_BULLET_HARDWARE_OPENGL

    def picture(frame: int) -> tuple[Any, Any, Any]:
        eye = stage["eyes"][frame]
        target = [e + f for e, f in zip(eye["at"], eye["forward"], strict=True)]
        view = p.computeViewMatrix(eye["at"], target, eye["up"])
        width, height, rgba, depth, segments = p.getCameraImage(
            plan["width"], plan["height"], view, projection, renderer=kind, **options
        )
        shape = (height, width)
        return np.reshape(rgba, (*shape, 4)), np.reshape(depth, shape), np.reshape(segments, shape)

    return picture


def save(out: Path, frame: int, rgba: Any, depth: Any, segments: Any, plan: dict[str, Any]) -> None:
    """Write three PNG files: colour, depth in CARLA's 24 bits, and segmentation in 16 bits."""
    near, far = plan["near"], plan["far"]
    Image.fromarray(rgba[:, :, :3].astype(np.uint8)).save(out / f"rgb_{frame:06d}.png")
    metres = far * near / (far - (far - near) * depth)
    steps = (np.clip(metres / 1000.0, 0, 1) * (2**24 - 1)).astype(np.uint32)
    channels = np.stack([steps & 255, (steps >> 8) & 255, steps >> 16], axis=-1).astype(np.uint8)
    Image.fromarray(channels).save(out / f"depth_{frame:06d}.png")
    Image.fromarray((segments + 1).astype(np.uint16)).save(out / f"instance_{frame:06d}.png")


if __name__ == "__main__":
    main()
