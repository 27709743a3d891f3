"""Reads the actors of a configuration in OSCAR's form: maps with a `_target_`, in `actors` or in `spawn_actors`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from recipe_compiler.carla.configuration import Reader
from recipe_compiler.carla.forms import collector
from recipe_compiler.carla.forms.specs import Kind, Spec, read_transform
from recipe_compiler.carla.report import Node
from recipe_compiler.ir.errors import Code
from recipe_compiler.source.yaml_reader import show

_CONTROLLERS = {"WalkerController": "walker", "VehicleController": "vehicle", "SensorController": "sensor"}
_KINDS: Mapping[str, Kind] = {
    "Camera": "sensor",
    "Sensor": "sensor",
    "Walker": "walker",
    "Vehicle": "vehicle",
    "Patch": "patch",
    "ActorsGenerator": "generator",
}
_NOT_ATTRIBUTES = ("transform", "attachments", "name", "modalities")
_FIRST_FORM = (
    "sensors_blueprints",
    "motion_params",
    "destination_transform",
)  # keys of cameras in OSCAR's first version
_HYDRA = ("_target_", "_recursive_", "_convert_", "_partial_")


def read(reader: Reader, root: Node) -> list[Spec]:
    """Read the actors; entries that are attached to another follow it."""
    actors, listed = root.get("actors"), root.get("spawn_actors")
    if listed is not None and isinstance(listed.value.data, str) and listed.value.data.startswith("${oc.dict.values:"):
        reader.ledger.mapped(listed, "", "the values of actors", "a reference, resolved")
        listed = None
    specs: list[Spec] = []
    actors = reader.map(actors)
    for node in actors.children() if actors is not None else ():
        _read(reader, node, None, specs, str(node.path[-1]))
    for node in reader.items(listed):
        _read(reader, node, None, specs, "")
    if (generator := root.get("actors_generator")) is not None:  # of OSCAR's first version
        _read(reader, generator, None, specs, "")
    return specs


def class_of(node: Node, key: str = "_target_") -> str:
    """Return the class name without its module; empty if there is none."""
    child = node.get(key)
    name = None if child is None else child.value.data
    return name.rsplit(".", 1)[-1] if isinstance(name, str) else ""


def _read(reader: Reader, node: Node, container: Spec | None, specs: list[Spec], name: str) -> None:
    if reader.map(node) is None:
        return
    kind = class_of(node)
    if kind not in _KINDS:
        remedy = f"write one of {', '.join((*_KINDS, *_CONTROLLERS))}"
        reader.reject(
            node.get("_target_") or node, f"{show(kind)} is not a class of OSCAR's actors", remedy, Code.UNKNOWN_NAME
        )
        return
    modalities = _modalities(reader, node, kind)
    if kind == "Sensor" and not modalities:
        return
    is_actor = kind in ("Walker", "Vehicle")
    named = (reader.text(node.get("name")) or "*") if is_actor else ""
    spec = Spec(
        node=node,
        kind=_KINDS[kind],
        blueprint=f"{kind.lower()}.{named}",
        name_node=node.get("name") if is_actor else None,
        attributes=_attributes(node),
        wanted_name=name,
        transform=read_transform(reader, node.get("transform"), ranges=True),
        container=container,
        modalities=modalities,
        stands=is_actor,
    )
    spec.speed = spec.attributes.pop("speed", None) if kind != "Camera" else None
    specs.append(spec)
    if kind == "Camera":
        _read_first_form(reader, node, spec)
    for child in reader.items(node.get("attachments")) if kind != "ActorsGenerator" else ():
        if class_of(child) in _CONTROLLERS:
            _control(reader, child, spec)
        else:
            _read(reader, child, spec, specs, "")


def _attributes(node: Node) -> dict[str, Node]:
    """Return the attributes of the blueprint of an entry by name."""
    others = (*_NOT_ATTRIBUTES, *_FIRST_FORM, *_HYDRA)
    return {str(child.path[-1]): child for child in node.children() if child.path[-1] not in others}


def _read_first_form(reader: Reader, node: Node, spec: Spec) -> None:
    """Read the blueprints and the motion of a camera of OSCAR's first version, which has no controllers of sensors."""
    for blueprint in reader.items(node.get("sensors_blueprints")):
        spec.attributes |= _attributes(blueprint)
    spec.goal = read_transform(reader, node.get("destination_transform"), ranges=True)
    if spec.goal is not None:
        spec.route = reader.map(node.get("motion_params")) or node
    else:
        reader.ledger.ignored(node.get("motion_params"), "without a destination_transform it does not move")


def _modalities(reader: Reader, node: Node, kind: str) -> tuple[tuple[str, Node], ...]:
    """Return the modalities of a camera or a sensor, each with the value that names it."""
    if kind == "Sensor":
        name_node = node.get("name")
        name = reader.text(name_node)
        if name is None or name_node is None:
            reader.reject(node, "the sensor has no name", "write a name, such as name: camera.rgb", Code.MISSING_KEY)
            return ()
        modality = collector.CAMERAS.get(f"sensor.{name}")
        if modality is None:
            collector.ignore(reader, node, name_node, f"sensor.{name}")
        return () if modality is None else ((modality, name_node),)
    if kind != "Camera":
        return ()
    found: dict[str, Node] = {}
    for child in reader.items(node.get("modalities")):
        name = reader.text(child) or ""
        modality = collector.MODALITIES.get(name)
        if modality is None:
            reader.ledger.ignored(child, f"recipes do not have a {show(name)} camera")
        elif found.setdefault(modality, child) is not child:
            reader.ledger.ignored(child, "listed twice")
    for child in reader.items(node.get("sensors_blueprints")):
        name = re.sub("(?<=[a-z])(?=[A-Z])", "_", class_of(child)).lower()
        modality, target = collector.MODALITIES.get(name), child.get("_target_")
        if modality is None or target is None:
            reader.ledger.ignored(child, f"recipes do not have a {show(name)} camera")
        else:
            found.setdefault(modality, target)
    found.setdefault("instance", node)
    return tuple(found.items())


def _control(reader: Reader, node: Node, spec: Spec) -> None:
    """Read a controller, which moves the actor that it is attached to."""
    kind = class_of(node)
    if spec.kind != _CONTROLLERS[kind]:
        reader.ledger.ignored(node, f"a {kind} does not control a {spec.kind}")
        return
    spec.stands = False
    transform = read_transform(reader, node.get("transform") or node.get("destination_transform"), ranges=True)
    if kind == "WalkerController":
        spec.goal = transform
        reader.ledger.ignored(spec.speed, "the max_speed of the controller counts")
        spec.speed = node.get("max_speed")
    elif kind == "SensorController":
        spec.goal, spec.route = transform, reader.map(node.get("motion_params")) or node
    elif transform is not None:
        reader.ledger.ignored(node, "a VehicleController follows the traffic: it has no goal")
