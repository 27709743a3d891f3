"""The studies: each renders some frames of a recipe, and returns a table of measurements and a contact sheet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pycocotools.mask
import recipe_runtime
from numpy.typing import NDArray
from recipe_compiler.compile import compile_recipe
from recipe_runtime.annotate.calibration import Calibration
from recipe_runtime.annotate.records import LabelRecord
from recipe_runtime.scenario import Scenario

from benchmarks.pages import Table
from benchmarks.paper import defences, sheets
from benchmarks.paper.defences import Mask, Picture
from benchmarks.paper.sheets import Sheet

RECIPES = Path(__file__).parents[2] / "recipes" / "paper"

_WARMUP = 20  # frames that update a background model before pixels are counted: two seconds
_QUANTILE = 0.99  # share of the pixels of clean pictures that are below a defence's thresholds
_MARGIN = 0.02  # metres by which a point may lie outside its actor's box, because depth is rounded


@dataclass(frozen=True)
class Measured:
    """What a study found: a table, and pictures."""

    table: Table
    sheet: Sheet


def opened(recipe: str, variant: str) -> Scenario:
    """Open a variant of a recipe of `recipes/paper`."""
    return recipe_runtime.open(RECIPES / f"{recipe}.yaml", variant=variant)


def picture(scenario: Scenario, frame: int) -> Picture:
    """Return the picture of a frame."""
    return np.asarray(scenario.render(frame), np.uint8)


def patch_mask(scenario: Scenario, frame: int, name: str) -> Mask:
    """Return the pixels of a frame whose centres show a patch; all False if the variant has no such patch."""
    camera = scenario.plan.rig.sensors[0].camera
    for record in scenario.patches(frame)["patches"]:
        if record["name"] == name and record["counts"] is not None:
            packed = {"size": [camera.height, camera.width], "counts": record["counts"].encode()}
            return np.asarray(pycocotools.mask.decode(packed), np.bool_)
    return np.zeros((camera.height, camera.width), np.bool_)


def labels_equal(one: Scenario, other: Scenario, frames: Sequence[int]) -> str:
    """Return "equal" if depth and instances of two variants are equal in the given frames, else "different"."""
    pairs = ((one.render(f, None, m), other.render(f, None, m)) for f in frames for m in ("depth", "instance"))
    return "equal" if all(np.array_equal(a, b) for a, b in pairs) else "different"


def weather_change() -> Measured:
    """Figure 9: one scene in three weathers."""
    frames, cells, rows = (20, 100, 176), [], []
    with opened("two_pedestrians", "weather=sunny") as first:
        for name in ("sunny", "rainy", "foggy"):
            with opened("two_pedestrians", f"weather={name}") as clip:
                pictures = [picture(clip, frame) for frame in frames]
                labels = labels_equal(first, clip, frames)
            cells.append((name, pictures[-1]))
            level, contrast = np.mean(pictures), np.mean([p.mean(axis=2).std() for p in pictures])
            rows.append(
                {"weather": name, "mean level": f"{level:.1f}", "contrast": f"{contrast:.1f}", "labels": labels}
            )
    return Measured(rows, Sheet(tuple(cells), 3, (400, 300)))


def share_in_boxes(
    metres: NDArray[np.float32], instances: NDArray[np.uint16], labels: Sequence[LabelRecord], view: Calibration
) -> tuple[int, int]:
    """Count the pixels of actors whose depth places them inside their actor's 3-D box, and all pixels of actors.

    Args:
        metres: Depth along the optical axis, float32 [H, W].
        instances: Instance of each pixel, uint16 [H, W].
        labels: The records of the frame, with boxes in the sensor's frame.
        view: The calibration of the frame.
    """
    inverse, inside, total = np.linalg.inv(np.array(view["K"])), 0, 0
    for label in labels:
        y, x = np.nonzero(instances == label["instance"])
        rays = inverse @ np.stack([x + 0.5, y + 0.5, np.ones(len(x))])
        points = rays * metres[y, x]  # x right, y down, z forward
        box = label["tight3d"]
        sensor = np.stack([points[2], -points[0], -points[1]]) - np.array(box["centre"])[:, None]
        local = _rotation(box["rotation"]).T @ sensor
        inside += int((np.abs(local) <= np.array(box["size"])[:, None] / 2 + _MARGIN).all(axis=0).sum())
        total += len(x)
    return inside, total


def aligned() -> Measured:
    """Figure 3: RGB, depth and instances of a camera that turns and shakes, compared with labels one frame late."""
    together, late = np.zeros(2, np.int64), np.zeros(2, np.int64)
    with opened("aligned", "weather=sunny") as clip:
        before = None
        for frame in clip.frames():
            metres = np.asarray(clip.render(frame, None, "depth"), np.float32)
            instances = np.asarray(clip.render(frame, None, "instance"), np.uint16)
            records, view = clip.labels(frame), clip.calibration(frame)
            together += share_in_boxes(metres, instances, records, view)
            if before is not None:
                late += share_in_boxes(metres, before, records, view)
            before = instances
        shown = 10
        depth = np.asarray(clip.render(shown, None, "depth"), np.float32)
        objects = np.asarray(clip.render(shown, None, "instance"), np.uint16)
        seen = picture(clip, shown)
        cells = [("depth", sheets.colour_depth(depth)), ("RGB", seen)]
        cells.append(("instances", sheets.colour_instances(objects)))
        person = objects == min(record["instance"] for record in clip.labels(shown) if record["actor"] == "hero1")
        cells.append(
            ("outline of an instance on RGB", sheets.around(sheets.outlined(seen, objects), person, 0.1, (4, 3)))
        )
        with opened("aligned", "weather=foggy") as foggy:
            labels = labels_equal(clip, foggy, clip.frames())
    rows = [
        {
            "instances": name,
            "pixels of actors": str(total),
            "in the 3-D box": _percent(float(inside / total)),
            "fog": fog,
        }
        for name, (inside, total), fog in (("of the same frame", together, labels), ("one frame late", late, "-"))
    ]
    return Measured(rows, Sheet(tuple(cells), 4, (320, 240)))


def insertion() -> Measured:
    """Figure 1: four insertion modes, in the sun and in the shade; the rendered patch is the reference."""
    frames, shown, cells, rows = (2, 4, 6), 4, [], []
    for light in ("sun", "shade"):
        with opened("insertion", f"light={light},insertion=rendered") as truth:
            for mode in ("green", "digital", "color_transfer", "rendered"):
                with opened("insertion", f"light={light},insertion={mode}") as clip:
                    on, bias, off = [], [], 0
                    for frame in frames:
                        difference = picture(clip, frame).astype(np.int64) - picture(truth, frame)
                        mask = patch_mask(truth, frame, "patch")
                        on.append(np.abs(difference[mask]).mean())
                        bias.append(difference[mask].mean())
                        off += int(difference[~mask].any(axis=1).sum())
                    labels = labels_equal(truth, clip, frames)
                    part = sheets.around(picture(clip, shown), patch_mask(truth, shown, "patch"), 0.25, (5, 4))
                    cells.append((f"{mode}, {light}", part))
                row = {"light": light, "mode": mode, "mean error, levels": f"{np.mean(on):.1f}"}
                row["mean difference"] = f"{np.mean(bias):+.1f}"
                rows.append({**row, "other pixels that differ": str(off // len(frames)), "labels": labels})
    return Measured(rows, Sheet(tuple(cells), 4, (300, 240)))


def subtractors() -> dict[str, defences.Subtractor]:
    """Return new background models by name: OpenCV's, and a Gaussian per pixel."""
    return {**defences.opencv_subtractors(), "Gaussian": defences.RunningGaussian()}


def background_ablation() -> Measured:
    """Figure 6: background subtraction as a defence, with and without a stabiliser, for static and moving cameras."""
    cells, rows, shown = [], [], 33
    still: list[NDArray[np.float64]] = []
    for camera in ("static", "shaking", "sideways", "approaching"):
        with opened("background_ablation", f"camera={camera}") as clip:
            frames = clip.frames()
            pictures = [picture(clip, frame) for frame in frames]
            patches = [patch_mask(clip, frame, "patch") for frame in frames]
            targets = [np.asarray(clip.render(frame, None, "instance")) > 0 for frame in frames]
            corners = [np.array(clip.patches(frame)["patches"][0]["corners"]) for frame in frames]
        still = still or corners
        moved = max(float(np.hypot(*(a - b).T).max()) for a, b in zip(corners, still, strict=True))
        for name, model in subtractors().items():
            plain = defences.removal(pictures, patches, targets, model, _WARMUP)
            steady = defences.removal(pictures, patches, targets, defences.stabilised(subtractors()[name]), _WARMUP)
            row = {"camera": camera, "patch moves, pixels": f"{moved:.1f}", "subtractor": name}
            row |= {"patch removed": _percent(plain.patch), "child removed": _percent(plain.target)}
            row |= {"stabilised: patch": _percent(steady.patch), "stabilised: child": _percent(steady.target)}
            rows.append(row)
        cells.append((f"{camera}, frame {shown}", pictures[shown]))
        for name, wrap in (("what is left", lambda model: model), ("left if stabilised", defences.stabilised)):
            model = wrap(next(iter(subtractors().values())))
            kept = [model(seen) for seen in pictures[: shown + 1]]
            cells.append((f"{camera}, {name}", sheets.keep(pictures[shown], kept[shown])))
    return Measured(rows, Sheet(tuple(cells), 3, (320, 240)))


def tracking_videos() -> Measured:
    """Figure 5: one, five and ten videos of a person who walks up to the patch."""
    variants = compile_recipe(RECIPES / "tracking_videos.yaml").plan.variants
    cells, rows, seen, people, speeds, hidden = [], [], [], [], [], []
    for number, plan in enumerate(variants):
        actor = plan.scene.actors[0]
        with opened("tracking_videos", plan.variant) as clip:
            frames = clip.frames()[::3]
            targets = [np.asarray(clip.render(frame, None, "instance")) > 0 for frame in frames]
            fractions = [clip.patches(frame)["patches"][0]["visible_fraction"] for frame in frames]
            cells.append((f"video {number + 1}", picture(clip, 18)))
        seen.append(np.any(targets, axis=0))
        people.append(actor.blueprint)
        speeds.append(actor.speed)
        hidden.append(1 - min(f for f in fractions if f is not None))
        if number + 1 in (1, 5, 10):
            row = {"videos": str(number + 1), "people": str(len(set(people)))}
            row["speeds, m/s"] = f"{min(speeds):.2f} to {max(speeds):.2f}"
            row["picture that they cover"] = _percent(float(np.any(seen, axis=0).mean()))
            rows.append({**row, "patch hidden, at most": _percent(max(hidden))})
    return Measured(rows, Sheet(tuple(cells), 5, (260, 195)))


def resolution() -> Measured:
    """Figure 7: a defence whose thresholds come from low resolution, at low and at high resolution."""
    frames, shown, cells, rows = (0, 4, 7), 4, [], []
    with opened("resolution", "patch=without,resolution=low") as clean:
        limits = defences.thresholds([picture(clean, frame) for frame in frames], _QUANTILE)
    for size in ("low", "high"):
        with opened("resolution", f"patch=with,resolution={size}") as clip:
            found = {frame: defences.flagged(picture(clip, frame), limits) for frame in frames}
            masks = {frame: patch_mask(clip, frame, "patch") for frame in frames}
            cells.append((f"{size} resolution", picture(clip, shown)))
        for name in limits:
            hits = sum(int((found[f][name] & masks[f]).sum()) for f in frames)
            every = sum(int(found[f][name].sum()) for f in frames)
            row = {
                "resolution": size,
                "statistic": name,
                "patch found": _percent(hits / sum(m.sum() for m in masks.values())),
            }
            rows.append({**row, "of what is found, patch": _percent(hits / max(every, 1))})
            cells.append((f"{name}, {size}", sheets.marked(found[shown][name], masks[shown])))
    return Measured(rows, Sheet(tuple(cells), 4, (320, 240)))


def painted_car() -> Measured:
    """Figure 8: a car whose entire body is painted through its texture map."""
    frame, cells, rows = 9, [], []
    for weather in ("clear", "rainy"):
        with opened("painted_car", f"weather={weather},paint=own") as own:
            for paint in ("own", "green", "orange"):
                with opened("painted_car", f"weather={weather},paint={paint}") as clip:
                    body = np.asarray(clip.render(frame, None, "instance")) > 0
                    mask = patch_mask(clip, frame, "paint")
                    changed = (picture(clip, frame) != picture(own, frame)).any(axis=2)
                    cells.append((f"{paint}, {weather}", sheets.around(picture(clip, frame), body, 0.2, (4, 3))))
                    labels = labels_equal(own, clip, [frame])
                row = {"weather": weather, "paint": paint, "car painted": _percent(float(mask.sum() / body.sum()))}
                row["pixels changed on the car"] = str(int((changed & body).sum()))
                rows.append({**row, "elsewhere": str(int((changed & ~body).sum())), "labels": labels})
    return Measured(rows, Sheet(tuple(cells), 3, (400, 300)))


STUDIES: dict[str, Callable[[], Measured]] = {
    study.__name__: study
    for study in (weather_change, aligned, insertion, background_ablation, tracking_videos, resolution, painted_car)
}


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _rotation(quaternion: Sequence[float]) -> NDArray[np.float64]:
    """The matrix [3, 3] of a unit quaternion w, x, y, z."""
    w, *axis = quaternion
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)
