"""Checks of plans before use.

A plan from a dataset's folder may have been written by anyone, so no name may lead out of a folder, and no number may
require more resources than a machine has. The models of `recipe_compiler.ir.plan` check each value on its own, and
`recipe_compiler.ir.plan_bounds` the shapes of bodies. This module limits totals and compares the parts of a plan.
Compiled plans are checked too before they are built, so that every dataset can be read again.
"""

from __future__ import annotations

from collections.abc import Iterator

from recipe_compiler.ir import optics, plan_bounds
from recipe_compiler.ir.errors import InputError, Problem
from recipe_compiler.ir.patches import STATIC
from recipe_compiler.ir.plan import DatasetPlan, RigPlan, ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plan_types import (
    MAX_SLOTS,
)
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.core import layout

MAX_PICTURES = 1_000_000  # frames times sensors times variants
MAX_ROWS = 600_000  # digests of frames: one for labels and one per modality
MAX_FILES = 600_000  # files of a dataset, each of which has a row in the manifest
MAX_MANIFEST_BYTES = 192 << 20  # rows of as many files and digests, with names of usual length
MAX_POSES = 300_000  # of all distinct rigs
MAX_POINTS_IN_ALL = 300_000  # of the routes of all distinct scenes, and pauses at them
MAX_BOXES = 250_000  # that shorten the arms of all distinct rigs
MAX_STEPS = 100_000_000  # physics steps of all scenes
_FILE_ROW_BYTES = 150  # of a file in the manifest, besides the names of variant and sensor in its path
_DIGEST_ROW_BYTES = 82  # of a digest in the manifest
# Generous sizes of a dataset's files: of a pixel of a frame in all pictures, masks and truths of patches; of a frame's
# row and of an actor or a patch in a frame in all text files; and of the recipe, the lockfile, plans and drawings.
_PIXEL_BYTES, _FRAME_BYTES, _ACTOR_BYTES, _OTHER_BYTES = 64, 1 << 15, 1 << 14, 1 << 30


def check_plan(dataset: DatasetPlan) -> None:
    """Check that a plan's dataset can be written and annotated.

    Raises:
        InputError: it cannot.
    """
    layout.check_names(dataset)
    for scene in {v.scene.digest: v.scene for v in dataset.variants}.values():
        for actor in scene.actors:
            if actor.tag not in CATEGORIES:
                raise InputError(
                    f"actor {actor.name!r}: tag {actor.tag} is not an annotated class: {sorted(CATEGORIES)}"
                )


def check_bounds(dataset: DatasetPlan) -> None:
    """Check that a plan could result from a recipe, and is not larger than any that this project builds.

    Raises:
        InputError: it could not, or is too large.
    """
    if not dataset.variants:
        raise InputError("the plan has no variants")
    if len({v.variant for v in dataset.variants}) < len(dataset.variants):
        raise InputError("two variants have one name")
    found = list(_sums(dataset)) or list(_faults(dataset))
    if found:
        raise InputError(Problem(message) for message in dict.fromkeys(found))


def _faults(dataset: DatasetPlan) -> Iterator[str]:
    scenes = {v.scene.digest: v.scene for v in dataset.variants}.values()
    for town in {scene.town.digest: scene.town for scene in scenes}.values():
        yield from plan_bounds.town_faults(town.elements)
    for scene in scenes:
        yield from _actors(scene)
    for variant in dataset.variants:
        yield from (*_images(variant), *_patches(variant), *_rig(variant.rig, variant))


def _sums(dataset: DatasetPlan) -> Iterator[str]:
    """Yield the totals of the whole dataset that exceed their limits: frames, digests, files and poses."""
    frames = [len(sensor.frames(v.scene.clock.frames)) for v in dataset.variants for sensor in v.rig.sensors]
    rigs = {v.rig.digest: v.rig for v in dataset.variants}
    scenes = {v.scene.digest: v.scene for v in dataset.variants}.values()
    clocks = [scene.clock for scene in scenes]
    steps = sum(clock.warmup_steps + clock.frames * clock.steps_per_frame for clock in clocks)
    numbers = (
        (sum(frames), MAX_PICTURES, "frames"),
        (row_count(dataset), MAX_ROWS, "digests of frames"),
        (file_count(dataset), MAX_FILES, "files"),
        (manifest_bytes(dataset), MAX_MANIFEST_BYTES, "bytes of the manifest"),
        (sum(map(pose_count, rigs.values())), MAX_POSES, "poses of sensors"),
        (sum(map(box_count, rigs.values())), MAX_BOXES, "boxes that shorten arms"),
        (sum(map(point_count, scenes)), MAX_POINTS_IN_ALL, "points of routes"),
        (steps, MAX_STEPS, "steps of simulation"),
    )
    for number, most, what in numbers:
        if number > most:
            yield f"{number} {what} are over {most}; split the recipe into several"


def pose_count(rig: RigPlan) -> int:
    """Return the number of poses of a rig's sensors."""
    return sum(len(sensor.poses) for sensor in rig.sensors)


def box_count(rig: RigPlan) -> int:
    """Return the number of boxes that shorten the arms of a rig."""
    return sum(len(sensor.arm.obstacles) for sensor in rig.sensors if sensor.arm is not None)


def point_count(scene: ScenePlan) -> int:
    """Return the number of points of a scene's routes, and of pauses at them."""
    return sum(len(actor.route) + len(actor.pauses) for actor in scene.actors)


def row_count(dataset: DatasetPlan) -> int:
    """Return the number of frame digests of the plan's dataset."""
    videos = ((len(s.frames(v.scene.clock.frames)), s) for v in dataset.variants for s in v.rig.sensors)
    return sum(frames * (len(sensor.capture) + 1) for frames, sensor in videos)


def file_count(dataset: DatasetPlan) -> int:
    """Return an upper bound of the number of files of the plan's dataset, few of which a dataset may lack."""
    total = 24  # the static files of the page, and what occurs once
    for variant in dataset.variants:
        clip = -(-variant.scene.clock.frames // layout.PAGE_FRAMES)
        total += 3 + 3 + clip  # plan, tracks and events; of the page, at most: events, map, actors, their poses
        for sensor in variant.rig.sensors:
            frames = len(sensor.frames(variant.scene.clock.frames))
            copies = len(layout.label_copies(dataset, variant.variant, sensor, 0)) + bool(variant.appearance.patches)
            total += 3 + frames * (len(sensor.capture) + copies)  # labels, and two MOTS text files
            total += 1 + 2 * -(-frames // layout.PAGE_FRAMES)  # of the page, at most: poses, labels, patches
    return total


def manifest_bytes(dataset: DatasetPlan) -> int:
    """Return an upper bound of the bytes of the manifest of the plan's dataset."""
    names = (layout.folder(v.variant) + layout.folder(s.name) for v in dataset.variants for s in v.rig.sensors)
    longest = max((len(name.encode()) for name in names), default=0)
    return (1 << 20) + file_count(dataset) * (_FILE_ROW_BYTES + longest) + row_count(dataset) * _DIGEST_ROW_BYTES


def byte_count(dataset: DatasetPlan) -> int:
    """Return an upper bound of the bytes of the plan's dataset, which is many times the usual size."""
    total = _OTHER_BYTES
    for variant in dataset.variants:
        text = _FRAME_BYTES + _ACTOR_BYTES * (len(variant.scene.actors) + len(variant.appearance.patches))
        for sensor in variant.rig.sensors:
            pixels = sensor.camera.width * sensor.camera.height
            total += len(sensor.frames(variant.scene.clock.frames)) * (text + _PIXEL_BYTES * pixels)
        total += variant.scene.clock.frames * text  # tracks and events
    return total


def _actors(scene: ScenePlan) -> Iterator[str]:
    if len({a.name for a in scene.actors}) < len(scene.actors):
        yield "two actors have one name"
    if len({(a.tag, a.instance) for a in scene.actors}) < len(scene.actors):
        yield "two actors have one instance number"
    for fault in (plan_bounds.routes_fault(scene.actors), plan_bounds.starts_fault(scene.actors)):
        if fault is not None:
            yield fault
    for actor in scene.actors:
        wrong = plan_bounds.actor_fault(actor)
        if wrong is not None:
            yield f"actor {actor.name!r}: {wrong}"


def _images(variant: ScenarioPlan) -> Iterator[str]:
    numbers: dict[str, set[int | None]] = {}
    for texture in (texture for slots in variant.appearance.textures.values() for texture in slots.values()):
        numbers.setdefault(texture.file.sha256, set()).add(texture.number)
    for sha256, found in numbers.items():
        if len(found) > MAX_SLOTS:
            yield f"{count(len(found), 'image')} of the file sha256:{sha256} are over {MAX_SLOTS}"


def _patches(variant: ScenarioPlan) -> Iterator[str]:
    scene, patches = variant.scene, variant.appearance.patches
    static = {e.name for e in scene.town.elements} | {prop.name for prop in scene.props} if patches else set()
    actors = {actor.name: actor for actor in scene.actors}
    if len({patch.name for patch in patches}) < len(patches):
        yield "two patches have one name"
    for patch in patches:
        if patch.body not in static and patch.body not in actors:
            yield f"patch {patch.name!r}: there is no {patch.body!r}"
        if any((face.part == STATIC) != (patch.body in static) for face in patch.faces):
            yield f"patch {patch.name!r}: its faces are on parts that {patch.body!r} does not have"
        texture = patch.texture
        if texture.frames and len(texture.frames) != scene.clock.frames:
            numbers = f"{count(len(texture.frames), 'image')} for {count(scene.clock.frames, 'frame')}"
            yield f"patch {patch.name!r}: {numbers}"


def _rig(rig: RigPlan, variant: ScenarioPlan) -> Iterator[str]:
    actors, frames = {a.name for a in variant.scene.actors}, variant.scene.clock.frames
    if not rig.sensors:
        yield f"{variant.variant} has no sensor"
    for sensor in rig.sensors:
        yield from (f"sensor {sensor.name}: {what}" for what in _sensor(sensor, actors, frames))
        if sensor.name not in variant.appearance.responses:
            yield f"sensor {sensor.name}: no camera response in {variant.variant}"
            continue
        wrong = optics.fault(sensor.camera, variant.appearance.responses[sensor.name].supersample)
        if wrong is not None:
            yield f"sensor {sensor.name}: its lens {wrong}"


def _sensor(sensor: SensorPlan, actors: set[str], frames: int) -> Iterator[str]:
    if sensor.on is not None and sensor.on not in actors:
        yield f"it is mounted on {sensor.on!r}, which is not an actor"
    if sensor.arm is not None and sensor.on is None:
        yield "it has an arm, and no actor at its other end"
    if len(sensor.poses) not in (1, frames):
        yield "its poses are neither one nor one a frame"
    if not sensor.capture or len(set(sensor.capture)) < len(sensor.capture):
        yield "it captures nothing, or something twice"
