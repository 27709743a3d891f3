"""A scene as files that any PyBullet script can load: OBJ meshes by colour, and their poses.

The town is merged into one mesh per colour for speed; every rigid part of an actor is one mesh per colour, in its own
frame.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recipe_compiler.ir.plan import ScenarioPlan
from recipe_runtime.core.trace import METRE, UNIT, Trace
from recipe_runtime.core.transforms import sensor_transform
from recipe_runtime.meshes import actor_body, town_bodies
from recipe_runtime.meshes.mesh import Mesh

Corners = NDArray[np.float32]  # [3 T, 6] positions and normals, three rows a triangle


def write_stage(scenario: ScenarioPlan, trace: Trace, folder: Path) -> None:
    """Write `stage.json` and its meshes: town, parts with a pose per frame, pedestrians, the camera's path."""
    looks, scene = scenario.appearance.looks.root, scenario.scene
    sensor = scenario.rig.sensors[0]
    town = _write_meshes(folder, "town", ((b.parts[0][1], looks.get(b.name, {})) for b in town_bodies(scene.town)))
    parts: list[dict[str, Any]] = []
    for actor in scene.actors:
        for part, mesh in actor_body(actor).parts:
            row = trace.parts.index(f"{actor.name}/{part}")
            parts.append(
                {
                    "meshes": _write_meshes(folder, f"{actor.name}-{part}", [(mesh, looks[actor.name])]),
                    "positions": (trace.positions[:, row] / METRE).tolist(),
                    "rotations": (trace.rotations[:, row] / UNIT).tolist(),
                }
            )
    eyes = [sensor_transform(sensor, trace, frame) for frame in range(len(trace.positions))]
    camera = {"width": sensor.camera.width, "height": sensor.camera.height, "near": 0.1, "far": 1000.0}
    tall = math.tan(math.radians(sensor.camera.fov) / 2) * camera["height"] / camera["width"]
    camera["fov"] = 2 * math.degrees(math.atan(tall))  # vertical, as PyBullet has it
    walkers = [
        {"start": a.start.model_dump(), "goal": (a.route[-1] if a.route else a.start).model_dump(), "speed": a.speed}
        for a in scene.actors
    ]
    stage = {
        "town": town,
        "parts": parts,
        "walkers": walkers,
        "steps": scene.clock.steps_per_frame,
        "physics": scene.clock.physics,
        "eyes": [{"at": e[:, 3].tolist(), "forward": e[:, 0].tolist(), "up": e[:, 2].tolist()} for e in eyes],
        "camera": camera,
    }
    (folder / "stage.json").write_text(json.dumps(stage))


def _write_meshes(folder: Path, name: str, meshes: Iterable[tuple[Mesh, dict[str, str]]]) -> list[dict[str, Any]]:
    """Merge meshes by colour and write each as an OBJ file."""
    colours: dict[str, list[Corners]] = {}
    for mesh, look in meshes:
        for number, surface in enumerate(mesh.surfaces):
            corners = mesh.triangles[mesh.surface == number].reshape(-1)
            rows = np.concatenate([mesh.vertices[corners], mesh.normals[corners]], axis=1)
            colours.setdefault(look.get(surface.slot, "#999999"), []).append(rows)
    found = []
    for colour, chunks in colours.items():
        path = folder / f"{name}-{colour[1:]}.obj"
        path.write_text(_obj(np.concatenate(chunks)))
        found.append({"file": path.name, "colour": [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)] + [1.0]})
    return found


def _obj(corners: Corners) -> str:
    """Write an OBJ file of triangles; equal corners share a vertex."""
    rows, index = np.unique(corners, axis=0, return_inverse=True)
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in rows[:, :3].tolist()]
    lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in rows[:, 3:].tolist()]
    faces = (index.reshape(-1, 3) + 1).tolist()
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in faces]
    return "\n".join(lines) + "\n"
