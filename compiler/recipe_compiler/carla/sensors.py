"""Converts sensors; those with equal pose, motion and geometry become one sensor with several modalities."""

from __future__ import annotations

from dataclasses import dataclass

from recipe_compiler.carla import cameras, routes
from recipe_compiler.carla.draft import Data
from recipe_compiler.carla.forms.specs import ANGLES, AXES, POSITION, Spec
from recipe_compiler.carla.handedness import WALKER_ORIGIN, Pose
from recipe_compiler.carla.report import Node, number_text
from recipe_compiler.carla.scene import SIGN_CHANGED, Scene
from recipe_compiler.ir.errors import Code
from recipe_compiler.ir.modalities import MODALITIES
from recipe_compiler.ir.streams import Stream
from recipe_compiler.schema.camera import Camera
from recipe_compiler.schema.tick import MAX_TICK, nearest_ticks
from recipe_compiler.source.yaml_reader import show

_SPEED = 0.5  # metres per frame, the collector's default
_MAX_SPEED = 100.0  # m/s, the limit of the language
_SPAWN_HEIGHT = 0.6  # metres, of CARLA's spawn points


@dataclass
class _Group:
    """The entries that become one sensor."""

    key: tuple[object, ...]
    specs: list[Spec]
    attributes: list[cameras.Attributes]
    captured: set[str]


def write(scene: Scene) -> None:
    """Write the sensors of a scene."""
    groups: list[_Group] = []
    for spec in scene.of_kind("sensor"):
        modalities = {modality for modality, _ in spec.modalities}
        attributes = cameras.read(scene.reader, spec.attributes, rgb="rgb" in modalities)
        key = _key(scene, spec, attributes)
        group = next((g for g in groups if g.key == key and not g.captured & modalities), None)
        if group is None:
            group = _Group(key, [], [], set())
            groups.append(group)
        group.specs.append(spec)
        group.attributes.append(attributes)
        group.captured |= modalities
    taken: list[str] = []
    for number, group in enumerate(groups, 1):
        fallback = "camera" if len(groups) == 1 else f"camera{number}"
        why = "one name for the sensors at this pose, of letters, digits, _ and -"
        scene.give_name(group.specs, taken, fallback, "base.sensors", why)
    for group, name in zip(groups, taken, strict=True):  # a sensor may be mounted on one that is listed later
        _write(scene, group, name)


def _key(scene: Scene, spec: Spec, attributes: cameras.Attributes) -> tuple[object, ...]:
    """Return the parent, pose, motion and geometry of a sensor; sensors with equal keys become one."""
    pose, actor = scene.mount(spec), scene.actor_of(spec)
    at = spec.node.path if pose is None else tuple(round(getattr(pose, axis), 6) for axis in (*POSITION, *ANGLES))
    ranges = () if spec.transform is None else tuple((n.low, n.high) for n in spec.transform.numbers.values())
    goal = None if spec.goal is None else tuple(spec.goal.numbers[axis].middle for axis in POSITION)
    attachment = _plain(spec.attachment) if actor is not None else ""
    arm = "" if attachment.lower() == "'rigid'" else attachment
    moves = (goal, _plain(spec.speed), _plain(spec.jitter), arm, _plain(spec.route))
    tick = _plain(spec.attributes.get("sensor_tick"))
    lens = tuple(attributes[name][0] if name in attributes else cameras.DEFAULTS.get(name) for name in cameras.GEOMETRY)
    on = "" if actor is None else actor.name
    return (on, at, ranges if any(low != high for low, high in ranges) else (), *moves, tick, lens)


def _plain(node: Node | None) -> str:
    return "" if node is None else repr(node.value.plain)


def _write(scene: Scene, group: _Group, name: str) -> None:
    to = f"base.sensors.{name}"
    _write_mount(scene, group, f"{to}.mount")
    _write_camera(scene, group, f"{to}.camera")
    capture = [modality for modality in MODALITIES if modality in group.captured]
    scene.draft.set(f"{to}.capture", capture)
    several = "the sensors at this pose become one with all their modalities"
    why = several if len(group.specs) > 1 else "the modality of this sensor"
    for modality, node in (each for spec in group.specs for each in spec.modalities):
        is_named = not isinstance(node.value.data, dict)  # else the sensor itself, which implies it
        absent = "OSCAR adds instance segmentation to every camera"
        is_same = node.value.data == modality
        scene.reader.ledger.record(
            node if is_named else None, f"{to}.capture", modality, "" if is_same else why, absent
        )
    motion = _motion(scene, group, to)
    if motion:
        scene.draft.set(f"{to}.motion", motion)
    _write_tick(scene, group, to)


def _write_mount(scene: Scene, group: _Group, to: str) -> None:
    spec = group.specs[0]
    pose, actor = scene.mount(spec), scene.actor_of(spec)
    mount: dict[str, Data] = {} if actor is None else {"on": actor.name}
    if pose is None:
        spots = scene.site.town.spots["vehicle"]
        spot = Stream(scene.settings.seed, "carla", spec.name, "spawn").choice(spots)
        pose = Pose(spot.x, spot.y, spot.z + _SPAWN_HEIGHT, spot.yaw)
        at = {axis: getattr(pose, axis) for axis in (*POSITION, "yaw")}
        why = "no transform is given, so the collector chooses a random spawn point: one of this town, by seed and name"
        scene.reader.ledger.default(to, at, why)
    for axis in AXES:
        is_given = spec.transform is not None and spec.transform.numbers[axis].node is not None
        if is_given or axis not in ("pitch", "roll") or abs(getattr(pose, axis)) >= 1e-9:
            mount[axis] = round(getattr(pose, axis), 6)
    scene.draft.set(to, mount)
    for each in group.specs:
        _note_mount(scene, each, pose, to)
        _note_attachment(scene, each, mount, to)


def _note_mount(scene: Scene, spec: Spec, pose: Pose, to: str) -> None:
    """Record the outcome of the numbers of a transform."""
    if scene.follows_road(spec):
        routes.note_mount(scene, spec, pose, to)
        return
    if spec.transform is None:
        return
    parent = spec.parent
    if parent is not None and parent.kind == "sensor":
        why = f"given in the frame of {parent.name}, another sensor"
        for axis, number in spec.transform.numbers.items():
            scene.note_number(number, f"{to}.{axis}", round(getattr(pose, axis), 6), why)
        return
    lift = {"z": WALKER_ORIGIN} if parent is not None and parent.kind == "walker" else {}
    scene.note(spec.transform, to, pose, (*POSITION, *ANGLES), scene.shift if parent is None else lift)


def _note_attachment(scene: Scene, spec: Spec, mount: dict[str, Data], to: str) -> None:
    ledger, actor = scene.reader.ledger, scene.actor_of(spec)
    if actor is None:
        ledger.mapped(spec.role, to, "its pose", "the frame of a sensor that is fixed in the world")
    elif spec.role is not None:
        why = "the actor with that role, or the actor that its sensor is attached to"
        name = actor.name
        ledger.record(spec.role, f"{to}.on", name, "" if scene.reader.text(spec.role) == name else why)
    kind = scene.reader.text(spec.attachment)
    if kind is None or spec.attachment is None:
        return
    kinds = {"rigid": "rigid", "springarm": "spring_arm", "springarmghost": "spring_arm_ghost"}
    wanted = kinds.get(kind.lower().replace("_", ""))
    if wanted is None:
        scene.reader.reject(spec.attachment, f"{show(kind)} is not an attachment", "write rigid or spring_arm")
    elif actor is None:
        ledger.ignored(spec.attachment, "this sensor is not attached to an actor")
    elif wanted == "rigid":
        ledger.mapped(spec.attachment, f"{to}.on", actor.name, "a sensor on an actor is fixed to it")
    elif not (mount["x"] or mount["y"]):
        ledger.ignored(spec.attachment, "an arm of zero length: the sensor is fixed to the actor")
    else:
        mount["attachment"] = wanted
        ledger.record(spec.attachment, f"{to}.attachment", wanted, "" if wanted == kind else "the same kind of arm")


def _write_camera(scene: Scene, group: _Group, to: str) -> None:
    camera: dict[str, Data] = {}
    for attributes in group.attributes:
        camera |= {parameter: value for parameter, (value, _) in attributes.items()}
        cameras.note(scene.reader, attributes, to)
    for parameter, value in cameras.DEFAULTS.items():
        if parameter not in camera and (parameter != "gamma" or "rgb" in group.captured):
            camera[parameter] = value
            scene.reader.ledger.default(f"{to}.{parameter}", value, "not given: the collector's, or CARLA's, default")
    order = [name for name in Camera.model_fields if name in camera]
    scene.draft.set(to, {name: camera[name] for name in order})


def _motion(scene: Scene, group: _Group, to: str) -> dict[str, Data]:
    """Return the motion of a sensor: along a line or a road, and its jitter."""
    motion: dict[str, Data] = {}
    for spec in group.specs:
        if spec.route is not None:
            motion |= routes.write(scene, spec, to)
        elif spec.goal is not None:
            motion |= _linear(scene, spec, f"{to}.motion")
        else:
            scene.reader.ledger.ignored(spec.speed, "without a destination_transform it does not move")
        jitter: dict[str, Data] = {}
        for node in spec.jitter.children() if spec.jitter is not None else ():
            axis = str(node.path[-1])
            if axis not in POSITION:
                scene.reader.ledger.ignored(node, "jitter has x, y and z only")
                continue
            value = scene.reader.number(node, -10.0, 10.0)
            if value is not None:
                jitter[axis] = abs(value)
                why = "" if value >= 0.0 else "a magnitude has no sign"
                scene.reader.ledger.record(node, f"{to}.motion.jitter.{axis}", abs(value), why)
        if any(jitter.values()):
            motion["jitter"] = jitter
    return motion


def _linear(scene: Scene, spec: Spec, to: str) -> dict[str, Data]:
    """Return the linear motion of a sensor to its destination; the collector's speed is in metres per frame."""
    assert spec.goal is not None
    goal, parent = spec.goal, spec.parent
    pose = scene.world(goal.pose) if parent is None else scene.pose_on(parent, goal.pose) or goal.pose
    end = {axis: round(getattr(pose, axis), 6) for axis in POSITION}
    is_moved = parent is None and scene.vector != (0.0, 0.0)
    where = ", moved" if is_moved else "" if parent is None else ", in the frame of its parent"
    for axis in POSITION:
        why = (SIGN_CHANGED if axis == "y" else "the same number") + where
        scene.note_number(goal.numbers[axis], f"{to}.linear.to.{axis}", end[axis], why)
    for axis in ANGLES:
        ignored = "the collector changes the position only, not the rotation"
        scene.reader.ledger.ignored(goal.numbers[axis].node, ignored)
    fps = scene.settings.fps
    given = scene.reader.number(spec.speed, 0.0)
    per_frame = _SPEED if given is None else given
    speed = round(per_frame * fps, 6)
    why = f"{per_frame:g} metres per frame at {fps} frames per second"
    if spec.speed is not None and not 0.0 < speed <= _MAX_SPEED:
        remedy = f"write more than 0 and at most {_MAX_SPEED / fps:g} metres per frame"
        scene.reader.reject(spec.speed, f"{why} is {speed:g} m/s", remedy, Code.OUT_OF_RANGE)
    scene.reader.ledger.record(spec.speed, f"{to}.linear.speed", speed, why, f"no speed is given: {why}")
    return {"linear": {"to": end, "speed": speed}}


def _write_tick(scene: Scene, group: _Group, to: str) -> None:
    """Write the time between two pictures; if it is shorter than a step, CARLA takes one at every step."""
    fps = scene.settings.fps
    for spec in group.specs:
        node = spec.attributes.get("sensor_tick")
        tick = scene.reader.number(node, 0.0, MAX_TICK)
        if node is None or tick is None:
            continue
        if tick * fps <= 1.0:
            scene.reader.ledger.mapped(node, f"{to}.tick", 0, "a picture at every frame, the default")
        elif near := nearest_ticks(tick, fps):
            message = f"{tick:g} s is {tick * fps:g} frames at {fps} frames per second"
            remedy = f"write {' or '.join(map(number_text, near))}, or 0 for every frame"
            scene.reader.reject(node, message, remedy, Code.OUT_OF_RANGE)
        else:
            scene.draft.set(f"{to}.tick", tick)
            scene.reader.ledger.kept(node, f"{to}.tick")
