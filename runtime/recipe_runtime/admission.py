"""What a plan must be before anything is made of it.

The compiler makes only plans that can be built. A plan read from a dataset's folder may be anyone's: it is held to
the same bounds first, so that no name leads out of a folder and no number asks for more than a machine has.
"""

from __future__ import annotations

from collections.abc import Iterator

from recipe_compiler import optics
from recipe_compiler.errors import InputError, Problem
from recipe_compiler.plan import DatasetPlan, RigPlan, ScenarioPlan, ScenePlan, SensorPlan
from recipe_compiler.wording import count

from recipe_runtime import layout
from recipe_runtime.annotate.categories import CATEGORIES

MOST_PICTURES = 1_000_000  # frames, over all sensors and variants
MOST_PIXELS_A_SIDE = 4096
MOST_ACTORS, MOST_ELEMENTS, MOST_POINTS = 1_000, 200_000, 10_000
MOST_STEPS = 100_000_000  # of physics, over all scenes
MOST_METRES = 100_000.0
MOST_PROPS, MOST_FILE_BYTES = 1_000, 32 << 20
MOST_SETTING = 1e6  # of a camera


def check_plan(dataset: DatasetPlan) -> None:
    """InputError for a plan whose dataset could not be written or annotated."""
    layout.check_names(dataset)
    for scene in {v.scene.digest: v.scene for v in dataset.variants}.values():
        for actor in scene.actors:
            if actor.tag not in CATEGORIES:
                raise InputError(
                    f"actor {actor.name!r}: tag {actor.tag} is none that is annotated: {sorted(CATEGORIES)}"
                )


def check_bounds(dataset: DatasetPlan) -> None:
    """InputError for a plan that no recipe compiles to, or that is larger than any that this project builds."""
    if not dataset.variants:
        raise InputError("the plan has no variants")
    found = [p for v in dataset.variants for p in [*_clock(v.scene), *_cast(v.scene), *_props(v), *_rig(v.rig, v)]]
    pictures = sum(v.scene.clock.frames * len(v.rig.sensors) for v in dataset.variants)
    if pictures > MOST_PICTURES:
        found.append(f"{pictures} frames are over {MOST_PICTURES}")
    if not found:
        scenes = {v.scene.digest: v.scene.clock for v in dataset.variants}.values()
        steps = sum(clock.frames * clock.steps_per_frame for clock in scenes)
        found += [f"{steps} steps of simulation are over {MOST_STEPS}"] if steps > MOST_STEPS else []
    if found:
        raise InputError(Problem(message) for message in dict.fromkeys(found))


def _clock(scene: ScenePlan) -> Iterator[str]:
    clock = scene.clock
    if not (0 < clock.fps <= 1000 and clock.frames > 0 and 0 < clock.physics <= 1000 and not clock.physics % clock.fps):
        yield f"a clock of {clock.fps} fps, {clock.frames} frames and {clock.physics} steps a second is none"


def _cast(scene: ScenePlan) -> Iterator[str]:
    if len(scene.actors) > MOST_ACTORS or len(scene.town.elements) > MOST_ELEMENTS:
        cast, things = count(len(scene.actors), "actor"), count(len(scene.town.elements), "thing")
        yield f"{cast} and {things} of the town are over the limit"
    if len({a.name for a in scene.actors}) < len(scene.actors):
        yield "two actors have one name"
    if len({(a.tag, a.instance) for a in scene.actors}) < len(scene.actors):
        yield "two actors have one instance number"
    for actor in scene.actors:
        points = [actor.start.x, actor.start.y, actor.start.z, *(v for p in actor.route for v in (p.x, p.y))]
        if len(actor.route) > MOST_POINTS or _beyond([*points, actor.speed]):
            yield f"actor {actor.name!r}: its start, route or speed is out of bounds"
    for element in scene.town.elements:
        pose = element.pose
        if _beyond([pose.x, pose.y, pose.z, *element.size]):
            yield f"{element.name!r} of the town is out of bounds"


def _props(variant: ScenarioPlan) -> Iterator[str]:
    props = variant.scene.props
    if len(props) > MOST_PROPS:
        yield f"{len(props)} props are over {MOST_PROPS}"
    for prop in props:
        pose = prop.pose
        if _beyond([pose.x, pose.y, pose.z, *prop.low, *prop.high, prop.scale]) or prop.scale <= 0.0:
            yield f"{prop.name!r} is out of bounds"
        if prop.mesh is None and any(a >= b for a, b in zip(prop.low, prop.high, strict=True)):
            yield f"{prop.name!r} is a board without a size"
    for file in variant.files.values():
        if not 0 <= file.bytes <= MOST_FILE_BYTES:
            yield f"the file sha256:{file.sha256} of {file.bytes} bytes is over {MOST_FILE_BYTES}"


def _rig(rig: RigPlan, variant: ScenarioPlan) -> Iterator[str]:
    actors, frames = {a.name for a in variant.scene.actors}, variant.scene.clock.frames
    if not rig.sensors:
        yield f"{variant.variant} has no sensor"
    for sensor in rig.sensors:
        yield from (f"sensor {sensor.name}: {what}" for what in _sensor(sensor, actors, frames))
        if sensor.name not in variant.appearance.responses:
            yield f"sensor {sensor.name}: no camera response in {variant.variant}"
            continue
        yield from (f"sensor {sensor.name}: {what}" for what in _response(sensor, variant))


def _sensor(sensor: SensorPlan, actors: set[str], frames: int) -> Iterator[str]:
    camera = sensor.camera
    if not (0 < camera.width <= MOST_PIXELS_A_SIDE and 0 < camera.height <= MOST_PIXELS_A_SIDE):
        yield f"a picture of {camera.width}x{camera.height} is over {MOST_PIXELS_A_SIDE}x{MOST_PIXELS_A_SIDE} or empty"
    if not (0.0 < camera.fov < 180.0 and 0.0 < camera.near < camera.far <= MOST_METRES):
        yield f"a camera of {camera.fov} degrees from {camera.near} to {camera.far} m is none"
    if sensor.on is not None and sensor.on not in actors:
        yield f"it is on {sensor.on!r}, which is no actor"
    if len(sensor.poses) not in (1, frames) or any(_beyond([p.x, p.y, p.z]) for p in sensor.poses):
        yield "its poses are neither one nor one a frame, or out of bounds"
    if not sensor.capture or len(set(sensor.capture)) < len(sensor.capture):
        yield "it captures nothing, or something twice"


def _response(sensor: SensorPlan, variant: ScenarioPlan) -> Iterator[str]:
    """Bounds within which a picture can be made; the language's own are narrower."""
    response, camera = variant.appearance.responses[sensor.name], sensor.camera
    numbers = [v for v in response.model_dump().values() if isinstance(v, float)]
    positive = response.shutter_speed, response.iso, response.fstop, response.gamma, response.temp
    bounded = max(map(abs, numbers)) <= MOST_SETTING and min(positive) >= 0.01
    offset = 0.0 <= response.chromatic_aberration_offset < 1.0
    if not (bounded and offset and 1 <= response.supersample <= 4 and abs(response.exposure_compensation) <= 30.0):
        yield "its camera response is none"
    elif abs(camera.lens_k) > 1.0 or abs(camera.lens_kcube) > 1.0:
        yield "its lens is none"
    else:
        sound = camera.width > 0 and camera.height > 0 and 0.0 < camera.fov < 180.0
        wrong = optics.fault(camera, response.supersample) if sound else None
        if wrong is not None:
            yield f"its lens {wrong}"


def _beyond(metres: list[float]) -> bool:
    return any(abs(value) > MOST_METRES for value in metres)
