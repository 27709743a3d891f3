"""Errors of edges and thin lines, in levels of 8 bits: pictures of a slow pan against supersampled ones.

    python -m benchmarks.thin_lines --frames 4 --pictures FOLDER

Each camera of the towns' recipes turns by a quarter of a pixel per frame, at frame 0 of its scene and without noise.
The reference is the same picture with `supersample: 4`. *Edges* are pixels in whose neighbourhood the reference varies
by more than EDGE levels. *Error* is the mean absolute difference from the reference at edges; *flicker* is the mean
absolute difference of the changes from a frame to the next. The last line of output is a JSON object.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir import exact, optics
from recipe_compiler.ir.plan import CameraResponse, ScenarioPlan
from recipe_runtime.core.transforms import Array, compose, sensor_transform
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.scene_motion import SceneMotion

ROOT = Path(__file__).parents[1]
TOWNS = ("downtown", "suburb", "plaza", "highway")
STEP = 0.25  # pixels per frame
EDGE = 24.0  # levels
Picture = NDArray[np.float64]


def main() -> None:
    """Measure the towns, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--pictures", type=Path, help="folder for the first picture of each town and its reference")
    arguments = parser.parse_args()
    print("| town | edges | error | flicker | largest errors (99th percentile) |\n|---|---|---|---|---|")
    found = {}
    for town in TOWNS:
        plan = compile_recipe(ROOT / "recipes" / "towns" / f"{town}.yaml").plan.variants[0]
        pairs = list(pan(plan, arguments.frames))
        if arguments.pictures is not None:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            for name, picture in zip(("", "-reference"), pairs[0], strict=True):
                Image.fromarray(np.rint(picture).astype(np.uint8)).save(arguments.pictures / f"{town}{name}.png")
        found[town] = share, error, flicker, worst = differences(pairs)
        print(f"| {town} | {100 * share:.0f} % | {error:.2f} | {flicker:.2f} | {worst:.0f} |", flush=True)
    print(json.dumps(found))


def pan(plan: ScenarioPlan, frames: int) -> Iterator[tuple[Picture, Picture]]:
    """Yield each frame's picture and its reference, [H, W, 3] in levels."""
    engines = real_engines()
    trace = engines.simulate(plan.scene.first(1))
    renderer, parts = engines.renderer(plan.scene, "cpu"), SceneMotion(plan.scene, trace).parts(0)
    sensor = plan.rig.sensors[0]
    start = sensor_transform(sensor, trace, 0)
    responses = [CameraResponse(noise=0.0, supersample=n) for n in (1, 4)]
    looks = [plan.appearance.model_copy(update={"responses": {sensor.name: r}}) for r in responses]
    dark = np.zeros(len(plan.scene.actors), np.int32)  # no lamp is lit
    for frame in range(frames):
        turn = exact.atan2_deg(STEP * frame, optics.focal_length(sensor.camera))
        seen = renderer.observe(sensor.camera, turned(start, turn), parts, dark)
        once, reference = (255.0 * renderer.unrounded(seen, look, sensor.name, frame, 0.0) for look in looks)
        yield once, reference


def turned(pose: Array, degrees: float) -> Array:
    """Return a pose [3, 4] turned about its z axis."""
    sine, cosine = exact.sin_cos_deg(degrees)
    turn = np.array([[cosine, -sine, 0.0, 0.0], [sine, cosine, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    return compose(pose, turn)


def differences(pairs: list[tuple[Picture, Picture]]) -> tuple[float, float, float, float]:
    """Return the share of edge pixels, and at these the error, the flicker and the 99th percentile of the error."""
    once, reference = (np.stack(pictures) for pictures in zip(*pairs, strict=True))
    edges = contrast(reference) > EDGE
    errors = np.abs(once - reference).mean(axis=-1)[edges]
    changes = np.abs(np.diff(once, axis=0) - np.diff(reference, axis=0)).mean(axis=-1)
    flicker = changes[edges[1:] | edges[:-1]]
    return float(edges.mean()), float(errors.mean()), float(flicker.mean()), float(np.percentile(errors, 99))


def contrast(pictures: Picture) -> Picture:
    """Return the range of the grey levels in the 3 x 3 neighbourhood of each pixel, [F, H, W]."""
    grey = np.pad(pictures.mean(axis=-1), ((0, 0), (1, 1), (1, 1)), mode="edge")
    high, wide = grey.shape[1] - 2, grey.shape[2] - 2
    around = np.stack([grey[:, y : y + high, x : x + wide] for y in range(3) for x in range(3)])
    spread: Picture = around.max(axis=0) - around.min(axis=0)
    return spread


if __name__ == "__main__":
    main()
