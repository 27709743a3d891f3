"""Converts walkers, vehicles, patches and actor generators."""

from __future__ import annotations

import re

from recipe_compiler.carla.catalogue import blueprints
from recipe_compiler.carla.draft import Data, name_for
from recipe_compiler.carla.forms.oscar import class_of
from recipe_compiler.carla.forms.specs import ANGLES, Spec, Transform
from recipe_compiler.carla.handedness import Pose, board_pose, normalize_range
from recipe_compiler.carla.report import Node
from recipe_compiler.carla.scene import ACTORS, Scene
from recipe_compiler.ir.errors import Code
from recipe_compiler.schema.fields import MAX_SEED, TRAFFIC_LIMIT
from recipe_compiler.source.yaml_reader import show

_SIGN_CHANGED = "sign changed"
_GROUND = "actors stand on the ground"
_NO_ATTRIBUTE = {
    "is_invincible": "actors are never injured",
    "sticky_control": "vehicles drive themselves",
    "terramechanics": "roads do not deform",
    "speed": "the speed of the entry is used instead",
    "can_use_wheelchair": "no wheelchairs",
    "use_wheelchair": "no wheelchairs",
}
_MAX_SPEED = 60.0  # m/s, the limit of the language


def write(scene: Scene) -> None:
    """Write the actors of a scene."""
    for spec in scene.of_kind(*ACTORS):
        _write_actor(scene, spec)
    for spec in scene.of_kind("patch"):
        _write_patch(scene, spec)


def _write_actor(scene: Scene, spec: Spec) -> None:
    name = scene.name(spec)
    to = f"base.actors.{name}"
    ledger = scene.reader.ledger
    found = blueprints.closest_match(spec.blueprint, spec.kind, scene.settings.seed, name)
    if found is None:
        message = f"CARLA has no {spec.kind} {show(spec.blueprint)}"
        remedy = f"write a blueprint of its catalogue, or {spec.kind}.*"
        scene.reader.reject(spec.name_node or spec.node, message, remedy, Code.UNKNOWN_NAME)
        return
    blueprint, why = found
    scene.draft.set(f"{to}.blueprint", blueprint)
    if spec.name_node is None:
        ledger.default(f"{to}.blueprint", blueprint, "no blueprint is given: any of this kind")
    elif why or blueprint != spec.name_node.value.data:
        ledger.mapped(spec.name_node, f"{to}.blueprint", blueprint, why or f"the name with the prefix {spec.kind}")
    else:
        ledger.kept(spec.name_node, f"{to}.blueprint")
    _write_speed(scene, spec, to)
    if spec.transform is not None:
        _write_start(scene, spec, spec.transform, to)
    if spec.goal is not None:
        _write_goal(scene, spec, spec.goal, to)
    _write_look(scene, spec, to)
    for node, reason in (
        (spec.jitter, "only sensors are shaken"),
        (spec.attachment, "only sensors are attached"),
    ):
        if node is not None:
            ledger.ignored(node, reason)


def _write_speed(scene: Scene, spec: Spec, to: str) -> None:
    if spec.stands:
        scene.draft.set(f"{to}.speed", 0)
        why = "no controller is attached: it does not move, as in OSCAR"
        if spec.speed is None:
            scene.reader.ledger.default(f"{to}.speed", 0, why)
        else:
            scene.reader.ledger.mapped(spec.speed, f"{to}.speed", 0, why)
    elif spec.speed is not None and spec.kind == "vehicle":
        scene.reader.ledger.ignored(spec.speed, "the collector ignores the speed of vehicles, which follow traffic")
    elif spec.speed is not None:
        speed = scene.reader.number(spec.speed, 0.0, _MAX_SPEED)
        if speed is not None:
            scene.draft.set(f"{to}.speed", speed)
            scene.reader.ledger.kept(spec.speed, f"{to}.speed")


def _write_start(scene: Scene, spec: Spec, transform: Transform, to: str) -> None:
    pose = scene.world(transform.pose)
    x, y = _free(scene, spec, (pose.x, pose.y), f"{to}.start")
    start: dict[str, Data] = {"x": round(x, 6), "y": round(y, 6), "yaw": round(pose.yaw, 6)}
    scene.draft.set(f"{to}.start", start)
    numbers = transform.numbers
    _note_position(scene, transform, f"{to}.start", (x, y))
    yaw = numbers["yaw"]
    if yaw.node is None:
        scene.reader.ledger.default(f"{to}.start.yaw", pose.yaw, "CARLA's default rotation")
    scene.draw(yaw, f"actors.{scene.name(spec)}.start.yaw", *normalize_range(-yaw.high, -yaw.low))
    scene.note_number(yaw, f"{to}.start.yaw", pose.yaw, _SIGN_CHANGED)
    for axis in ("z", "roll", "pitch"):
        node = numbers[axis].node
        if node is not None:
            scene.reader.ledger.ignored(node, _GROUND if axis == "z" else "actors start upright")


def _write_goal(scene: Scene, spec: Spec, goal: Transform, to: str) -> None:
    if spec.kind == "vehicle":
        if goal.node is not None:
            scene.reader.ledger.ignored(
                goal.node, "the collector sends only walkers to a destination; vehicles follow traffic"
            )
        return
    pose = scene.world(goal.pose)
    at = _free(scene, spec, (pose.x, pose.y), f"{to}.goal")
    scene.draft.set(f"{to}.goal", {"x": round(at[0], 6), "y": round(at[1], 6)})
    _note_position(scene, goal, f"{to}.goal", at)
    for axis in ("z", *ANGLES):
        node = goal.numbers[axis].node
        if node is not None:
            scene.reader.ledger.ignored(node, "a goal is a position on the ground")


def _note_position(scene: Scene, transform: Transform, to: str, at: tuple[float, float]) -> None:
    """Record the outcome of x and y of a world position; write draws for ranges."""
    dx, dy = scene.vector
    below = to.removeprefix("base.")
    x, y = transform.numbers["x"], transform.numbers["y"]
    scene.draw(x, f"{below}.x", x.low + dx, x.high + dx)
    scene.draw(y, f"{below}.y", dy - y.high, dy - y.low)
    scene.note_number(x, f"{to}.x", at[0], f"moved by {dx:g}")
    scene.note_number(y, f"{to}.y", at[1], f"{_SIGN_CHANGED}, moved by {dy:g}")


def _free(scene: Scene, spec: Spec, at: tuple[float, float], to: str) -> tuple[float, float]:
    """Return a position, or the nearest free one if it is occupied, which is reported."""
    free = scene.site.free(*at, vehicle=spec.kind == "vehicle")
    if free != at:
        why = f"x {at[0]:g}, y {at[1]:g} is inside an obstacle of this town: moved to the nearest free position"
        scene.reader.ledger.default(to, {"x": free[0], "y": free[1]}, why)
    return free


def _write_look(scene: Scene, spec: Spec, to: str) -> None:
    for name, node in spec.attributes.items():
        if name == "role_name":
            continue
        text = (
            scene.reader.text(node)
            if name == "color" and spec.kind == "vehicle" and node.value.data is not None
            else None
        )
        colour = _colour(text)
        if colour is not None:
            scene.draft.set(f"{to}.look", {"paint": colour})
            scene.reader.ledger.mapped(node, f"{to}.look.paint", colour, "red, green, blue as hexadecimal digits")
        elif text is not None and "{" not in text:
            scene.reader.reject(node, f"{show(text)} is not a colour", 'write red, green, blue, such as "255,0,0"')
        else:
            why = _NO_ATTRIBUTE.get(
                name, "not an attribute of actors in recipes" if text is None else "a random colour, the default"
            )
            scene.reader.ledger.ignored(node, why)


def _colour(text: str | None) -> str | None:
    """Return `"255,0,0"` as `#ff0000`; None for other forms."""
    match = re.fullmatch(r"\s*(\d{1,3})\s*,\s*(\d{1,3})\s*,\s*(\d{1,3})\s*", text or "")
    if match is None or any(int(part) > 255 for part in match.groups()):
        return None
    return "#" + "".join(f"{int(part):02x}" for part in match.groups())


def _write_patch(scene: Scene, spec: Spec) -> None:
    """Write a patch as a free-standing board in the mode `green`, the colour of OSCAR's screen."""
    reader, ledger = scene.reader, scene.reader.ledger
    taken = [*scene.names.values()]
    name = name_for(spec.wanted_name or "patch", taken, "patch")
    scene.names[id(spec)] = name
    to = f"base.patches.{name}"
    size: dict[str, float] = {}
    for key in ("width", "height"):
        node = spec.attributes.get(key)
        if node is None:
            reader.reject(spec.node, f"the patch has no {key}", f"write its {key} in metres", Code.MISSING_KEY)
        value = reader.number(node, 0.01, 100.0)
        size[key] = value or 1.0
        if node is not None:
            ledger.kept(node, f"{to}.on.size.{key}")
    transform = spec.transform
    pose = board_pose(scene.world(transform.pose if transform is not None else Pose()), size["height"])
    at = {axis: round(getattr(pose, axis), 6) for axis in ("x", "y", "z", "yaw", "pitch", "roll")}
    scene.draft.set(to, {"on": {"board": at, "size": size}, "mode": "green"})
    ledger.default(f"{to}.mode", "green", "a green screen, as OSCAR's patches without texture")
    why = "right-handed and moved: the pose of a board, whose origin is the middle of its lower edge"
    if transform is None:
        reader.reject(spec.node, "the patch has no transform", "write where it is", Code.MISSING_KEY)
        return
    for axis, number in transform.numbers.items():
        for leaf in number.node.leaves() if number.node is not None else ():
            ledger.mapped(leaf, f"{to}.on.board.{axis}", at[axis], why)
    for key, reason in (
        (
            "texture",
            "an image file: copy it into the recipe's folder and name it as `texture` of the patch, in another mode",
        ),
        ("texture_roi", "part of the texture"),
    ):
        node = spec.attributes.get(key)
        if node is not None:
            ledger.ignored(node, reason)


def write_crowds(scene: Scene) -> None:
    """Write actor generators as traffic; the sensors of the scene must have names already."""
    traffic: dict[str, Data] = {}
    totals = {"vehicles": 0, "pedestrians": 0}
    counted: list[tuple[str, Node]] = []
    for spec in scene.of_kind("generator"):
        class_node, node = spec.node.get("_actor_"), spec.attributes.get("count")
        key = {"Vehicle": "vehicles", "Walker": "pedestrians"}.get(class_of(spec.node, "_actor_"))
        if key is None or class_node is None:
            message = "an ActorsGenerator has an `_actor_`, Walker or Vehicle"
            scene.reader.reject(class_node or spec.node, message, "write the class of the actors", Code.UNKNOWN_NAME)
            continue
        if node is None:
            scene.reader.reject(spec.node, "the generator has no count", "write how many actors", Code.MISSING_KEY)
            continue
        totals[key] += scene.reader.integer(node, 0, TRAFFIC_LIMIT) or 0
        if totals[key] > TRAFFIC_LIMIT:
            message, remedy = f"{totals[key]} generated actors", f"keep at most {TRAFFIC_LIMIT} of a kind"
            scene.reader.reject(node, message, remedy, Code.OUT_OF_RANGE)
        traffic[key] = totals[key]
        counted += [(key, node), (key, class_node)]
        _add_options(scene, spec, traffic)
    for key, node in counted:
        scene.reader.ledger.mapped(node, f"base.traffic.{key}", totals[key], "random actors of the traffic model")
    if traffic:
        scene.draft.set("base.traffic", traffic)


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
        elif key not in ("_actor_", "count") and not str(key).startswith("_"):
            ledger.ignored(node, "not an option of traffic, whose `mix` in the recipe chooses blueprints")


def _add_view(scene: Scene, node: Node, traffic: dict[str, Data]) -> None:
    target = scene.references.get(node.path)
    sensor = next((each for each in scene.of_kind("sensor") if each.node.path == target), None)
    if sensor is None:
        scene.reader.ledger.ignored(node, "it does not refer to a camera of this configuration")
    elif traffic.setdefault("near", scene.name(sensor)) == scene.name(sensor):
        why = "of several free starts, the one most likely to be in view is chosen"
        scene.reader.ledger.mapped(node, "base.traffic.near", traffic["near"], why)
    else:
        scene.reader.ledger.ignored(node, f"traffic is near one sensor, {traffic['near']}")
