"""Checks of plans before use.

A plan from a dataset's folder may have been written by anyone, so no name may lead out of a folder, and no number may
require more resources than a machine has. The models of `recipe_compiler.ir.plan` limit each number, and
`recipe_compiler.ir.plan_bounds` the shapes of bodies. This module limits totals and checks the consistency of a plan's
parts. Compiled plans are checked too before they are built, so that every dataset can be read again.
"""

from __future__ import annotations

from collections.abc import Iterator

from recipe_compiler.ir import optics, plan_bounds
from recipe_compiler.ir.errors import InputError, Problem
from recipe_compiler.ir.patches import STATIC
from recipe_compiler.ir.plan import DatasetPlan, RigPlan, ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.ir.plan_types import (
    MAX_ACTORS,
    MAX_ELEMENTS,
    MAX_FILE_BYTES,
    MAX_PIXELS_A_SIDE,
    MAX_POINTS,
    MAX_PROPS,
    MAX_SLOTS,
)
from recipe_compiler.ir.plurals import count

from recipe_runtime.annotate.categories import CATEGORIES
from recipe_runtime.core import layout

MAX_PICTURES = 1_000_000  # frames times sensors times variants
MAX_ROWS = 600_000  # digests of frames: one for labels and one per modality
MAX_FILES = 600_000  # files of a dataset, each of which has a row in the manifest
MAX_POSES = 300_000  # of all distinct rigs
MAX_BOXES = 250_000  # that shorten the arms of a rig
MAX_STEPS = 100_000_000  # physics steps of all scenes
MAX_METRES = 100_000.0
MAX_SETTING = 1e6  # of a camera's parameters
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
    scenes_of = {v.scene.digest: v.scene for v in dataset.variants}
    towns_of = {scene.town.digest: scene.town for scene in scenes_of.values()}
    found = [p for town in towns_of.values() for p in plan_bounds.town_faults(town.elements)]
    found += [p for scene in scenes_of.values() for p in [*_clock(scene), *_actors_and_town(scene)]]
    found += [p for v in dataset.variants for p in [*_props(v), *_images(v), *_patches(v), *_rig(v.rig, v)]]
    found += _sums(dataset)
    if not found:
        scenes = {v.scene.digest: v.scene.clock for v in dataset.variants}.values()
        steps = sum(clock.warmup_steps + clock.frames * clock.steps_per_frame for clock in scenes)
        found += [f"{steps} steps of simulation are over {MAX_STEPS}"] if steps > MAX_STEPS else []
    if found:
        raise InputError(Problem(message) for message in dict.fromkeys(found))


def _sums(dataset: DatasetPlan) -> Iterator[str]:
    """Yield the totals of the whole dataset that exceed their limits: frames, digests, files and poses."""
    frames = [len(sensor.frames(v.scene.clock.frames)) for v in dataset.variants for sensor in v.rig.sensors]
    rigs = {v.rig.digest: v.rig for v in dataset.variants}
    numbers = (
        (sum(frames), MAX_PICTURES, "frames"),
        (row_count(dataset), MAX_ROWS, "digests of frames"),
        (file_count(dataset), MAX_FILES, "files"),
        (sum(len(sensor.poses) for rig in rigs.values() for sensor in rig.sensors), MAX_POSES, "poses of sensors"),
    )
    for number, most, what in numbers:
        if number > most:
            yield f"{number} {what} are over {most}; split the recipe into several"


def row_count(dataset: DatasetPlan) -> int:
    """Return the number of frame digests of the plan's dataset."""
    videos = ((len(s.frames(v.scene.clock.frames)), s) for v in dataset.variants for s in v.rig.sensors)
    return sum(frames * (len(sensor.capture) + 1) for frames, sensor in videos)


def file_count(dataset: DatasetPlan) -> int:
    """Return an upper bound of the number of files of the plan's dataset, at most a dozen too high."""
    total = 12
    for variant in dataset.variants:
        total += 3  # plan, tracks and events
        for sensor in variant.rig.sensors:
            frames = len(sensor.frames(variant.scene.clock.frames))
            copies = len(layout.label_copies(dataset, variant.variant, sensor, 0)) + bool(variant.appearance.patches)
            total += 3 + frames * (len(sensor.capture) + copies)  # labels, and two MOTS text files
    return total


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


def _clock(scene: ScenePlan) -> Iterator[str]:
    clock = scene.clock
    if not (0 < clock.fps <= 1000 and clock.frames > 0 and 0 < clock.physics <= 1000 and not clock.physics % clock.fps):
        yield f"a clock of {clock.fps} fps, {clock.frames} frames and {clock.physics} steps per second is invalid"


def _actors_and_town(scene: ScenePlan) -> Iterator[str]:
    if len(scene.actors) > MAX_ACTORS or len(scene.town.elements) > MAX_ELEMENTS:
        actors, elements = count(len(scene.actors), "actor"), count(len(scene.town.elements), "element")
        yield f"{actors} and {elements} of the town are over the limit"
    if len({a.name for a in scene.actors}) < len(scene.actors):
        yield "two actors have one name"
    if len({(a.tag, a.instance) for a in scene.actors}) < len(scene.actors):
        yield "two actors have one instance number"
    for fault in (plan_bounds.routes_fault(scene.actors), plan_bounds.starts_fault(scene.actors)):
        if fault is not None:
            yield fault
    for actor in scene.actors:
        points = [actor.start.x, actor.start.y, actor.start.z, *(v for p in actor.route for v in (p.x, p.y))]
        if len(actor.route) > MAX_POINTS or _beyond([*points, actor.speed]):
            yield f"actor {actor.name!r}: its start, route or speed is out of bounds"
        wrong = plan_bounds.actor_fault(actor)
        if wrong is not None:
            yield f"actor {actor.name!r}: {wrong}"


def _props(variant: ScenarioPlan) -> Iterator[str]:
    props = variant.scene.props
    if len(props) > MAX_PROPS:
        yield f"{len(props)} props are over {MAX_PROPS}"
    for prop in props:
        pose = prop.pose
        if _beyond([pose.x, pose.y, pose.z, *prop.low, *prop.high, prop.scale]) or prop.scale <= 0.0:
            yield f"{prop.name!r} is out of bounds"
        if prop.mesh is None and any(a >= b for a, b in zip(prop.low, prop.high, strict=True)):
            yield f"{prop.name!r} is a board without a size"
    for file in variant.files.values():
        if not 0 <= file.bytes <= MAX_FILE_BYTES:
            yield f"the file sha256:{file.sha256} of {file.bytes} bytes is over {MAX_FILE_BYTES}"


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
        if any(abs(_square(v) - 1.0) > 1e-3 for face in patch.faces for v in (face.right, face.down, face.normal)):
            yield f"patch {patch.name!r}: a face is not a rectangle"
        if any(face.region[0] >= face.region[2] or face.region[1] >= face.region[3] for face in patch.faces):
            yield f"patch {patch.name!r}: a face shows nothing of the texture"
        texture = patch.texture
        if [texture.image is not None, bool(texture.frames), texture.colour is not None].count(True) != 1:
            yield f"patch {patch.name!r}: its texture is not one of an image, a sequence and a colour"
        if texture.frames and len(texture.frames) != scene.clock.frames:
            numbers = f"{count(len(texture.frames), 'image')} for {count(scene.clock.frames, 'frame')}"
            yield f"patch {patch.name!r}: {numbers}"
        if any(file.kind != "png" for file in texture.files):
            yield f"patch {patch.name!r}: its texture is not an image"


def _square(v: tuple[float, float, float]) -> float:
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


def _rig(rig: RigPlan, variant: ScenarioPlan) -> Iterator[str]:
    actors, frames = {a.name for a in variant.scene.actors}, variant.scene.clock.frames
    if not rig.sensors:
        yield f"{variant.variant} has no sensor"
    boxes = sum(len(sensor.arm.obstacles) for sensor in rig.sensors if sensor.arm is not None)
    if boxes > MAX_BOXES:
        yield f"{variant.variant}: {count(boxes, 'box', 'boxes')} that shorten arms are over {MAX_BOXES:,}"
    for sensor in rig.sensors:
        yield from (f"sensor {sensor.name}: {what}" for what in _sensor(sensor, actors, frames))
        if sensor.name not in variant.appearance.responses:
            yield f"sensor {sensor.name}: no camera response in {variant.variant}"
            continue
        yield from (f"sensor {sensor.name}: {what}" for what in _response(sensor, variant))


def _sensor(sensor: SensorPlan, actors: set[str], frames: int) -> Iterator[str]:
    camera = sensor.camera
    if not (0 < camera.width <= MAX_PIXELS_A_SIDE and 0 < camera.height <= MAX_PIXELS_A_SIDE):
        yield f"a picture of {camera.width}x{camera.height} is over {MAX_PIXELS_A_SIDE}x{MAX_PIXELS_A_SIDE} or empty"
    if not (0.0 < camera.fov < 180.0 and 0.0 < camera.near < camera.far <= MAX_METRES):
        yield f"a camera of {camera.fov} degrees from {camera.near} to {camera.far} m is invalid"
    if sensor.on is not None and sensor.on not in actors:
        yield f"it is mounted on {sensor.on!r}, which is not an actor"
    if sensor.arm is not None and sensor.on is None:
        yield "it has an arm, and no actor at its other end"
    if len(sensor.poses) not in (1, frames) or any(_beyond([p.x, p.y, p.z]) for p in sensor.poses):
        yield "its poses are neither one nor one a frame, or out of bounds"
    if not sensor.capture or len(set(sensor.capture)) < len(sensor.capture):
        yield "it captures nothing, or something twice"


def _response(sensor: SensorPlan, variant: ScenarioPlan) -> Iterator[str]:
    """Yield the settings of a camera response with which no picture can be rendered.

    The recipe language has narrower limits.
    """
    response, camera = variant.appearance.responses[sensor.name], sensor.camera
    numbers = [v for v in response.model_dump().values() if isinstance(v, float)]
    positive = response.shutter_speed, response.iso, response.fstop, response.gamma, response.temp
    bounded = max(map(abs, numbers)) <= MAX_SETTING and min(positive) >= 0.01
    offset = 0.0 <= response.chromatic_aberration_offset < 1.0
    if not (bounded and offset and 1 <= response.supersample <= 4 and abs(response.exposure_compensation) <= 30.0):
        yield "its camera response is invalid"
    elif abs(camera.lens_k) > 1.0 or abs(camera.lens_kcube) > 1.0:
        yield "invalid lens: |lens_k| and |lens_kcube| must be at most 1"
    else:
        sound = camera.width > 0 and camera.height > 0 and 0.0 < camera.fov < 180.0
        wrong = optics.fault(camera, response.supersample) if sound else None
        if wrong is not None:
            yield f"its lens {wrong}"


def _beyond(metres: list[float]) -> bool:
    return any(abs(value) > MAX_METRES for value in metres)
