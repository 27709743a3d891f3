"""Converts walkers, vehicles, patches and actor generators."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

from recipe_compiler.carla.catalogue import blueprints
from recipe_compiler.carla.draft import Data, name_for
from recipe_compiler.carla.forms.oscar import class_of
from recipe_compiler.carla.forms.specs import ANGLES, AXES, Spec, Transform
from recipe_compiler.carla.handedness import Pose, board_pose
from recipe_compiler.carla.report import Node
from recipe_compiler.carla.scene import ACTORS, Scene
from recipe_compiler.ir.errors import Code
from recipe_compiler.schema.fields import MAX_SEED, TRAFFIC_LIMIT
from recipe_compiler.source.yaml_reader import show

_NO_ATTRIBUTE = {
    "is_invincible": "actors are never injured",
    "sticky_control": "vehicles drive themselves",
    "terramechanics": "roads do not deform",
    "speed": "the speed of the entry is used instead",
    "can_use_wheelchair": "no wheelchairs",
    "use_wheelchair": "no wheelchairs",
}
_NO_TEXTURE = {
    "texture": "an image file: copy it into the recipe's folder and name it as `texture` of the patch, in another mode",
    "texture_roi": "part of the texture",
}
_FIRST_COUNTS = {"number_of_vehicles": "vehicles", "number_of_walkers": "pedestrians"}  # of OSCAR's first generator
_MAX_SPEED = 60.0  # m/s, the limit of the language


def write(scene: Scene) -> None:
    """Write the actors of a scene."""
    for spec in scene.of_kind(*ACTORS):
        _write_actor(scene, spec)
    for spec in scene.of_kind("patch"):
        _write_patch(scene, spec)


def _write_actor(scene: Scene, spec: Spec) -> None:
    to = f"base.actors.{spec.name}"
    ledger = scene.reader.ledger
    found = blueprints.closest_match(spec.blueprint, spec.kind, scene.settings.seed, spec.name)
    if found is None:
        message = f"CARLA has no {spec.kind} {show(spec.blueprint)}"
        remedy = f"write a blueprint of its catalogue, or {spec.kind}.*"
        scene.reader.reject(spec.name_node or spec.node, message, remedy, Code.UNKNOWN_NAME)
        return
    blueprint, why = found
    scene.draft.set(f"{to}.blueprint", blueprint)
    if spec.name_node is not None and blueprint != spec.name_node.value.data:
        why = why or f"the name with the prefix {spec.kind}"
    absent = spec.origin or "no blueprint is given: any of this kind"
    ledger.record(spec.name_node, f"{to}.blueprint", blueprint, why, absent)
    _write_speed(scene, spec, to)
    if spec.transform is not None:
        _write_start(scene, spec, spec.transform, f"{to}.start")
    if spec.goal is not None:
        _write_goal(scene, spec, spec.goal, f"{to}.goal")
    _write_look(scene, spec, to)
    ledger.ignored(spec.jitter, "only sensors are shaken")
    ledger.ignored(spec.attachment, "only sensors are attached")


def _write_speed(scene: Scene, spec: Spec, to: str) -> None:
    ledger, speed, why = scene.reader.ledger, 0.0, ""
    if spec.stands:
        why = "no controller is attached: it does not move, as in OSCAR"
    elif spec.kind == "vehicle":
        ledger.ignored(spec.speed, "the collector ignores the speed of vehicles, which follow traffic")
        return
    else:
        given = scene.reader.number(spec.speed, 0.0, _MAX_SPEED)
        if given is None:
            return
        speed = given
    scene.draft.set(f"{to}.speed", speed)
    ledger.record(spec.speed, f"{to}.speed", speed, why, why)


def _write_start(scene: Scene, spec: Spec, transform: Transform, to: str) -> None:
    pose = _free(scene, spec, transform, to)
    scene.draft.set(to, {axis: round(getattr(pose, axis), 6) for axis in ("x", "y", "yaw")})
    scene.note(transform, to, pose, ("x", "y", "yaw"), scene.shift)
    if transform.numbers["yaw"].node is None:
        scene.reader.ledger.default(f"{to}.yaw", pose.yaw, "CARLA's default rotation")
    scene.reader.ledger.ignored(transform.numbers["z"].node, "actors stand on the ground")
    for axis in ("roll", "pitch"):
        scene.reader.ledger.ignored(transform.numbers[axis].node, "actors start upright")


def _write_goal(scene: Scene, spec: Spec, goal: Transform, to: str) -> None:
    if spec.kind == "vehicle":
        why = "the collector sends only walkers to a destination; vehicles follow traffic"
        scene.reader.ledger.ignored(goal.node, why)
        return
    pose = _free(scene, spec, goal, to)
    scene.draft.set(to, {axis: round(getattr(pose, axis), 6) for axis in ("x", "y")})
    scene.note(goal, to, pose, ("x", "y"), scene.shift)
    for axis in ("z", *ANGLES):
        scene.reader.ledger.ignored(goal.numbers[axis].node, "a goal is a position on the ground")


def _free(scene: Scene, spec: Spec, transform: Transform, to: str) -> Pose:
    """Return the pose of a transform in the town, at the nearest free position if its own is occupied."""
    pose = scene.world(transform.pose)
    x, y = scene.site.free(pose.x, pose.y, vehicle=spec.kind == "vehicle")
    if (x, y) != (pose.x, pose.y):
        why = f"x {pose.x:g}, y {pose.y:g} is inside an obstacle of this town: moved to the nearest free position"
        scene.reader.ledger.default(to, {"x": x, "y": y}, why)
    return replace(pose, x=x, y=y)


def _write_look(scene: Scene, spec: Spec, to: str) -> None:
    for name, node in spec.attributes.items():
        if name == "role_name":
            continue
        why = _NO_ATTRIBUTE.get(name, "not an attribute of actors in recipes")
        if name == "color" and spec.kind == "vehicle" and node.value.data is not None:
            text = scene.reader.text(node) or "{}"
            if colour := _colour(text):
                scene.draft.set(f"{to}.look", {"paint": colour})
                scene.reader.ledger.mapped(node, f"{to}.look.paint", colour, "red, green, blue as hexadecimal digits")
                continue
            if "{" not in text:
                scene.reader.reject(node, f"{show(text)} is not a colour", 'write red, green, blue, such as "255,0,0"')
            why = "a random colour, the default"
        scene.reader.ledger.ignored(node, why)


def _colour(text: str) -> str:
    """Return `"255,0,0"` as `#ff0000`; empty for other forms."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3 or not all(re.fullmatch("[0-9]{1,3}", part) and int(part) < 256 for part in parts):
        return ""
    return "#" + "".join(f"{int(part):02x}" for part in parts)


def _write_patch(scene: Scene, spec: Spec) -> None:
    """Write a patch as a free-standing board in the mode `green`, the colour of OSCAR's screen."""
    reader, ledger = scene.reader, scene.reader.ledger
    spec.name = name_for(spec.wanted_name or "patch", [each.name for each in scene.specs], "patch")
    to = f"base.patches.{spec.name}"
    size: dict[str, float] = {}
    for key in ("width", "height"):
        node = spec.attributes.get(key)
        if node is None:
            reader.reject(spec.node, f"the patch has no {key}", f"write its {key} in metres", Code.MISSING_KEY)
        size[key] = reader.number(node, 0.01, 100.0) or 1.0
        ledger.kept(node, f"{to}.on.size.{key}")
    if spec.transform is None:
        reader.reject(spec.node, "the patch has no transform", "write where it is", Code.MISSING_KEY)
        return
    pose = board_pose(scene.world(spec.transform.pose), size["height"])
    at = {axis: round(getattr(pose, axis), 6) for axis in AXES}
    scene.draft.set(to, {"on": {"board": at, "size": size}, "mode": "green"})
    ledger.default(f"{to}.mode", "green", "a green screen, as OSCAR's patches without texture")
    why = "right-handed and moved: the pose of a board, whose origin is the middle of its lower edge"
    for axis, number in spec.transform.numbers.items():
        ledger.mapped(number.node, f"{to}.on.board.{axis}", at[axis], why)
    for key, why in _NO_TEXTURE.items():
        ledger.ignored(spec.attributes.get(key), why)


def write_crowds(scene: Scene) -> None:
    """Write actor generators and the chosen traffic as traffic; the sensors of the scene must have names already."""
    chosen = {"vehicles": scene.options.vehicles, "pedestrians": scene.options.pedestrians}
    totals = Counter({key: number for key, number in chosen.items() if number})
    traffic: dict[str, Data] = dict(totals)
    counted: list[tuple[str, Node]] = []
    reader = scene.reader
    for spec in scene.of_kind("generator"):
        for key, node in _counts(scene, spec):
            totals[key] += reader.integer(node, 0, TRAFFIC_LIMIT) or 0
            if totals[key] > TRAFFIC_LIMIT:
                message, remedy = f"{totals[key]} generated actors", f"keep at most {TRAFFIC_LIMIT} of a kind"
                reader.reject(node, message, remedy, Code.OUT_OF_RANGE)
            traffic[key] = totals[key]
            counted += [(key, each) for each in (node, spec.node.get("_actor_")) if each is not None]
        _add_options(scene, spec, traffic)
    for key, number in chosen.items():
        if number:
            why = "chosen in the command" if totals[key] == number else f"{number} of them are chosen in the command"
            reader.ledger.default(f"base.traffic.{key}", totals[key], why)
    for key, node in counted:
        reader.ledger.mapped(node, f"base.traffic.{key}", totals[key], "random actors of the traffic model")
    if traffic:
        scene.draft.set("base.traffic", traffic)


def _counts(scene: Scene, spec: Spec) -> list[tuple[str, Node]]:
    """Return the numbers of actors of a generator, each with its key of traffic."""
    numbers = ((key, spec.attributes.get(name)) for name, key in _FIRST_COUNTS.items())
    if first := [(key, node) for key, node in numbers if node is not None]:
        return first
    reader, class_node, node = scene.reader, spec.node.get("_actor_"), spec.attributes.get("count")
    key = {"Vehicle": "vehicles", "Walker": "pedestrians"}.get(class_of(spec.node, "_actor_"))
    if key is None or class_node is None:
        message = "an ActorsGenerator has an `_actor_`, Walker or Vehicle"
        reader.reject(class_node or spec.node, message, "write the class of the actors", Code.UNKNOWN_NAME)
    elif node is None:
        reader.reject(spec.node, "the generator has no count", "write how many actors", Code.MISSING_KEY)
    else:
        return [(key, node)]
    return []


def _add_options(scene: Scene, spec: Spec, traffic: dict[str, Data]) -> None:
    """Add the seed and the sensor of a generator to the traffic, which has only one of each."""
    ledger = scene.reader.ledger
    for node in spec.node.children():
        key = node.path[-1]
        if key == "seed" and node.value.data is not None:
            value = scene.reader.integer(node, 0, MAX_SEED)
            if value is not None and traffic.setdefault("seed", value) == value:
                ledger.kept(node, "base.traffic.seed")
            elif value is not None:
                ledger.ignored(node, f"traffic has one seed, {traffic['seed']}")
        elif key == "spawn_in_view_of_sensor":
            _add_view(scene, node, traffic)
        elif key == "attachments":
            ledger.ignored(node, "traffic needs no controllers")
        elif key not in ("_actor_", "count", *_FIRST_COUNTS) and not str(key).startswith("_"):
            ledger.ignored(node, "not an option of traffic, whose `mix` in the recipe chooses blueprints")


def _add_view(scene: Scene, node: Node, traffic: dict[str, Data]) -> None:
    target = scene.references.get(node.path)
    sensor = next((each for each in scene.of_kind("sensor") if each.node.path == target), None)
    if sensor is None:
        scene.reader.ledger.ignored(node, "it does not refer to a camera of this configuration")
    elif traffic.setdefault("near", sensor.name) == sensor.name:
        why = "of several free starts, the one most likely to be in view is chosen"
        scene.reader.ledger.mapped(node, "base.traffic.near", traffic["near"], why)
    else:
        scene.reader.ledger.ignored(node, f"traffic is near one sensor, {traffic['near']}")
